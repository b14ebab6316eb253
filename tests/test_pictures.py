"""Pictures: no empty panel, no label over another, a scale under every column."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from made_runs import machine
from matplotlib.figure import Figure

import ptt
from ptt.commands.main import run
from ptt.judge.compare.comparison import compare_run
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.show.card.picture import _draw_apart
from ptt.show.plots.common import in_micro, png
from ptt.show.plots.compare import draw_course
from ptt.show.plots.field import draw_field
from ptt.show.plots.machine import draw_machine

DATA = Path(__file__).resolve().parents[1] / "data"


def test_commands_of_joint_targets_are_drawn_where_they_bring_the_tool() -> None:
    """Where only joint commands are given the drawing says their targets, which are seen from above as others are."""
    arm, bench = (ptt.load(DATA / name) for name in ("arm/machine.toml", "machine.toml"))
    joints = ptt.predict(arm, ptt.read_targets(DATA / "arm" / "targets.csv", arm)).plot()
    places = ptt.predict(bench, ptt.read_targets(DATA / "targets.csv", bench)).plot()
    assert len(joints.axes) == len(places.axes) == 3  # with the bar of colours


@pytest.mark.parametrize("target", [[[0, 0, 0]], [[0, 0, 0], [900, 0, 0], [10, 10, 10]], [[900, 0, 0]]])
def test_commands_of_few_targets_are_all_seen_and_rounding_is_no_correction(target: list[list[float]]) -> None:
    """A line through one row cannot be seen, and one across a row that is not sent says that it was."""
    commands = ptt.predict(ptt.load(DATA / "machine.toml"), np.array(target, dtype=float))
    figure = commands.plot()
    course = next(panel for panel in figure.axes if panel.get_xlabel() == "row")
    sent = np.flatnonzero([place[0] < 900 for place in target])
    if not len(sent):
        assert course.get_legend() is None
        return
    line = course.lines[0]
    across, up = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert line.get_marker() == "." and np.isnan(across).sum() == len(sent) - 1
    assert across[np.isfinite(across)].tolist() == (sent + 1.0).tolist()
    low, high = course.get_ylim()
    assert low < np.nanmin(up) <= np.nanmax(up) < 1e-6 and high >= 1.0
    assert figure.axes[0].collections[0].norm.vmax >= 1.0


@pytest.mark.parametrize("azimuth", [(0, 120, 240), (0, 240, 120), (330, 90, 210), (10, 200, 80)])
def test_no_slider_lies_on_the_words_of_the_base_radius(azimuth: tuple[float, float, float]) -> None:
    spec = machine().machine.model_copy(update={"slider_azimuth_deg": azimuth})
    figure = draw_machine(replace(machine(), machine=spec), words=False)
    (words,) = (text for text in figure.axes[0].texts if text.get_text().startswith("base radius"))
    toward = np.degrees(np.arctan2(*words.get_position()[::-1]))
    assert min(abs((toward - own + 180.0) % 360.0 - 180.0) for own in azimuth) > 25.0


def test_labels_that_would_lie_on_one_another_are_raised() -> None:
    figure = Figure(figsize=(4.0, 4.0))
    axes = figure.add_subplot()
    notes = [
        axes.annotate(f"slider {n}: 55 um", (0.5, 0.5 + 0.005 * n), (4, 4), textcoords="offset points")
        for n in range(4)
    ]
    _draw_apart(figure, notes)
    figure.draw_without_rendering()
    boxes = [note.get_window_extent() for note in notes]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_a_written_picture_has_greek_units() -> None:
    figure = Figure()
    axes = figure.add_subplot()
    axes.set(xlabel="error [um]", title="rms_um")
    assert png(figure).startswith(b"\x89PNG")
    assert axes.get_xlabel() == in_micro("error [um]") == "error [\N{MICRO SIGN}m]" and axes.get_title() == "rms_um"


def test_targets_along_a_vertical_line_are_drawn_with_a_key_that_fits() -> None:
    """Seen from above they are one point, beside which a key of the arrows in space was wider than any picture."""
    height = np.linspace(-40.0, 40.0, 30)
    target = np.column_stack([np.full(30, 10.0), np.full(30, 14.0), height])
    read = target + np.column_stack([np.zeros((30, 2)), 0.02 * np.sin(height)])
    problem = build_problem(machine(frame="trusted"), make_table(target, measured=read))
    figure = draw_field(compare_run(Model(problem.file), problem), problem)
    above = next(panel for panel in figure.axes if panel.get_title().startswith("from above"))
    (key,) = (line for line in above.lines if line.get_color() == "black")
    start, end = key.get_xdata()
    left, right = above.get_xlim()
    assert 0.1 < (end - start) / (right - left) < 0.5
    assert png(figure).startswith(b"\x89PNG")


@pytest.mark.parametrize("rows", [4, pytest.param(5, marks=pytest.mark.long)])
def test_a_few_readings_are_drawn_though_nothing_can_be_held_against_them(rows: int, tmp_path: Path, capsys) -> None:
    sample = DATA / "sealed_three"
    lines = (sample / "run.csv").read_text().splitlines()[: rows + 1]
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    words = ["compare", str(tmp_path / "run.csv"), "--model", str(sample / "machine.toml"), "--plots", str(tmp_path)]
    assert run(words) == 0, capsys.readouterr().err
    drawn = {path.name for path in tmp_path.glob("*.png")}
    assert {"error_field.png", "histogram.png", "over_time.png"} <= drawn and "depends_on.png" not in drawn


def test_two_files_without_clocks_are_drawn_one_after_the_other() -> None:
    """Lines begin anew in each file, so that its readings lay upon those of the file before."""
    target = np.random.default_rng(4).uniform(-40.0, 40.0, (40, 3))
    read = target + np.random.default_rng(5).normal(0.0, 0.01, target.shape)
    table = replace(
        make_table(target, measured=read),
        run=np.repeat([0, 1], 20),
        run_label=("one", "two"),
        line=np.tile(np.arange(20) + 2, 2),
    )
    problem = build_problem(machine(frame="trusted"), table)
    panel = draw_course(compare_run(Model(problem.file), problem), problem).axes[-1]
    drawn = {line.get_label(): line.get_xdata() for line in panel.lines}
    assert np.all(np.diff(drawn["reading"]) > 0) and drawn["next run"][0] > drawn["reading"][0]
    assert panel.get_xlabel() == "row"
