"""Base reflectors that are read worse than the poses hold the frame no better than they are read."""

import numpy as np
import pytest
import torch

from ptt.run.base_visits import visits_scatter
from ptt.run.frames import rigid_columns

PLACE = np.array([[400.0, 100.0, -200.0], [-400.0, 200.0, -200.0], [-100.0, -400.0, -250.0], [250.0, 300.0, 400.0]])


def visits(reflectors: int, rounds: int, sigma: float) -> tuple[np.ndarray, ...]:
    """Rounds of visits while the tracker is knocked before each, the reflectors not quite where they are drawn."""
    random = np.random.default_rng(reflectors + rounds)
    place, point = np.tile(PLACE[:reflectors], (rounds, 1)), np.tile(np.arange(reflectors), rounds)
    number = np.repeat(np.arange(rounds), reflectors)
    knocks = random.normal(0.0, 0.05, (rounds, 6)) * [1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3]
    moved = np.einsum("mcw,mw->mc", rigid_columns(torch.as_tensor(place)).numpy(), knocks[number])
    misplaced = random.normal(0.0, 0.1, (reflectors, 3))[point]
    return place + moved + misplaced + random.normal(0.0, sigma, place.shape), point, number, place


@pytest.mark.parametrize(("reflectors", "rounds"), [(3, 8), (4, 5)])
def test_visits_scatter_by_themselves_whatever_moves_whole_rounds(reflectors: int, rounds: int) -> None:
    assert visits_scatter(*visits(reflectors, rounds, 0.02)) == pytest.approx(0.02, rel=0.35)
    assert visits_scatter(*visits(reflectors, rounds, 0.0)) < 1e-3


def test_one_round_tells_no_scatter() -> None:
    assert visits_scatter(*visits(3, 1, 0.02)) == 0.0
