"""What turns at the same moment as a slip or a knock is said beside it, for no reading tells the two apart."""

import numpy as np
import pytest
import torch
from test_report_chinese import SAY, latin

from ptt.challenge.challenge import bench
from ptt.diagnosis.telling.coincidence import coincidences, parting
from ptt.effects import library
from ptt.model.model import Term
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ROWS, LAST = 60, 35  # the last row before the slip


@pytest.fixture(scope="module")
def slip() -> Term:
    effect = library()["homing-slip"]()
    return Term(effect, torch.tensor([0.0, 0.1, 0.0, 10.0 * LAST], dtype=torch.float64))


def measured(**context: np.ndarray) -> Problem:
    random = np.random.default_rng(8)
    target = random.uniform(-40.0, 40.0, (ROWS, 3))
    read = target + random.normal(scale=0.003, size=target.shape)
    return build_problem(bench(), make_table(target, measured=read, time_s=10.0 * np.arange(ROWS), **context))


def test_a_condition_that_passes_a_value_when_something_slips_is_said(slip: Term) -> None:
    row = np.arange(ROWS)
    warming, swinging = 20.0 + 0.05 * row, 22.0 + 2.0 * np.sin(0.4 * row)
    (said,) = coincidences(slip, measured(temp_c=warming, payload_kg=np.where(row % 2, 2.0, 0.0)))
    assert said.startswith("Temperature passes 21.77 C at that moment and at no other")
    (said,) = coincidences(slip, measured(temp_c=swinging, payload_kg=np.where(row > LAST, 2.0, 0.0)))
    assert said.startswith("Payload passes 1 kg")


@pytest.mark.parametrize("late", [0, 1, -2, 3])
def test_a_load_that_is_changed_and_not_for_the_first_time_when_something_slips_is_said(slip: Term, late: int) -> None:
    """The moment may be misplaced by a row or two; loads in blocks come back, so that no value parts the rows."""
    row = np.arange(ROWS)
    load = np.where((row > LAST + late) | (row < 12), 2.0, 5.0)
    said = coincidences(slip, measured(payload_kg=load))
    assert said == (["Payload changes about that moment, too: it may be the cause."] if abs(late) < 3 else [])
    assert latin(SAY(said[0] if said else "")) == []
    assert coincidences(slip, measured(payload_kg=np.where(row % 3, 2.0, 5.0))) == []  # it changes all the time


def test_a_feed_that_is_changed_once_when_something_slips_is_said(slip: Term) -> None:
    row = np.arange(ROWS)
    (said,) = coincidences(slip, measured(feed_mm_s=np.where(row > LAST, 75.0, 25.0)))
    assert said.startswith("Feed passes 50 mm/s at that moment and at no other")
    (said,) = coincidences(slip, measured(feed_mm_s=np.where((row > LAST) ^ (row > LAST + 9), 80.0, 25.0)))
    assert said == "Feed changes about that moment, too: it may be the cause."


def test_what_is_not_sudden_has_no_moment() -> None:
    warming = 20.0 + 0.05 * np.arange(ROWS)
    term = Term(library()["homing-offset"](), torch.zeros(3, dtype=torch.float64))
    assert coincidences(term, measured(temp_c=warming)) == []


def test_rows_near_the_moment_may_lie_beside_by_what_the_air_does_and_no_more() -> None:
    after = np.arange(10) > 4
    falling = np.array([9.0, 8.0, 7.0, 6.0, 5.0, 5.1, 4.0, 3.0, 2.0, 1.0])
    assert parting(after, falling) is None
    assert parting(after, falling, 0.1) == (5.0, 5.1)
    assert parting(after, 0.01 * falling, 0.1) is None  # all of it is less than the air does
    assert parting(after, np.zeros(10)) is None and parting(after | True, falling) is None


def by_layers(last: int) -> Problem:
    """A raster of layers, each level at once; `last` is the last row of one of them."""
    random = np.random.default_rng(3)
    target = random.uniform(-40.0, 40.0, (ROWS, 3))
    target[:, 2] = np.where(np.arange(ROWS) > last, 20.0, -20.0) + 10.0 * (np.arange(ROWS) > last + 10)
    read = target + random.normal(scale=0.003, size=target.shape)
    return build_problem(bench(), make_table(target, measured=read, time_s=10.0 * np.arange(ROWS)))


def test_a_height_that_the_path_passes_once_when_something_slips_is_said(slip: Term) -> None:
    (said,) = coincidences(slip, by_layers(LAST))
    assert said.startswith("z passes 0 mm at that moment and at no other") and "until the path comes back" in said
    assert coincidences(slip, by_layers(LAST - 1)) == []
