"""Whether a machine moved while it was read: what feed and clock show, and what speed a row means then."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.machine import load_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.run.pace import line_ends
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

DRAWN = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
FILE = replace(DRAWN, tracker=DRAWN.tracker.model_copy(update={"frame": "trusted"}), text="")
PLACES = np.random.default_rng(3).uniform(-50.0, 50.0, (120, 3))
TURN = np.linspace(0.0, 4.0 * np.pi, 200)
CIRCLE = np.column_stack([40.0 * np.cos(TURN), 40.0 * np.sin(TURN), np.zeros(200)])


def lengths(places: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=1)


@pytest.mark.parametrize(
    ("places", "took", "moves"),
    [
        (PLACES, np.random.default_rng(4).uniform(5.0, 14.0, 120), False),  # stops of any length, 60 mm/s between them
        (PLACES, 6.0 + lengths(PLACES) / 60.0, False),
        (PLACES, lengths(PLACES) / 20.0, True),
        (CIRCLE, np.full(200, 0.5), True),  # by equal time
        (CIRCLE, np.random.default_rng(5).uniform(0.4, 0.6, 200), True),
    ],
)
def test_by_the_clock_a_machine_stood_or_moved(places: np.ndarray, took: np.ndarray, moves: bool) -> None:
    table = make_table(places, measured=places, time_s=np.cumsum(took))
    view = build_problem(FILE, table).view
    assert bool(view.velocity.any()) == moves


def test_where_rows_are_read_by_equal_time_the_clock_tells_a_ramp_that_the_feed_does_not() -> None:
    way = np.concatenate([0.2 * np.arange(11) ** 2, 20.0 + 4.0 * np.arange(1, 50)])  # mm along the circle, each 0.2 s
    places = np.column_stack([40.0 * np.cos(way / 40.0), 40.0 * np.sin(way / 40.0), np.zeros(len(way))])
    time = 0.2 * np.arange(len(way))
    view = build_view(FILE, make_table(places, time_s=time, feed_mm_s=20.0))
    speed = np.linalg.norm((view.jacobian @ view.velocity[..., None])[..., 0].numpy(), axis=1)
    np.testing.assert_allclose(speed[2:9], 2.0 * np.arange(2, 9), rtol=0.05)
    np.testing.assert_allclose(speed[14:-2], 20.0, rtol=0.01)


def test_a_pause_between_rows_is_no_slow_move() -> None:
    way = 4.0 * np.arange(60)
    places = np.column_stack([40.0 * np.cos(way / 40.0), 40.0 * np.sin(way / 40.0), np.zeros(len(way))])
    time = 0.2 * np.arange(60) + 3.0 * (np.arange(60) >= 30)
    view = build_view(FILE, make_table(places, time_s=time, feed_mm_s=20.0))
    speed = np.linalg.norm((view.jacobian @ view.velocity[..., None])[..., 0].numpy(), axis=1)
    np.testing.assert_allclose(speed[2:-2], 20.0, rtol=0.02)


def test_a_machine_that_dwells_on_a_smooth_way_moves_between() -> None:
    rows = np.arange(1, 800)
    way = np.concatenate([[0.0], np.cumsum((rows % 100 < 40) * (0.5 + 0.1 * np.sin(rows / 30.0)))])
    places = np.column_stack([60.0 * np.cos(way / 60.0), 60.0 * np.sin(way / 60.0), 0.0 * way])
    table = make_table(places, measured=places, time_s=0.01 * np.arange(800.0))
    assert build_problem(FILE, table).view.velocity.any()


def test_a_planar_arm_runs_straight_in_its_plane() -> None:
    """Two parallel axes: the bend of straight moves is that of the exact inverse."""
    spec = (
        '[machine]\nkind = "serial"\nconvention = "modified"\nmoves = "straight"\ntool_mm = [300.0, 0.0, 0.0]\n'
        "[[machine.joint]]\nlimits_deg = [-170, 170]\n[[machine.joint]]\na_mm = 350.0\nlimits_deg = [-170, 170]\n"
    )
    file = parse_machine(spec)
    mechanism = build_mechanism(file.machine)
    q = torch.tensor([[0.2, 0.6], [0.5, 1.1], [0.9, 1.3]], dtype=torch.float64)
    p = mechanism.forward(q)
    begin, end = line_ends(mechanism.jacobian(q), q, p, 2)
    step, near = 1e-5, q[:-1]
    on = mechanism.inverse(p[:-1] + step * (p[1:] - p[:-1]), None, near)
    np.testing.assert_allclose(begin + q.diff(dim=0).numpy(), ((on - near) / step).numpy(), rtol=1e-3)
    back = mechanism.inverse(p[1:] - step * (p[1:] - p[:-1]), None, q[1:])
    np.testing.assert_allclose(end + q.diff(dim=0).numpy(), ((q[1:] - back) / step).numpy(), rtol=1e-3)
