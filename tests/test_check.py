"""Set-up mistakes are named with a proof and undone; sound set-ups are left alone."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from setup_mistakes import agreement, try_case
from setup_mistakes_cases import CASES
from setup_mistakes_runs import draw_run

from ptt.commands.main import run_alone
from ptt.machine import MachineFile, load_machine, parse_machine
from ptt.run.reading import read_table
from ptt.run.table import Table, take_rows
from ptt.run.written import write_table
from ptt.setup import MISTAKES, check_setup
from ptt.setup.machine import describe_machine

DATA = Path(__file__).parent.parent / "data" / "sealed_one"


def run_verb(verb: str, *arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        run_alone(verb, [str(argument) for argument in arguments])
    return int(ended.value.code or 0)


@pytest.mark.parametrize("seed", [0, pytest.param(6, marks=pytest.mark.long)])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)
def test_every_mistake_is_named_and_cured_on_foreign_machines(case: object, seed: int) -> None:
    """A drawn machine, run with everything; the benchmark does it on twenty and with fewer columns."""
    have = case.have[0]  # type: ignore[attr-defined]
    tried = try_case(case, have, seed)  # type: ignore[arg-type]
    assert tried.shows
    assert tried.named, str(tried.found)
    assert tried.cured, str(tried.found)


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(4, 12))])
def test_sound_set_ups_with_faults_are_not_accused(seed: int) -> None:
    file, table = draw_run(20_000 + seed, faults=seed % 4, rows=None if seed % 2 else 20)
    for have in (table, table.replace(target=np.full_like(table.target, np.nan)), table.replace(command=None)):
        assert check_setup(file, have).findings == ()


def test_the_sample_runs_are_sound(sound: tuple[MachineFile, Table]) -> None:
    assert check_setup(*sound).findings == ()
    root = DATA.parent
    for run, machine in (("experiment1.csv", "machine.toml"), ("volume.csv", "machine.toml")):
        assert check_setup(load_machine(root / machine), read_table(root / run)).findings == ()


def test_what_is_the_same_thing_is_said_as_one(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, table.replace(measured=table.measured * [1.0, 1.0, -1.0]))
    (only,) = found.findings
    assert only.mistake == "axis-sign"
    assert "z negated" in only.words
    assert "swapped" in only.words
    assert only.before_um is not None and only.after_um is not None
    assert only.before_um > 1000.0 * only.after_um


def test_a_blunder_of_the_drawing_is_cured_in_its_text() -> None:
    text = (
        '[machine] # ours\nkind = "three-ptt"\nbase_radius_mm = 100\nplatform_radius_mm = 200\nlink_length_mm = 300\n'
    )
    drawing = parse_machine(text + "slider_travel_mm = [150, 420]\n")
    run = read_table(DATA / "run.csv")
    found = check_setup(drawing, run)
    assert [item.mistake for item in found.findings] == ["radii-interchanged"]
    assert "# ours" in found.file.text
    assert parse_machine(found.file.text).machine.base_radius_mm == 200.0  # type: ignore[union-attr]


def test_compensated_commands_are_no_mistake(sound: tuple[MachineFile, Table]) -> None:
    """Commands that a compensation moved by up to a millimetre lie beside the targets' own."""
    file, table = sound
    assert table.command is not None
    away = np.sin(table.target / 20.0)
    assert check_setup(file, table.replace(command=table.command + away)).findings == ()


