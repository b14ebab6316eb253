"""ISO 230-2 figures of an axis against hand-computed cases and a plain loop."""

import csv
import json
import statistics
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from iso_command import app as app
from typer.testing import CliRunner

from ptt.errors import TableError
from ptt.judge.iso.axis import axis_figures
from ptt.judge.iso.figures import is_axis_file, read_axis_figures

SHARED = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "iso230" / "iso230_points.csv"


def runs(deviations):
    """{(target, direction): deviations} -> target, direction, measured, (n,) each."""
    rows = [(t, d, t + e) for (t, d), errors in deviations.items() for e in errors]
    return tuple(np.array(column, dtype=float) for column in zip(*rows, strict=True))


HAND = {  # s = 0.001 sqrt(2) for a pair 0.002 apart
    (0.0, 1): (0.001, 0.003),
    (0.0, -1): (-0.001, -0.001),
    (100.0, 1): (0.010, 0.010),
    (100.0, -1): (0.003, 0.009),
}


def test_axis_figures_by_hand():
    figures = axis_figures(*runs(HAND), axis="x")
    s = 0.001 * np.sqrt(2)
    np.testing.assert_allclose(figures.mean, [[0.002, 0.010], [-0.001, 0.006]], atol=1e-12)
    np.testing.assert_allclose(figures.std, [[s, 0.0], [0.0, 3 * s]], atol=1e-12)
    np.testing.assert_allclose(figures.reversal, [0.003, 0.004], atol=1e-12)
    assert figures.reversal_max == pytest.approx(0.004)
    assert figures.reversal_mean == pytest.approx(0.0035)
    assert (figures.repeatability.up, figures.repeatability.down) == pytest.approx((4 * s, 12 * s))
    assert figures.repeatability.both == pytest.approx(max(2 * s + 0.003, 6 * s + 0.004, 12 * s))
    assert (figures.systematic.up, figures.systematic.down) == pytest.approx((0.008, 0.007))
    assert figures.systematic.both == pytest.approx(0.011)
    assert figures.mean_deviation == pytest.approx(0.008 - 0.0005)
    assert figures.accuracy.up == pytest.approx(0.010 - (0.002 - 2 * s))
    assert figures.accuracy.down == pytest.approx(0.006 + 6 * s - min(-0.001, 0.006 - 6 * s))
    high, low = max(0.010, 0.006 + 6 * s), min(-0.001, 0.002 - 2 * s, 0.006 - 6 * s)
    assert figures.accuracy.both == pytest.approx(high - low)
    assert figures.standard == "ISO style, n = 2"


def test_reversal_term_rules_where_it_is_the_larger():
    figures = axis_figures(*runs({(0.0, 1): (0.0, 0.001), (0.0, -1): (0.05, 0.05)}))
    assert figures.repeatability.both == pytest.approx(2 * 0.001 / np.sqrt(2) + 0.0495)


def test_reversals_of_either_sign_cancel_in_their_mean_and_not_in_their_largest():
    runs_of = {(0.0, 1): (0.004, 0.004), (0.0, -1): (0.0, 0.0), (9.0, 1): (0.0, 0.0), (9.0, -1): (0.006, 0.006)}
    figures = axis_figures(*runs(runs_of))
    assert (figures.reversal_mean, figures.reversal_max) == pytest.approx((-0.001, 0.006))


def test_one_direction_alone_leaves_the_rest_unsaid():
    target, direction, measured = runs({k: v for k, v in HAND.items() if k[1] == 1})
    figures = axis_figures(target, direction, measured)
    answer = figures.to_dict()
    assert answer["R_um"]["up"] == pytest.approx(4 * np.sqrt(2))
    assert answer["R_um"]["down"] is answer["R_um"]["both"] is answer["B_um"] is answer["M_um"] is None
    json.dumps(answer, allow_nan=False)


def test_a_reading_that_is_missing_is_left_out():
    target, direction, measured = runs({k: (*v, np.nan) for k, v in HAND.items()})
    assert axis_figures(target, direction, measured).to_dict() == axis_figures(*runs(HAND)).to_dict()


def test_a_target_without_scatter_is_refused():
    with pytest.raises(TableError, match=r"x: target 100 mm has 1 run\(s\) downward"):
        axis_figures(*runs(HAND | {(100.0, -1): (0.003,)}), axis="x")


@given(st.integers(0, 10_000), st.floats(-5.0, 5.0))
@settings(max_examples=40)
def test_axis_figures_ignore_a_shift_and_follow_a_mirror(seed, shift):
    random = np.random.default_rng(seed)
    target, direction = np.repeat([0.0, 10.0, 30.0], 10), np.tile([1.0, -1.0], 15)
    measured = target + random.normal(0.0, 0.01, 30)
    one = axis_figures(target, direction, measured)
    moved = axis_figures(target, direction, measured + shift)
    turned = axis_figures(-target, -direction, -measured)
    for figure in ("repeatability", "systematic", "accuracy"):
        a, b, c = (getattr(x, figure) for x in (one, moved, turned))
        assert (a.up, a.down, a.both) == pytest.approx((b.up, b.down, b.both), abs=1e-9)
        assert (a.up, a.down, a.both) == pytest.approx((c.down, c.up, c.both), abs=1e-9)
    assert one.reversal_max == pytest.approx(moved.reversal_max, abs=1e-9)
    assert one.accuracy.both >= max(one.accuracy.up, one.accuracy.down, one.systematic.both)
    assert one.repeatability.both >= one.reversal_max
    assert one.standard == "ISO 230-2:2014"


