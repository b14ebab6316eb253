"""Long lists of targets block by block: the commands of the list as a whole, byte for byte."""

from multiprocessing import get_all_start_methods, get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from test_rig_bench import bench as rig_bench

from ptt.correct import blocks
from ptt.correct.compensate import compensate
from ptt.effects.drive import FollowingError, HomingOffset
from ptt.effects.reversal import Backlash, Windup
from ptt.effects.towers import TowerTilt
from ptt.errors import InputError
from ptt.files import write_parts
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model, Term
from ptt.rig import simulate
from ptt.run import written
from ptt.run.direction import STANDSTILL
from ptt.run.pace import PACES, SMOOTH
from ptt.run.readers import numbers
from ptt.run.reading import read_table
from ptt.run.table import Table, make_table
from ptt.run.written import write_table

HOMING = torch.tensor([0.35, -0.22, 0.12], dtype=torch.float64)
DATA = Path(__file__).resolve().parents[1] / "data"


def late(lag: float, pace: int = SMOOTH) -> torch.Tensor:
    return torch.tensor([lag, lag, lag, pace], dtype=torch.float64)


def model_of(file: MachineFile, *more: Term) -> Model:
    model = Model(file)
    leans, play = [2e-3, -1e-3, 1e-3, 3e-3, -2e-3, 1e-3], [0.04, 0.05, 0.06, 1.0]
    for effect, values in ((TowerTilt(), leans), (Backlash(), play)):
        model = model + Term(effect, torch.tensor(values, dtype=torch.float64))
    for term in more:
        model = model + term
    return model


def targets_of(file: MachineFile, rows: int = 260, *, stands: bool = True, **columns) -> Table:
    """A path with turns, a slider that stands at first, a stretch of standstill, and rows out of reach."""
    time = np.linspace(0.0, 26.0, rows)[:, None]
    heights = 280.0 + 40.0 * np.sin(time * np.array([1.0, 1.3, 0.7]) + np.array([0.0, 1.0, 2.0]))
    if stands:
        heights[:45, 1] = heights[45, 1]
        heights[120:150] = heights[120]
    place = build_mechanism(file.machine).forward(torch.tensor(heights)).numpy()
    place[[0, 1, 77, 78, 131]] = [900.0, 0.0, 0.0]
    place[200:212] = [0.0, 0.0, 900.0]
    return make_table(place, payload_kg=2.0, **columns)


def in_blocks(monkeypatch: pytest.MonkeyPatch, rows: int, beside: int = 12) -> None:
    monkeypatch.setattr(blocks, "ROWS", rows)
    monkeypatch.setattr(blocks, "NEIGHBOUR_ROWS", beside)


