"""Runs of a machine with known terms, read by a tracker that stands anywhere: for tests of fits and of what follows."""

from dataclasses import replace

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from ptt.effects import library
from ptt.effects.bench import sample_machine
from ptt.effects.layout import flatten
from ptt.machine import MachineFile
from ptt.model.chain import predict
from ptt.model.model import Term
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view

SIGMA = 0.003
TRACKER = Rotation.from_rotvec([0.3, 2.0, 1.0]).as_matrix()
PLACE = np.array([1000.0, 2000.0, -300.0])
KNOWN = library()


def machine(**tracker: object) -> MachineFile:
    file = sample_machine("three-ptt")
    return replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA, **tracker}))


def empty_run(rows: int = 200, seed: int = 1) -> Table:
    random = np.random.default_rng(seed)
    return make_table(
        random.uniform(-60.0, 60.0, (rows, 3)),
        payload_kg=random.choice([0.0, 5.0], rows),
        temp_c=20.0 + random.uniform(0.0, 8.0, rows),
        time_s=10.0 * np.arange(rows),
        feed_mm_s=random.choice([5.0, 20.0, 40.0], rows),
    )


def term(name: str, view: object, amplitude: list[float], **shape: float) -> Term:
    effect = KNOWN[name]()
    chosen = {stem: torch.tensor([value], dtype=torch.float64) for stem, value in shape.items()}
    theta = flatten(effect, chosen or effect.search(view)[0], 3)
    theta[: len(amplitude)] = torch.tensor(amplitude, dtype=torch.float64)
    return Term(effect, theta)


def measure(table: Table, file: MachineFile, terms: list[Term], seed: int = 2, noise: float = SIGMA) -> Table:
    """Readings of a machine with these effects, by a tracker that stands anywhere."""
    view = build_view(file, table)
    reading = predict([(item.effect, item.theta) for item in terms], view).reading.numpy()
    random = np.random.default_rng(seed)
    return replace(table, measured=reading @ TRACKER.T + PLACE + random.normal(0.0, noise, reading.shape))


def hidden_backlash(rows: int = 200, **tracker: object) -> tuple[Problem, list[Term]]:
    file, table = machine(**tracker), empty_run(rows)
    terms = [term("backlash", build_view(file, table), [0.03, 0.05, 0.02])]
    return build_problem(file, measure(table, file, terms)), terms
