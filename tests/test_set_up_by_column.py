"""A frame or a table that tilts with what a column records: no knock, no drift and no growth of a screw."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from made_runs import SIGMA, machine

from ptt.diagnosis.diagnose import diagnose
from ptt.effects.prefilled import prefilled
from ptt.effects.registry import library, make_effect
from ptt.judge.ladder.climb import climb
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.watched import watch


@pytest.mark.parametrize("column", [pytest.param("temperature", marks=pytest.mark.long), "sun [W/m2]"])
def test_a_tilt_that_follows_a_column_is_unknown_and_told_by_it(column: str) -> None:
    """The tracker's frame is trusted, the room warms as after a start in the morning, the sun stands on one side."""
    random, rows = np.random.default_rng(5), 160
    file = machine(frame="trusted")
    target = random.uniform(-60.0, 60.0, (rows, 3))
    time = 15.0 * np.arange(rows)
    warmth = 5.0 * (1.0 - np.exp(-time / 900.0))
    sun = 5.0 * np.square(np.sin(time / 700.0))
    drives = warmth if column == "temperature" else sun - sun.mean()  # nobody knows where a column is at rest
    tilt = 1e-6 * np.array([45.0, -30.0, 0.0])  # rad per K or W/m2, about a foot 400 mm below
    moved = drives[:, None] * np.cross(tilt, target + np.array([0.0, 0.0, 400.0]))
    read = target + moved + random.normal(0.0, SIGMA, target.shape)
    table = make_table(
        target, measured=read, time_s=time, temp_c=20.0 + warmth, extra={"sun [W/m2]": sun.round(3).astype(str)}
    )
    table = watch(table, [column]) if column in table.extra else table
    found = diagnose(Model(file), build_problem(file, table))
    assert found.verdict == "unknown" and not found.suggested
    first = found.depends_on[0]
    assert (first.on, first.acts_on) == (column, "set-up") and first.share > 0.5
    assert "as if tracker and machine moved against each other" in found.words
    sound = replace(table, measured=read - moved)
    assert diagnose(Model(file), build_problem(file, sound)).verdict == "nothing-missing"


def test_a_law_of_the_set_up_takes_the_readings_and_sends_nothing(tmp_path: Path) -> None:
    random, rows = np.random.default_rng(7), 160
    file, target = machine(frame="trusted"), random.uniform(-60.0, 60.0, (rows, 3))
    warmth = 5.0 * (1.0 - np.exp(-np.linspace(0.0, 3.0, rows)))
    moved = warmth[:, None] * np.cross(1e-6 * np.array([60.0, -40.0, 20.0]), target + np.array([0.0, 0.0, 400.0]))
    read = target + moved + random.normal(0.0, SIGMA, target.shape)
    table = make_table(target, measured=read, time_s=15.0 * np.arange(rows), temp_c=20.0 + warmth)
    problem = build_problem(file, table)
    first = diagnose(Model(file), problem).depends_on[0]
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [first.to_dict()]).text)
    ladder = climb(Model(file), problem, [make_effect(library(path), "own-cause")])
    assert ladder.steps[-1].heldout_rms_um["total"] < 1.4e3 * SIGMA * 3**0.5
    sent = predict([(term.effect, term.theta) for term in ladder.model.terms], problem.view).p
    torch.testing.assert_close(sent, problem.view.p)  # the tool goes where it did