@pytest.mark.parametrize(
    "rows", [20, pytest.param(45, marks=pytest.mark.long), pytest.param(61, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("runs", [1, 3])
def test_blocks_give_the_commands_of_the_whole(bench: MachineFile, monkeypatch, rows: int, runs: int) -> None:
    targets = targets_of(bench)
    targets = targets.replace(run=np.arange(targets.rows) * runs // targets.rows, run_label=("a", "b", "c")[:runs])
    whole = predict_text(bench, targets)
    in_blocks(monkeypatch, rows)
    assert predict_text(bench, targets) == whole


def predict_text(file: MachineFile, targets: Table) -> str:
    commands = compensate(model_of(file), targets)
    assert 0 < (commands.status == "out of reach").sum() < 30
    names = ("q", "reversal", "shift", "first_order_gap", "nearest", "missed", "status")
    return repr([getattr(commands, name).tolist() for name in names])


@pytest.mark.parametrize("clock", ["time_s", "feed_mm_s"])
def test_blocks_know_the_speed_and_the_turns_before_and_behind_them(bench: MachineFile, monkeypatch, clock) -> None:
    lag = Term(FollowingError(), late(0.02))
    turn = Term(Windup(), torch.tensor([0.01, 0.02, 0.03, 2.0, 1.0, 3.0], dtype=torch.float64))
    columns = {"time_s": np.arange(260.0)}
    if clock == "feed_mm_s":  # tells the speeds of all rows once it tells one
        columns["feed_mm_s"] = np.where(np.arange(260) < 160, 30.0, 0.0)
    targets = targets_of(bench, stands=False, **columns)
    model = model_of(bench, lag, turn)
    whole = compensate(model, targets)
    in_blocks(monkeypatch, 50, 60)
    parts = compensate(model, targets)
    assert (parts.status == whole.status).all()
    for name in ("q", "reversal", "shift", "missed"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=0.0, atol=1e-8)


def test_blocks_know_the_ramps_that_a_clock_shows_beside_a_feed(bench: MachineFile, monkeypatch) -> None:
    ramp = np.cumsum(np.minimum(np.minimum(np.arange(80), np.arange(80)[::-1]) + 1.0, 4.0))  # mm, by equal time
    way = np.concatenate([ramp, ramp, ramp])
    places = np.column_stack([40.0 * np.cos(way / 40.0), 40.0 * np.sin(way / 40.0), np.full(240, 5.0)])
    time = 0.2 * np.arange(240) + 5.0 * np.repeat(np.arange(3), 80)
    lap = {"run": np.repeat(np.arange(3), 80), "run_label": ("a", "b", "c")}
    targets = make_table(places, time_s=time, feed_mm_s=20.0).replace(**lap)
    model = Model(bench) + Term(FollowingError(), late(0.02))
    whole, by_feed = compensate(model, targets), compensate(model, targets.replace(time_s=None))
    assert np.abs(whole.q - by_feed.q).max() > 0.1
    in_blocks(monkeypatch, 70, 20)
    np.testing.assert_allclose(compensate(model, targets).q, whole.q, rtol=0.0, atol=1e-8)


def lagging(file: MachineFile, *, play: bool, pace: int = SMOOTH) -> Model:
    lag = Term(FollowingError(), late(0.02, pace))
    return model_of(file, lag) if play else Model(file) + Term(HomingOffset(), HOMING) + lag


CLOCKS = {
    "slow": {"time_s": np.arange(260.0)},
    "fast": {"time_s": 0.1 * np.arange(260.0)},
    "as fast as the lag": {"time_s": 0.02 * np.arange(260.0)},
    "feed": {"feed_mm_s": np.full(260, 30.0)},
}
HARDEST = "as fast as the lag"


@pytest.mark.parametrize(
    ("clock", "play", "pace"),
    [
        # Each clock with play and each pace on the hardest clock: the others are asked with the long ones.
        pytest.param(
            clock, play, pace, marks=() if (play and clock != "fast") or clock == HARDEST else pytest.mark.long
        )
        for clock in CLOCKS
        for play, pace in ((True, SMOOTH), *((False, pace) for pace in PACES))
    ],
)
def test_axes_that_lag_settle_at_standstill_whole_and_in_blocks(
    bench: MachineFile, monkeypatch, clock, play, pace
) -> None:
    """Newton steps that leave out what a move does to speeds did not: they were off by up to 0.5 mm here."""
    targets, model = targets_of(bench, **CLOCKS[clock]), lagging(bench, play=play, pace=pace)
    whole = compensate(model, targets, limit=50.0)
    assert whole.sent.sum() > 200
    assert np.nanmax(whole.missed) < 3.0 * STANDSTILL  # a slider that moves by less takes up no gap
    in_blocks(monkeypatch, 50, 110)
    parts = compensate(model, targets, limit=50.0)
    assert (parts.status == whole.status).all()
    np.testing.assert_allclose(parts.q, whole.q, rtol=0.0, atol=1e-8)


def test_a_lag_as_long_as_a_move_is_said_row_by_row(bench: MachineFile) -> None:
    """No command of such a row moves its axis, by v tau: the system is singular."""
    lag = Term(FollowingError(), late(0.2))
    commands = compensate(model_of(bench, lag), targets_of(bench, time_s=0.2 * np.arange(260.0)), limit=50.0)
    assert (commands.status == "out of reach").sum() > 5
    assert np.nanmax(commands.missed) < 3.0 * STANDSTILL


@pytest.mark.parametrize("feed", [5.0, 30.0])
def test_a_rig_whose_axes_lag_arrives_in_time(bench: MachineFile, feed: float) -> None:
    """On the way, where it stops, and where it stands: the rig's speeds are its own."""
    turn = np.linspace(0.0, 26.0, 1500)[:, None] * np.array([1.0, 1.3, 0.7]) + np.array([0.0, 1.0, 2.0])
    heights = 280.0 + 40.0 * np.sin(turn)
    heights = np.concatenate([heights[:700], np.repeat(heights[700:701], 6, axis=0), heights[700:]])
    place = build_mechanism(bench.machine).forward(torch.tensor(heights)).numpy()
    frame = pd.DataFrame(place, columns=["x_cmd", "y_cmd", "z_cmd"])
    drive = {"homing_mm": HOMING.tolist(), "following_s": [0.02] * 3}
    rig = rig_bench(drive=drive, conditions={"moving": True, "feed_mm_s": feed})
    alone = simulate(rig, frame, noise=False)
    targets = make_table(place, time_s=alone.frame["time_s"].to_numpy())
    sliders = pd.DataFrame(compensate(lagging(bench, play=False), targets).q, columns=["b1", "b2", "b3"])
    corrected = simulate(rig, frame, sliders=sliders, noise=False)
    before, after = (np.linalg.norm(run.truth - place, axis=1).max() for run in (alone, corrected))
    assert before > 0.3
    assert after < 1e-6


def test_what_is_handed_on_matters(bench: MachineFile, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks that forget what was before them would be told: the comparison above can fail."""
    targets = targets_of(bench)
    whole = compensate(model_of(bench), targets).q
    in_blocks(monkeypatch, 20)
    monkeypatch.setattr(blocks, "hand_on", lambda *given: None)
    assert np.nanmax(np.abs(compensate(model_of(bench), targets).q - whole)) > 0.01


@pytest.mark.parametrize("runs", [1, 2])
def test_blocks_remember_that_nobody_said_from_where_the_first_row_was_reached(bench, monkeypatch, runs: int) -> None:
    """By steps of micrometres a drive takes hundreds of rows to wind up."""
    place = np.arange(240)[:, None] * np.array([0.002, 0.0, 0.004])
    targets = make_table(place, run=np.arange(240) * runs // 240)
    twist = Term(Windup(), torch.tensor([0.02, 0.02, 0.02, 2.0, 2.0, 2.0], dtype=torch.float64))
    whole = compensate(Model(bench) + twist, targets, nearest=False)
    assert (whole.approach[1:120] > 0.01).all() and (whole.approach[120] == 0.0) == (runs == 2)
    in_blocks(monkeypatch, 50)
    parts = compensate(Model(bench) + twist, targets, nearest=False)
    np.testing.assert_allclose(parts.approach, whole.approach, rtol=0.0, atol=1e-9)
    assert (parts.status == whole.status).all()


def test_files_are_read_and_written_in_parts_as_in_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = read_table(DATA / "sealed_one" / "run.csv")
    table = table.replace(name=np.array([f'p "{row}", #' if row % 3 else "" for row in range(table.rows)]))
    write_table(table, tmp_path / "one.csv")
    frame = pd.DataFrame(written.columns_of(table))
    assert (tmp_path / "one.csv").read_text() == frame.to_csv(index=False, lineterminator="\n")
    monkeypatch.setattr(written, "ROWS", 37)
    monkeypatch.setattr(numbers, "ROWS", 41)
    again = read_table(tmp_path / "one.csv")
    write_table(again, tmp_path / "two.csv")
    assert (tmp_path / "two.csv").read_bytes() == (tmp_path / "one.csv").read_bytes()
    lines = (tmp_path / "one.csv").read_text().splitlines()
    lines[100] = lines[100].rsplit(",", 1)[0] + ",x"
    (tmp_path / "bad.csv").write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"row 101, column .*not a number \('x'\)"):
        read_table(tmp_path / "bad.csv")


def test_a_file_that_fails_in_the_middle_was_never_there(tmp_path: Path) -> None:
    def parts():
        yield b"first\n"
        raise RuntimeError("no more")

    (tmp_path / "out.csv").write_text("old")
    with pytest.raises(RuntimeError):
        write_parts(tmp_path / "out.csv", parts())
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("out.csv", "old")]


def _texts(columns: dict[str, np.ndarray], said) -> None:
    said.put(b"".join(written.text_parts(columns)))


@pytest.mark.skipif("fork" not in get_all_start_methods(), reason="no fork")
def test_a_worker_that_may_have_no_children_writes_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(written, "ROWS", 7)
    columns, context = {"x": np.linspace(0.0, 1.0, 30)}, get_context("fork")
    said = context.Queue()
    worker = context.Process(target=_texts, args=(columns, said), daemon=True)
    worker.start()
    assert said.get(timeout=60) == b"".join(written.text_parts(columns)) == written.text_of(columns)
    worker.join()
