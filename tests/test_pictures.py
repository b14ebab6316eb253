"""Pictures: no empty panel, no label over another, a scale under every column."""

from itertools import combinations
from pathlib import Path

from matplotlib.figure import Figure

import ptt
from ptt.show.card.picture import _draw_apart
from ptt.show.plots.common import in_micro, png

DATA = Path(__file__).resolve().parents[1] / "data"


def test_commands_of_joint_targets_are_drawn_where_they_bring_the_tool() -> None:
    """Where only joint commands are given the drawing says their targets, which are seen from above as others are."""
    arm, bench = (ptt.load(DATA / name) for name in ("arm/machine.toml", "machine.toml"))
    joints = ptt.predict(arm, ptt.read_targets(DATA / "arm" / "targets.csv", arm)).plot()
    places = ptt.predict(bench, ptt.read_targets(DATA / "targets.csv", bench)).plot()
    assert len(joints.axes) == len(places.axes) == 3  # with the bar of colours


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
