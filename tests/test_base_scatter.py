"""Base reflectors that are read worse than the poses hold the frame no better than they are read."""

import numpy as np
import pytest
import torch

from ptt.run.base_readings import BaseReadings
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
    moved += place * random.normal(0.0, 3e-5, rounds)[number][:, None]  # the tracker's scale changes with the air
    return place + moved + misplaced + random.normal(0.0, sigma, place.shape), point, number, place


@pytest.mark.parametrize(("reflectors", "rounds"), [(3, 8), (4, 5)])
def test_visits_scatter_by_themselves_whatever_moves_whole_rounds(reflectors: int, rounds: int) -> None:
    assert visits_scatter(*visits(reflectors, rounds, 0.02)) == pytest.approx(0.02, rel=0.35)
    assert visits_scatter(*visits(reflectors, rounds, 0.0)) < 1e-3


def test_one_round_tells_no_scatter() -> None:
    assert visits_scatter(*visits(3, 1, 0.02)) == 0.0


@pytest.mark.parametrize(("jump", "tightened"), [(0.0, False), (0.5, True)])
def test_only_what_clearly_moved_the_rounds_lets_them_hold_the_frame(jump: float, tightened: bool) -> None:
    """Some moment explains part of any wander from round to round, and half of it is no knock."""
    random, rounds, apiece = np.random.default_rng(4), 6, 4
    number, point = np.repeat(np.arange(rounds), apiece), np.tile(np.arange(apiece), rounds)
    wander = np.cumsum(random.normal(0.0, 0.02, (rounds, 3)), axis=0)
    after = (number >= 3).astype(float)[:, None]
    reading = wander[number] + jump * after + random.normal(0.0, 0.005, (len(number), 3))
    frame, drawn = np.zeros(len(number), dtype=int), np.full(len(number), 0.01)
    loose = BaseReadings(None, reading, frame, point, number, drawn, np.full(len(number), np.inf), frame > 0, 0.005)
    before = loose.beside(np.zeros_like(reading), np.zeros((len(number), 3, 0)))
    told = after * (reading[number >= 3].mean(axis=0) - reading[number < 3].mean(axis=0))
    beside = before.beside(told, after[:, :, None] * np.eye(3))
    assert bool(beside.apart[0] < before.apart[0]) is tightened
