"""Before anything has a name: lone rows set aside, and no law that one row alone would show."""

import numpy as np

from ptt.challenge.cases import draw, plan
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.unknown.smooth import reined
from ptt.model.model import Model
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem


def test_what_one_or_two_rows_show_alone_is_reined_in():
    pauses = np.concatenate([np.linspace(0.2, 0.6, 40), [9.0]])
    held = reined(pauses)
    assert held[-1] < 0.9
    np.testing.assert_array_equal(held[:-1], pauses[:-1])
    levels = np.repeat([0.0, 0.0, 0.0, 2.0], [10, 10, 10, 3])
    np.testing.assert_array_equal(reined(levels), levels)
    even = np.linspace(-1.0, 3.0, 50)
    np.testing.assert_array_equal(reined(even), even)
    both = reined(np.column_stack([pauses, -pauses]))
    np.testing.assert_allclose(both[:, 1], -both[:, 0])
    few = np.array([0.0, 0.0, 7.0])
    np.testing.assert_array_equal(reined(few), few)
    rare = np.array([1.0, np.nan, 2.0, np.nan, 3.0, np.nan, np.nan])
    np.testing.assert_array_equal(reined(rare), rare)
    gaps = np.append(pauses, np.nan)
    np.testing.assert_array_equal(reined(gaps)[:-1], held)


def test_a_gross_reading_after_the_longest_pause_is_no_law_of_pauses():
    """A knock, a slip and play on circles between which the machine waits; the first reading after it is wrong."""
    (case,) = plan("multi", 1, 1210034, kinds="all", noise=None, bench=None, rows=None, visible=True)
    drawn, truth = draw(case)
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(drawn.rig.machine), problem)
    assert found.verdict == "missing"
    assert {names[0] for names in found.suggested} == set(truth.hidden)
    assert found.outliers[[40, 69]].all()