def test_two_mistakes_are_both_named(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    assert table.command is not None
    broken = table.replace(
        measured=table.measured / 25.4, command=table.command[:, [1, 0, 2]], temp_c=table.temp_c + 273.15
    )
    found = check_setup(file, broken)
    assert {item.mistake for item in found.sure} == {"unit-scale", "slider-order", "temperature-unit"}
    assert found.table is not None
    assert (agreement(found.file, found.table) < 1.5 * agreement(file, table)).all()


def test_check_writes_json_and_cured_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = read_table(DATA / "run.csv")
    write_table(run.replace(measured=run.measured / 25.4), tmp_path / "inch.csv")
    code = run_verb(
        "check", tmp_path / "inch.csv", "--model", DATA / "machine.toml", "--out-run", tmp_path / "cured.csv",
        "--out-model", tmp_path / "cured.toml", "--json",
    )  # fmt: skip
    said = json.loads(capsys.readouterr().out)
    assert code == 0
    assert said["ok"] is False
    assert said["findings"][0]["mistake"] == "unit-scale"
    assert set(said["findings"][0]) == {"mistake", "words", "fix", "rms_um", "sure"}
    np.testing.assert_allclose(read_table(tmp_path / "cured.csv").measured, run.measured, rtol=1e-12)
    assert load_machine(tmp_path / "cured.toml") == load_machine(DATA / "machine.toml")


def test_a_cured_run_has_all_columns_of_the_run_in_its_order(tmp_path: Path) -> None:
    """A deviation that stands alone, a role that is the same everywhere, an own column, a joint too many, a gap."""
    rows = (DATA / "run.csv").read_text().splitlines()[:61]
    titles = rows[0].split(",")
    x, y = titles.index("x_meas"), titles.index("y_meas")
    cells = [row.split(",") for row in rows]
    cells[30][x] = ""
    for row in cells[1:]:
        row[x], row[y] = row[y], row[x]
    ends = [["x_std", "operator", "dir4"], *[["0.004", "Ann", "1.0"]] * 60]
    text = "".join(",".join([*row, *end]) + "\n" for row, end in zip(cells, ends, strict=True))
    (tmp_path / "run.csv").write_text(text)
    machine, out = DATA / "machine.toml", tmp_path / "cured.csv"
    assert run_verb("check", tmp_path / "run.csv", "--model", machine, "--out-run", out) == 0
    cured = [line.split(",") for line in out.read_text().splitlines()]
    assert cured[0] == [*titles, "x_std", "operator", "dir4", "y_std"]
    assert {row[titles.index("repeat")] for row in cured[1:]} == {"1"}
    assert {(*row[-4:],) for row in cured[1:]} == {("", "Ann", "1.0", "0.004")}, (
        "the deviation goes where its readings go"
    )
    gap = cured[30]
    assert gap[x] == "" and float(gap[y]) == float(cells[30][x])


def test_a_file_in_which_nothing_was_undone_is_said_to_be_as_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    """A clock that goes back once is `perhaps` a mistake, a negated axis is one of the run, radii are the drawing's."""
    asked, flipped, turned = tmp_path / "asked.csv", tmp_path / "flipped.csv", tmp_path / "turned.toml"
    time = np.arange(sound[1].rows, dtype=float)
    time[100:110] -= 50.0
    write_table(sound[1].replace(time_s=time), asked)
    write_table(sound[1].replace(measured=sound[1].measured * [1.0, 1.0, -1.0]), flipped)
    drawing = (DATA / "machine.toml").read_text()
    turned.write_text(drawing.replace("200.0", "R").replace("100.0", "200.0").replace("R", "100.0"))
    as_it_was, undone = "unchanged: no certain mistake to correct", "with its certain mistakes corrected"
    for run, machine, of_run, of_machine in (
        (asked, DATA / "machine.toml", as_it_was, as_it_was),
        (flipped, DATA / "machine.toml", undone, as_it_was),
        (DATA / "run.csv", turned, as_it_was, undone),
    ):
        outs = tmp_path / "out.csv", tmp_path / "out.toml"
        run_verb("check", run, "--model", machine, "--out-run", outs[0], "--out-model", outs[1])
        told = capsys.readouterr()
        assert f"out.csv: the run, {of_run}" in told.err and f"out.toml: the machine file, {of_machine}" in told.err
        assert run is not asked or "perhaps row-order" in told.out


def test_verbs_refuse_what_is_sure_and_go_on_anyway(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    broken = tmp_path / "broken.csv"
    write_table(sound[1].replace(measured=sound[1].measured * [1.0, 1.0, -1.0]), broken)
    given = (broken, "--model", DATA / "machine.toml", "--json")
    assert run_verb("diagnose", *given) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"] == "setup"
    assert said["suggested"] == []
    assert said["verdict_probability"] == {"missing": 0.0, "nothing-missing": 0.0, "unknown": 0.0}
    assert said["setup"][0]["mistake"] == "axis-sign"
    assert run_verb("fit", *given) == 3
    assert "axis-sign" in capsys.readouterr().err
    assert run_verb("fit", *given, "--anyway") == 0
    assert json.loads(capsys.readouterr().out)["steps"]
    assert run_verb("compare", broken, "--model", DATA / "machine.toml") == 0
    assert capsys.readouterr().out.startswith("axis-sign: ")  # before any figure


def test_a_machine_file_alone_is_described_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_verb("check", DATA / "machine.toml", "--drawing", tmp_path / "bench.png") == 0
    assert run_verb("check", DATA / "machine.toml", "--drawing", tmp_path / "bench.csv") == 2
    assert not (tmp_path / "bench.csv").exists()
    assert "b1 = 282.843" in capsys.readouterr().out  # sqrt(300^2 - 100^2)
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_written_fails_no_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "machine.toml"
    path.write_bytes((DATA / "machine.toml").read_bytes())
    (tmp_path / "machine_drawing.png").mkdir()
    assert run_verb("check", path, "--json") == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["drawing"] is None and "not drawn: " in told.err
    assert run_verb("check", path, "--drawing", tmp_path / "machine_drawing.png") == 2


def test_reach_of_a_machine_stays_within_the_travel(sound: tuple[MachineFile, Table]) -> None:
    """On the axis every slider stands at z + sqrt(L^2 - (R - r)^2), so travel ends are the reach but for a step."""
    said = describe_machine(sound[0])
    drop = np.sqrt(300.0**2 - 100.0**2)
    assert said.reach_mm[1] == pytest.approx(150.0 - drop, abs=3.0)
    assert said.reach_mm[2] == pytest.approx(420.0 - drop, abs=3.0)


@pytest.mark.parametrize(
    ("azimuths", "said"),
    [
        ("[0.0, 120.0, 240.0]", None),
        ("[0.0, 90.0, 180.0]", None),  # uneven, and still held
        ("[10.0, 20.0, 30.0]", "azimuths 10, 20, 30 deg) that the tool is hardly held: a slider's error may grow"),
        ("[0.1745, 2.1817, 4.3633]", "perhaps they are in rad, and would be 9.998, 125, 250 deg"),
        ("[1.0, 2.0, 3.0]", "perhaps they are in rad, and would be 57.3, 114.6, 171.9 deg"),
    ],
)
def test_towers_that_hardly_hold_the_tool_are_remarked_on(azimuths: str, said: str | None) -> None:
    text = (DATA / "machine.toml").read_text()
    start = text.index("slider_azimuth_deg")
    line = text[start : text.index("\n", start)]
    remarks = describe_machine(parse_machine(text.replace(line, f"slider_azimuth_deg = {azimuths}"))).remarks
    assert len(remarks) == (said is not None) and (said or "") in " ".join(remarks)
    assert ("rad" in " ".join(remarks)) == (said is not None and "rad" in said)


def test_radii_that_hardly_hold_the_tool_are_not_put_down_to_the_towers() -> None:
    text = (DATA / "machine.toml").read_text().replace("platform_radius_mm = 100.0", "platform_radius_mm = 190.0")
    assert "platform_radius_mm = 190.0" in text
    (remark,) = describe_machine(parse_machine(text.replace("150.0, 420.0", "100.0, 600.0"))).remarks
    assert remark.startswith("the links hardly hold the tool at home") and "towers" not in remark


def test_names_are_those_of_the_docs_and_the_benchmark_knows_no_others() -> None:
    page = (DATA.parents[1] / "docs" / "setup.md").read_text()
    table = page.split("## Names")[1].split("## Measured")[0]
    cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert sorted(re.findall(r"`([a-z-]+)`", " ".join(cells))) == sorted(MISTAKES)
    assert {name for case in CASES for name in case.names} <= set(MISTAKES)


@pytest.mark.parametrize("rows", [3, 60])
def test_too_little_to_judge_is_said(sound: tuple[MachineFile, Table], rows: int) -> None:
    """Three poses, or sixty readings of one: nothing was judged, and nothing is said to hold together."""
    file, table = sound
    few = take_rows(table, np.arange(3) if rows == 3 else np.zeros(rows, dtype=int))
    found = check_setup(file, few)
    assert found.ok and "too little to judge" in str(found)
    assert found.to_dict()["too_little"] == f"{1 if rows == 60 else 3} different pose{'' if rows == 60 else 's'} " + (
        "with a reading, but 5 are needed"
    )
    assert check_setup(file, table).to_dict()["too_little"] is None


def test_a_small_path_shows_its_mistake_by_a_steep_fall() -> None:
    """The machine stands on its other side, the path is 36 mm high: 1.6 mm, and 4 um with the sliders above."""
    case = next(case for case in CASES if case.title == "sliders on the wrong side")
    tried = try_case(case, "sliders", 5005)
    assert tried.named and tried.cured, str(tried.found)


def test_without_readings_only_what_is_asked_holds_together(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    said = str(check_setup(file, table.replace(measured=np.full((table.rows, 3), np.nan))))
    assert said == f"no mistakes found in targets and commands; there are no readings ({table.rows} rows)"


def test_what_nothing_explains_does_not_hold_together(sound: tuple[MachineFile, Table]) -> None:
    """The readings of some other run: no known mistake, and no word of a set-up that holds."""
    file, table = sound
    other = np.random.default_rng(4).uniform(-80.0, 80.0, table.measured.shape)
    found = check_setup(file, table.replace(measured=other))
    assert found.ok and "no machine is built that far off" in str(found)
    assert "no mistakes found" not in str(found)
    assert check_setup(file, table).to_dict()["unexplained"] is None


def test_a_column_of_readings_that_stands_still_is_named_in_what_nothing_explains(sound) -> None:
    file, table = sound
    still = table.measured * [0.0, 1.0, 1.0] + [12.0, 0.0, 0.0]
    assert "x_meas is 12 in every row" in check_setup(file, table.replace(measured=still)).unexplained


def test_readings_that_are_far_off_in_a_part_of_the_run_alone_are_said() -> None:
    """Two sliders change places for a third of a run: the others agree, and hide it from any mean. Rows are lines."""
    file, table = draw_run(2, rows=90)
    assert table.command is not None
    row = np.arange(table.rows)
    there = (row >= 40) & (row < 70)
    other = np.where(there[:, None], table.command[:, [1, 0, 2]], table.command)
    found = check_setup(file, table.replace(target=np.full_like(table.target, np.nan), command=other))
    assert not found.findings and "between rows 42 and 71, are off the commands" in str(found)
    few = np.where((row < 3)[:, None], table.measured + 20.0, table.measured)  # gross errors
    assert check_setup(file, table.replace(measured=few)).to_dict()["unexplained"] is None


def test_poses_that_match_in_two_ways_are_named_and_left_alone() -> None:
    """A cube of poses looks the same from four sides: the order is wrong, and no reading can tell which is right."""
    file, table = draw_run(2, rows=100)
    grid = np.stack(np.meshgrid(*[np.linspace(-30.0, 30.0, 3)] * 3), axis=-1).reshape(-1, 3)
    cube = take_rows(table, np.arange(len(grid))).replace(target=grid, command=None, std=None)
    mixed = cube.replace(measured=np.random.default_rng(1).permutation(grid) + 500.0)
    found = check_setup(file, mixed)
    assert [item.mistake for item in found.sure] == [
        "row-order"
    ] and "several pairings match equally well" in found.sure[0].words
    np.testing.assert_array_equal(found.table.measured, mixed.measured)  # type: ignore[union-attr]


def test_sliders_in_another_order_are_shown_first_and_may_be_gone_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    """Commands that contradict the targets: compare still compares, and `add --anyway` goes on by the commands."""
    _, table = sound
    assert table.command is not None
    write_table(table.replace(command=table.command[:, [1, 0, 2]]), tmp_path / "run.csv")
    given = (tmp_path / "run.csv", "--model", DATA / "machine.toml", "--json")
    assert run_verb("compare", *given) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["setup"][0]["mistake"] == "slider-order"
    assert data["rms_um"]["total"] > 1000.0
    words = ("backlash", *given[1:], "--out", tmp_path / "out.toml")
    assert run_verb("add", given[0], *words) == 3
    assert run_verb("add", given[0], *words, "--anyway") == 0