def loop_figures(rows):
    """B, R, E, M, A both ways in mm from (direction, target, measured) strings, by the standard's text."""
    groups = {}
    for row in rows:
        key = (float(row["target_mm"]), row["direction"])
        groups.setdefault(key, []).append(float(row["measured_mm"]) - float(row["target_mm"]))
    mean = {key: statistics.fmean(values) for key, values in groups.items()}
    s = {key: statistics.stdev(values) for key, values in groups.items()}
    targets = sorted({key[0] for key in groups})
    gap = {t: mean[t, "fwd"] - mean[t, "bwd"] for t in targets}
    r = [max(2 * s[t, "fwd"] + 2 * s[t, "bwd"] + abs(gap[t]), 4 * s[t, "fwd"], 4 * s[t, "bwd"]) for t in targets]
    middle = [(mean[t, "fwd"] + mean[t, "bwd"]) / 2 for t in targets]
    return (
        max(abs(g) for g in gap.values()),
        max(r),
        max(mean.values()) - min(mean.values()),
        max(middle) - min(middle),
        max(mean[k] + 2 * s[k] for k in mean) - min(mean[k] - 2 * s[k] for k in mean),
    )


@pytest.mark.skipif(not SHARED.exists(), reason="the measured axis runs are not on this machine")
def test_measured_axes_agree_with_a_plain_loop():
    result = read_axis_figures(SHARED)
    with SHARED.open() as file:
        rows = list(csv.DictReader(file))
    assert len(result.axes) == len({row["file"] for row in rows}) == 7
    for axis in result.axes:
        expected = loop_figures([row for row in rows if row["file"] == axis.axis])
        found = (
            axis.reversal_max,
            axis.repeatability.both,
            axis.systematic.both,
            axis.mean_deviation,
            axis.accuracy.both,
        )
        assert found == pytest.approx(expected, abs=1e-12)
        assert axis.standard == "ISO 230-2:2014"


HEAD = "direction,target_mm,measured_mm\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("direction,target_mm\nup,0\n", "no column measured"),
        (HEAD, "no rows"),
        (HEAD + "up,0,0\nsideways,0,0\n", "row 3, column direction: unknown direction 'sideways'"),
        (HEAD + "up,0,0\nup,0,a\n", r"row 3, column measured: not a number \('a'\)"),
        (HEAD + "up,,0\n", r"row 2, column target: not a number \(''\)"),
        (HEAD + "up,0,\nup,0,\n", "no readings"),
        ("axis," + HEAD + "X,up,0,0\nX,up,0,0.1\nY,up,0,0\n", r"axis\.csv, axis Y: target 0 mm has 1 run"),
        ("target_um," + HEAD + "0,up,0,0\n", "two columns target"),
        (HEAD + "up,0,0\n", r"1 run\(s\) upward"),
    ],
)
def test_bad_axis_files_are_one_clear_line(tmp_path, text, message):
    path = tmp_path / "axis.csv"
    path.write_text(text)
    with pytest.raises(TableError, match=message):
        read_axis_figures(path)


def test_command_on_axis_runs(app, tmp_path):
    path = tmp_path / "axis.csv"
    lines = [f"{'up' if d > 0 else 'down'},{t},{t + e}" for (t, d), errors in HAND.items() for e in errors]
    path.write_text(HEAD + "\n".join(lines) + "\n")
    assert is_axis_file(path)
    answer = json.loads(CliRunner().invoke(app, [str(path), "--json"]).stdout)
    assert answer["axes"][0]["B_um"] == pytest.approx(4.0)
    assert "reversal B" in CliRunner().invoke(app, [str(path)]).stdout
    for words in (["--also", str(path)], ["--set", "temp_c=20"], ["--any-direction"]):  # was silently left aside
        assert CliRunner().invoke(app, [str(path), *words]).exit_code != 0


@pytest.mark.parametrize(
    ("factor", "unit"),
    [
        (1e-3, "measured_mm looks like metres"),
        (25.4, "target_mm .* inches"),
        (1e3, "measured_mm looks like micrometres"),
    ],
)
def test_axis_runs_in_another_unit_are_refused(tmp_path, factor, unit):
    rows = [f"{way},{target},{factor * target + 1e-5}" for _ in range(5) for way in "+-" for target in (0, 100, 200)]
    path = tmp_path / "axis.csv"
    path.write_text("\n".join(["direction,target_mm,measured_mm", *rows]) + "\n")
    with pytest.raises(TableError, match=unit):
        read_axis_figures(path)


def test_axis_runs_may_say_another_unit_in_a_title(tmp_path):
    rows = [(way, target, target + 2e-3 * (way == "+")) for _ in range(3) for way in "+-" for target in (0, 100, 200)]
    for title, factor in (("measured_mm", 1.0), ("measured_um", 1e3), ("measured_m", 1e-3)):
        path = tmp_path / f"{title}.csv"
        lines = [f"{way},{target},{factor * read!r}" for way, target, read in rows]
        path.write_text("\n".join([f"direction,target_mm,{title}", *lines]) + "\n")
        assert is_axis_file(path)
        assert read_axis_figures(path).axes[0].reversal_max == pytest.approx(2e-3, abs=1e-9)
