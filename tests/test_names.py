"""Names come first, plain ones before curves, and the model moves to them before any unknown is asked."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.run.problem import build_problem
from ptt.run.table import make_table

NOISE = 0.004


@pytest.mark.parametrize("seed", [2, pytest.param(9, marks=pytest.mark.long)])
@pytest.mark.parametrize("wave", [3, pytest.param(4, marks=pytest.mark.long)])
def test_of_few_rows_a_lead_and_a_wave_are_no_curve(seed: int, wave: int) -> None:
    file, random = bench(), np.random.default_rng(seed)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": NOISE, "frame": "trusted"}))
    robot, turn = build_mechanism(file.machine), np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    target = np.column_stack([45 * np.sin(3.3 * turn), 45 * np.sin(5.1 * turn + 1), 50 * np.sin(7.7 * turn + 0.3)])
    sent, rest = (robot.inverse(torch.as_tensor(at)).numpy() for at in (target, np.zeros((1, 3))))
    phase, size = 2.0 * np.pi * wave * sent / file.machine.screw_lead_mm, 0.03 * random.normal(size=(2, 3))
    there = sent + size[0] * np.cos(phase) + size[1] * np.sin(phase) + 3e-3 * random.normal(size=3) * (sent - rest)
    read = robot.forward(torch.as_tensor(there)).numpy() + random.normal(0.0, NOISE, target.shape)
    found = diagnose(Model(file), build_problem(file, replace(make_table(target, sent), measured=read)))
    said = {group[0] for group in found.suggested}
    assert (found.verdict, said) == ("missing", {"lead-scale", f"once-per-rev[harmonic {wave}]"})


@pytest.mark.long
def test_unknowns_do_not_take_at_the_drawing_what_names_do_nearer_by() -> None:
    """Zeros of half a millimetre on a circle: at the drawing a slip and a knock looked like eight other things."""
    drawn, _ = draw(plan("multi", 1, 1330035, kinds="all", rows=1260)[0])
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(drawn.rig.machine), problem)
    names = {"homing-offset", "homing-slip", "setup-jump", "backlash", "once-per-rev"}
    assert (found.verdict, {group[0] for group in found.suggested}) == ("missing", names)
