"""What a model's run measured of loads, temperatures, speeds and times, and commands beyond it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from made_runs import machine, measure
from told_models import with_effects

from ptt.correct import blocks
from ptt.correct.compensate import compensate
from ptt.correct.context import beyond_context, beyond_lines
from ptt.effects.curve import Curve
from ptt.machine import load_machine
from ptt.model.model import Model, Term
from ptt.run.problem import build_problem
from ptt.run.ranges import ranges_of
from ptt.run.table import concat_tables, make_table

FILE = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")


def model_over(column: str, low: float, high: float, **effects: dict[str, object]) -> Model:
    """A model whose run had values of one context from `low` to `high`."""
    model = with_effects(FILE, **effects)
    history = ({"kind": "added", "ranges": {column: [low, high]}},)
    return replace(model, file=replace(model.file, history=history))


LAGS = model_over("feed_mm_s", 20.0, 30.0, following_error={"lag_s": [0.005] * 3})


def test_a_cell_without_a_feed_has_no_speed_whole_and_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    row = np.arange(40)
    place = np.column_stack([40.0 * np.sin(row / 15.0), 40.0 * np.cos(row / 15.0), np.zeros(40)])
    table = make_table(place, feed_mm_s=np.where(row % 4 == 0, np.nan, np.where(row < 30, 25.0, 90.0)))
    whole = compensate(LAGS, table).status
    assert (whole == np.where((row >= 30) & (row % 4 != 0), "uncertain", "ok")).all()
    monkeypatch.setattr(blocks, "ROWS", 15)
    assert (compensate(LAGS, table).status == whole).all()


@pytest.mark.parametrize("start", [191.0, -1e6])
def test_ranges_know_where_a_run_ends_and_another_clock_begins(start: float) -> None:
    """Two runs at 0.5 mm/s; from the last row of one to the first of the other nobody saw the tool move."""
    way, clock = np.linspace(-50.0, 50.0, 20), 10.0 * np.arange(20)
    one, two = (
        make_table(np.column_stack([way, np.full(20, y), np.zeros(20)]), time_s=clock + later)
        for y, later in ((0.0, 0.0), (30.0, start))
    )
    file = machine()
    problem = build_problem(file, measure(concat_tables([one, two]), file, []))
    found = ranges_of(problem)
    np.testing.assert_allclose(found["feed_mm_s"], 100.0 / 190.0, rtol=1e-9)
    assert found["time_s"] == [0.0, float(problem.view.time[-1])] == [0.0, 381.0]


@pytest.mark.parametrize("feed", [None, np.nan, 0.0])
def test_a_feed_column_that_tells_nothing_leaves_speeds_to_the_clock(feed: float | None) -> None:
    place = np.column_stack([10.0 * np.arange(6), np.zeros((6, 2))])
    table = make_table(place, time_s=np.arange(6) / 29.0, feed_mm_s=feed)  # 290 mm/s
    assert compensate(LAGS, table).status.tolist() == ["ok", *["uncertain"] * 5]
    (found,) = beyond_context(LAGS, table)
    assert found.rows == 5 and found.worst == pytest.approx(260.0)


@pytest.mark.parametrize(("load", "status"), [(8.9, "ok"), (9.2, "uncertain"), (50.0, "uncertain")])
def test_what_a_load_moves_is_not_trusted_far_beyond_it_whether_or_not_it_needs_one(load: float, status: str) -> None:
    model = model_over("payload_kg", 0.0, 6.0, axis_compliance={"compliance_mm_per_n": [2e-4] * 3})
    table = make_table(np.array([[0.0, 0.0, 5.0], [10.0, 0.0, 5.0]]), payload_kg=np.array([load, 3.0]))
    assert compensate(model, table).status.tolist() == [status, "ok"]
    assert [(found.users, found.rows) for found in beyond_context(model, table)] == [(("axis-compliance",), 1)]
    measured = table.replace(torque=np.full((2, 3), 9.0))  # by the load of the motors, not by what hangs on them
    assert compensate(model, measured).status.tolist() == ["ok", "ok"] and beyond_context(model, measured) == ()


def test_what_stands_or_carries_nothing_is_known_although_the_run_always_moved_and_carried() -> None:
    place = np.column_stack([[0.0, 25.0, 50.0, 50.0, 50.0, 75.0], np.zeros((6, 2))])
    for told in ({"time_s": np.arange(6.0)}, {"feed_mm_s": [25.0, 25.0, 25.0, 0.0, 0.0, 25.0]}):
        table = make_table(place, **told)
        assert set(compensate(LAGS, table).status) == {"ok"} and beyond_context(LAGS, table) == ()
    bends = model_over("payload_kg", 5.0, 6.0, column_bend={"sway_mm_per_kg": [0.01, 0.0], "slope_per_kg": [0.0, 0.0]})
    table = make_table(place, payload_kg=[0.0, 2.0, 5.0, 6.0, 6.5, 20.0])
    assert compensate(bends, table).status.tolist() == [*["ok"] * 5, "uncertain"]
    (line,) = beyond_lines([beyond_context(bends, table)], "t.csv", 6)
    assert "payload goes beyond the model's run (5 to 6 kg) by up to 14 in 2 of 6 rows" in line
    warm = model_over("temp_c", 25.0, 26.0, screw_growth={"growth_per_k": [1e-5] * 3, "shift_mm_per_k": [0.0] * 3})
    assert set(compensate(warm, make_table(place, temp_c=20.0)).status) == {"uncertain"}  # no zero of warmth is special


class Sided(Curve):
    """Play of a slider that changes with the load by a law of its own."""

    name, mechanisms, on, along = "sided", ("three-ptt",), "direction1", "payload"
    shape, between = "varying", (5.0, 6.0)


class Bent(Curve):
    """A slider that gives way by a law of load and height."""

    name, mechanisms, on, acts_on = "bent", ("three-ptt",), "payload", "slider 2"
    together, ranges, between = ("payload", "b2"), ((5.0, 6.0), (240.0, 310.0)), (5.0, 6.0)


@pytest.mark.parametrize("effect", [Sided(), Bent()])
def test_a_curve_along_a_load_is_not_known_at_none(effect: Curve) -> None:
    size = effect.parameters[0].size(3)
    model = model_over("payload_kg", 5.0, 6.0) + Term(effect, torch.zeros(size, dtype=torch.float64))
    table = make_table(np.array([[0.0, 0.0, 5.0], [10.0, 0.0, 5.0]]), payload_kg=[0.0, 5.0])
    assert compensate(model, table).status.tolist() == ["uncertain", "ok"]
