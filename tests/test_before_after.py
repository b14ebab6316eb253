"""Two runs of one machine side by side: figures, shared poses, what got worse; readings are made here."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch

from ptt.commands.main import run
from ptt.door.evaluating import measured
from ptt.door.model import Model, as_model
from ptt.errors import TableError
from ptt.judge.aimed import aim, lent_in_words
from ptt.judge.before_after import compare_pair, format_pair
from ptt.machine import MachineFile, load_machine
from ptt.mechanisms import build_mechanism
from ptt.run.reading import read_table
from ptt.run.table import Table, take_rows
from ptt.show.report.about_use import pair_section
from ptt.show.report.blocks import Words
from ptt.show.report.words import words_of

ARM = Path(__file__).resolve().parents[1] / "data" / "arm" / "machine.toml"
OFF = np.array([0.11, -0.07, 0.09, 0.13, -0.08, 0.1])  # mm; hundredths of that in rad
TARGET = ("x_cmd", "y_cmd", "z_cmd")

MACHINE = """[machine]
kind = "three-ptt"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_azimuth_deg = [0.0, 120.0, 240.0]
slider_travel_mm = [100.0, 480.0]
screw_lead_mm = 5.0
[tracker]
frame = "trusted"
"""


def write(folder: Path, name: str, target: np.ndarray, error: np.ndarray) -> Path:
    frame = pd.DataFrame(target, columns=["x_cmd", "y_cmd", "z_cmd"])
    frame[["x_meas", "y_meas", "z_meas"]] = target + error
    frame.to_csv(folder / name, index=False)
    return folder / name


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "machine.toml").write_text(MACHINE)
    return tmp_path


@pytest.mark.parametrize("below", [15, 30, 45])
def test_poses_in_two_planes_have_no_middle(folder: Path, below: int) -> None:
    """The higher one of two planes was called 'z middle'."""
    target = np.random.default_rng(2).uniform(-50.0, 50.0, (60, 3))
    target[:, 2] = np.where(np.arange(60) < below, -20.0, 20.0)
    error = np.where(target[:, 2:] < 0.0, 0.01, 0.03) * np.ones(3)
    table = read_table(write(folder, "run.csv", target, error))
    zones = compare_pair(table, table, load_machine(folder / "machine.toml")).where()
    assert [zone["where"] for zone in zones[:-4]] == ["z low", "z high"]
    assert zones[0]["before_um"] < zones[1]["before_um"]


def test_figures_are_those_of_the_errors_that_were_put_in(folder: Path) -> None:
    random = np.random.default_rng(1)
    target = random.uniform(-50.0, 50.0, (60, 3))
    first, second = random.normal(0.0, 0.1, (60, 3)), random.normal(0.0, 0.01, (60, 3))
    second[7] = 10.0 * first[7]  # one pose got worse
    paths = write(folder, "a.csv", target, first), write(folder, "b.csv", target[::-1], second[::-1])
    data = compare_pair(*map(read_table, paths), load_machine(folder / "machine.toml")).to_dict()
    for axis, name in enumerate("xyz"):
        before, after = (1e3 * np.sqrt(np.mean(e[:, axis] ** 2)) for e in (first, second))
        assert data["before"]["rms_um"][name] == pytest.approx(before)
        assert data["after"]["rms_um"][name] == pytest.approx(after)
        assert data["reduction_percent"][name] == pytest.approx(100.0 * (1.0 - after / before))
    assert data["shared_poses"] == 60
    assert next(one["row"] for one in data["worse"]).endswith("row 9")  # line 9 of the file, titles are line 1
    assert len(data["where"]) == 7


def test_the_quarter_in_which_a_run_is_off_has_its_name(folder: Path) -> None:
    """Every pose is off by 10 um, and by ten times as much where x is high and y is low."""
    target = np.random.default_rng(4).uniform(-50.0, 50.0, (80, 3))
    aside = (target[:, 0] >= np.median(target[:, 0])) & (target[:, 1] < np.median(target[:, 1]))
    error = 0.01 * np.where(aside, 10.0, 1.0)[:, None] * [0.0, 0.0, 1.0]
    paths = write(folder, "a.csv", target, error), write(folder, "b.csv", target, 0.0 * error)
    data = compare_pair(*map(read_table, paths), load_machine(folder / "machine.toml")).to_dict()
    ground = {zone["where"]: zone["before_um"] for zone in data["where"] if not zone["where"].startswith("z")}
    assert ground.pop("x high, y low") == pytest.approx(100.0)
    assert set(ground) == {"x low, y low", "x low, y high", "x high, y high"}
    assert list(ground.values()) == pytest.approx([10.0] * 3)


def test_runs_on_different_poses_are_compared_as_wholes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(2)
    one = write(folder, "a.csv", random.uniform(-50, 50, (40, 3)), random.normal(0.0, 0.05, (40, 3)))
    two = write(folder, "b.csv", random.uniform(-50, 50, (30, 3)), random.normal(0.0, 0.005, (30, 3)))
    machine, pictures = folder / "machine.toml", folder / "pictures"
    words = ["compare", one, "--after", two, "--model", machine, "--plots", pictures, "--json"]
    assert run([str(word) for word in words]) == 0
    data = json.loads(capsys.readouterr().out)["before_after"]
    assert data["shared_poses"] == 0 and data["unmatched"] == {"before": 40, "after": 30}
    assert data["reduction_percent"]["total"] > 80.0
    assert (pictures / "before_after.png").stat().st_size > 10_000


def test_a_run_without_targets_is_refused(folder: Path) -> None:
    file = load_machine(folder / "machine.toml")
    target = np.random.default_rng(3).uniform(-40.0, 40.0, (20, 3))
    table = read_table(write(folder, "a.csv", target, np.zeros((20, 3))))
    blind = table.replace(target=np.full((20, 3), np.nan), command=np.full((20, 3), 290.0))
    with pytest.raises(TableError, match="no targets"):
        compare_pair(table, blind, file)


def driven(file: MachineFile, path: Path, seed: int, told: np.ndarray, *, bare: bool = True) -> Table:
    """A machine whose joints all stand a little off: commands as told, readings of where that is; repeats of each."""
    random = np.random.default_rng(seed)
    mechanism = build_mechanism(file.machine)
    off = told - OFF[: told.shape[1]] * (1.0 if file.machine.kind == "three-ptt" else 1e-2)
    place, reached = (mechanism.forward(torch.as_tensor(q)).numpy() for q in (told, off))
    reading = reached + 1e-3 * random.normal(size=place.shape)
    columns = {"name": [f"p{row}" for row in range(len(told))]} | (
        {} if bare else dict(zip(TARGET, place.T, strict=True))
    )
    unit = "_cmd" if file.machine.kind == "three-ptt" else "_cmd_rad"
    columns |= {f"{file.machine.letter}{i + 1}{unit}": told[:, i] for i in range(told.shape[1])}
    columns |= dict(zip(("x_meas", "y_meas", "z_meas"), reading.T, strict=True))
    pd.DataFrame(columns).to_csv(path, index=False)
    return read_table(path, file.machine.joints, joint_prefix=file.machine.letter)


Log = tuple[Model, np.ndarray, np.ndarray]


@pytest.fixture(params=["three-ptt", "arm"])
def log(request: pytest.FixtureRequest, folder: Path) -> Log:
    """A machine, its commands, and the same with the correction."""
    random, arm = np.random.default_rng(6), request.param == "arm"
    model = as_model(str(ARM if arm else folder / "machine.toml"), "")
    sent = random.uniform(-1.2, 1.2, (40, 6)) if arm else 330.0 + random.uniform(-20.0, 20.0, (40, 3))
    return model, sent, sent + OFF[: sent.shape[1]] * (1e-2 if arm else 1.0)


def test_a_log_of_commands_alone_is_judged_against_where_the_run_before_was_told_to_go(
    log: Log, tmp_path: Path
) -> None:
    """Where the corrected commands would put the drawing's tool is no target: it is off by the correction."""
    model, sent, corrected = log
    file = model.file
    for bare in (True, False):
        before = driven(file, tmp_path / "before.csv", 1, sent, bare=bare)
        after = driven(file, tmp_path / "after.csv", 2, corrected)
        told = measured(before, after, model)
        assert told.to_dict()["total"]["reduction_percent"] > 90.0
        assert told.to_dict()["protocol"]["targets_from_before"] == 40
        assert told.notes == (lent_in_words(40),)
        pair = compare_pair(before, after, file)
        assert pair.to_dict()["reduction_percent"]["total"] > 90.0
        assert pair.to_dict()["targets_from_before"] == 40 and lent_in_words(40) in format_pair(pair)
        assert Words(f"{lent_in_words(40)}.") in pair_section(SimpleNamespace(pair=pair)).blocks
        nameless = [table.replace(name=np.full(40, "", dtype=object)) for table in (before, after)]
        assert measured(*nameless, model).to_dict()["total"]["reduction_percent"] > 90.0


