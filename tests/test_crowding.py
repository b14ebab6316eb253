"""What a model misses alike at every repeat is one witness, and calls for no absurd sizes of what imitates it."""

from pathlib import Path

import numpy as np
import torch

from ptt.effects.registry import library
from ptt.fitting.prior import crowding_of
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import read_table

DATA = Path(__file__).parents[1] / "data"
NAMES = ("homing-offset", "lead-scale", "once-per-rev", "tower-position", "tower-tilt", "link-length", "windup")


def test_independent_rows_count_as_themselves() -> None:
    block = np.repeat(np.arange(10), 40)
    for seed in range(20):
        residual = np.random.default_rng(seed).normal(size=(400, 3))
        assert crowding_of(residual, np.ones(400, dtype=bool), block) == 1.0


def test_a_miss_that_all_rows_of_a_block_share_counts_once() -> None:
    block = np.repeat(np.arange(10), 40)
    miss = np.random.default_rng(1).normal(size=(10, 3))[block]
    np.testing.assert_allclose(crowding_of(miss, np.ones(400, dtype=bool), block), 40.0)


def test_a_model_that_lacks_physics_keeps_the_drawing_within_a_workshop_s_due() -> None:
    """Five kilograms bend the sample machine in ways that these effects are not; links are off by 0.04 to 0.09 mm."""
    file, known = load_machine(DATA / "machine_compensated.toml"), library()
    model = Model(file)
    for name in NAMES:
        model = model + known[name]()
    found = fit(model, build_problem(file, read_table(DATA / "experiment5.csv")))
    values = {term.effect.key: term.theta for term in found.model.terms}
    true = torch.tensor([0.06, -0.09, 0.04], dtype=torch.float64)
    assert float((values["link-length"] - true).abs().max()) < 0.5
    assert float(values["tower-position"].abs().max()) < 0.5
