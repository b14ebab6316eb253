"""What moves the tool along one axis, by where it stands: told along that axis, written for it alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from made_legs import drawing

from ptt.diagnosis.diagnose import diagnose
from ptt.effects.own import load_effects
from ptt.effects.prefilled import prefilled
from ptt.fitting.solve import fit
from ptt.machine import MachineFile
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

SIGMA = 0.004  # mm


def test_a_plate_that_waves_lifts_the_tool_and_pushes_it_nowhere(tmp_path: Path):
    file = MachineFile(machine=drawing())
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA}))
    robot, random = ThreePtt.from_spec(file.machine), np.random.default_rng(5)
    middle = robot.forward(torch.full((1, 3), 300.0, dtype=torch.float64)).numpy()[0]
    place = middle + random.uniform(-1.0, 1.0, (240, 3)) * [70.0, 70.0, 40.0]
    x, y = (place - middle).T[:2] / 70.0
    read = place + random.normal(0.0, SIGMA, place.shape)
    read[:, 2] += 0.04 * np.sin(2.2 * x + 0.4) * np.cos(1.9 * y - 0.7)
    problem = build_problem(file, make_table(place, measured=read))
    found = diagnose(Model(file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert (first.residual, first.acts_on, first.together) == ("z", "z", ("x", "y", "z"))
    assert first.share > 0.9
    written = prefilled("plate", found.to_dict()["depends_on"][:1])
    (tmp_path / "plate.py").write_text(written.text)
    left = fit(Model(file) + load_effects(tmp_path / "plate.py")["plate"](), problem).residual
    assert 'acts_on = "z"' in written.text
    assert float(np.sqrt(np.nanmean(np.square(left).sum(axis=1)))) < 1.2 * np.sqrt(3.0) * SIGMA