def test_a_log_of_the_commands_before_the_correction_lends_nothing(log: Log, tmp_path: Path) -> None:
    model, sent, _ = log
    file = model.file
    before, after = (driven(file, tmp_path / f"{seed}.csv", seed, sent) for seed in (1, 2))
    told = measured(before, after, model)
    assert told.notes == () and abs(told.to_dict()["total"]["reduction_percent"]) < 5.0
    assert compare_pair(before, after, file).lent == 0


def test_another_pose_of_the_same_name_or_number_lends_no_target(log: Log, tmp_path: Path) -> None:
    model, sent, corrected = log
    file = model.file
    before = driven(file, tmp_path / "before.csv", 1, sent)
    after = driven(file, tmp_path / "after.csv", 2, np.roll(corrected, 1, axis=0))
    for table in (after, after.replace(name=np.full(40, "", dtype=object))):
        assert aim(before, table, file).lent == 0
        with pytest.raises(TableError, match="no pose in common") as refused:
            measured(before, table, model)
        assert "--targets" in refused.value.fix
        with pytest.raises(TableError, match="no targets to judge against"):
            compare_pair(before, table, file)


def on_grid(folder: Path, step: float, lost: tuple[int, int]) -> tuple[MachineFile, Table, Table]:
    """A run and the same compensated, as logs without names on a grid of so many mm; in each the beam is lost once."""
    file = load_machine(folder / "machine.toml")
    grid = step * np.stack(np.meshgrid(*[np.arange(-2.0, 3.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    grid += build_mechanism(file.machine).forward(torch.full((1, 3), 330.0, dtype=torch.float64)).numpy()
    sent = build_mechanism(file.machine).inverse(torch.as_tensor(grid)).numpy()
    runs = []
    for seed, told in enumerate((sent, sent + OFF[:3])):
        table = driven(file, folder / "run.csv", seed, told)
        reading = np.where(np.arange(len(grid))[:, None] == lost[seed], np.nan, table.measured)
        runs.append(table.replace(name=np.full(len(grid), "", dtype=object), measured=reading))
    return file, runs[0], runs[1]


def test_a_beam_that_is_lost_once_in_each_run_shifts_no_row(folder: Path) -> None:
    _, before, after = on_grid(folder, 3.0, (5, 12))
    told = measured(before, after, as_model(str(folder / "machine.toml"), "")).to_dict()
    assert told["total"]["reduction_percent"] > 90.0
    assert told["protocol"]["rows"] == before.rows - 2 and told["protocol"]["targets_from_before"] == before.rows


def test_rows_that_are_shifted_by_one_on_a_narrow_grid_lend_nothing(folder: Path) -> None:
    """Each is nearer to its neighbour in the run before than the largest correction is long."""
    file, before, after = on_grid(folder, 0.6, (-1, -1))
    assert aim(before, after, file).lent == before.rows
    assert aim(before, take_rows(after, np.roll(np.arange(after.rows), 1)), file).lent == 0


def test_rows_of_the_run_after_that_nothing_tells_the_targets_of_do_not_turn_its_frame(folder: Path) -> None:
    """Where corrected commands would put the drawing's tool is no target of theirs; they are counted all the same."""
    file = load_machine(folder / "machine.toml")
    file = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted"}))
    sent = 330.0 + np.random.default_rng(6).uniform(-20.0, 20.0, (60, 3))
    before = driven(file, folder / "before.csv", 1, sent[:40])
    after = driven(file, folder / "after.csv", 2, sent + OFF[:3])
    alone = compare_pair(before, take_rows(after, np.arange(40)), file).to_dict()
    data = compare_pair(before, after, file).to_dict()
    assert data["reduction_percent"] == pytest.approx(alone["reduction_percent"])
    assert data["reduction_percent"]["total"] > 80.0
    assert data["after"]["rows"] == 40 and data["unmatched"] == {"before": 0, "after": 20}


def test_a_row_at_a_pose_of_the_run_before_counts_by_whatever_name(folder: Path) -> None:
    file = load_machine(folder / "machine.toml")
    sent = 330.0 + np.random.default_rng(6).uniform(-20.0, 20.0, (40, 3))
    before = driven(file, folder / "before.csv", 1, sent)
    after = driven(file, folder / "after.csv", 2, sent[np.random.default_rng(1).permutation(40)[:30]])
    after = after.replace(name=np.full(30, "", dtype=object))
    for given in (before, before.replace(target=in_workpiece(file, before))):
        aimed = aim(given, after, file)
        assert aimed.told.all() and aimed.lent == 0
        data = compare_pair(given, after, file).to_dict()
        assert data["shared_poses"] == 30 and data["unmatched"] == {"before": 10, "after": 0}


def test_commands_are_no_others_where_the_run_before_states_targets_of_a_workpiece(folder: Path) -> None:
    file = load_machine(folder / "machine.toml")
    sent = 330.0 + np.random.default_rng(6).uniform(-20.0, 20.0, (40, 3))
    before, after = (driven(file, folder / f"{seed}.csv", seed, sent) for seed in (1, 2))
    before = before.replace(target=in_workpiece(file, before))
    assert aim(before, after, file).lent == 0
    assert aim(before, driven(file, folder / "other.csv", 2, sent + OFF[:3]), file).lent == 40


def in_workpiece(file: MachineFile, table: Table) -> np.ndarray:
    """Where the commands put the tool, as of a workpiece that lies elsewhere, (n, 3) mm."""
    return build_mechanism(file.machine).forward(torch.as_tensor(table.command)).numpy() - [100.0, 50.0, 0.0]


def test_what_is_told_of_lent_targets() -> None:
    assert lent_in_words(0) == ""
    assert lent_in_words(1).startswith("1 row of AFTER states no target and has other commands than BEFORE")
    assert lent_in_words(2).startswith("2 rows of AFTER state no target and have other")
    for rows in (1, 2):
        assert "按之前的目标位置评判" in words_of("zh")(f"{lent_in_words(rows)}.")
