"""Something that changed at one moment by amounts that vary over the workspace: a load or a clamp nobody noted."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import empty_run, machine, measure, term

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.door.diagnosing import format_diagnosis
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

ROW = 97  # the first of 180 rows under another load
FILE = machine()


def loaded(bend: list[float]) -> Diagnosis:
    """The column bends under 2 kg from `ROW` on, which no column of the table says."""
    table = make_table(empty_run(180).target, time_s=10.0 * np.arange(180))
    told = replace(table, payload_kg=np.where(np.arange(180) < ROW, 0.0, 2.0))
    bends = term("column-bend", build_view(FILE, told), bend)
    return diagnose(Model(FILE), build_problem(FILE, replace(table, measured=measure(told, FILE, [bends]).measured)))


@pytest.mark.parametrize(
    "bend", [pytest.param([0.006, -0.004, 2e-4, -1e-4], marks=pytest.mark.long), [0.0, 0.003, 0.0, 3e-4]]
)
def test_a_load_that_nobody_noted_is_a_change_at_its_moment(bend: list[float]) -> None:
    found = loaded(bend)
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert (first.on, first.shape) == ("time", "step")
    assert first.place is not None and first.place[0] < 10.0 * ROW <= first.place[1] + 10.0
    assert "Look for what changed" in format_diagnosis(found)


def test_a_slip_is_a_slip() -> None:
    table = make_table(empty_run(180).target, time_s=10.0 * np.arange(180))
    slip = term("homing-slip", build_view(FILE, table), [0.02, 0.0, -0.01], after=10.0 * ROW - 5.0)
    found = diagnose(Model(FILE), build_problem(FILE, measure(table, FILE, [slip])))
    assert (found.verdict, found.suggested) == ("missing", (("homing-slip",),))
