"""Frames of a fit: rotations, one for each run, and what base reflectors tell."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from made_runs import PLACE, SIGMA, TRACKER, empty_run, machine, term
from scipy.spatial.transform import Rotation
from test_fit import fitted

from ptt.errors import TableError
from ptt.fitting.solve import residual_of
from ptt.machine import MachineFile
from ptt.machine_schema import BasePoint
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.axes import rms
from ptt.run.frames import kabsch, rigid_columns, rotation
from ptt.run.problem import build_problem
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view


@settings(max_examples=30, deadline=None)
@given(st.tuples(*[st.floats(-0.2, 0.2)] * 3))
def test_rotations_and_their_derivatives(vector: tuple[float, float, float]) -> None:
    v = torch.tensor([vector], dtype=torch.float64)
    turn, by_vector = rotation(v)
    np.testing.assert_allclose(turn[0], Rotation.from_rotvec(vector).as_matrix(), atol=1e-9)
    for c in range(3):
        step = torch.zeros_like(v)
        step[0, c] = 1e-6
        numeric = (rotation(v + step)[0] - rotation(v - step)[0]) / 2e-6
        torch.testing.assert_close(by_vector[..., c], numeric, atol=1e-8, rtol=0.0)


def test_rigid_columns_are_the_slopes_of_a_rigid_motion() -> None:
    p = torch.randn(2, 5, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    about, length = p[0, 0], 40.0

    def moved(motion: torch.Tensor) -> torch.Tensor:
        return (p - about) @ rotation(motion[None, 3:] / length)[0][0].mT + about + motion[:3]

    slopes = torch.func.jacfwd(moved)(torch.zeros(6, dtype=torch.float64))
    torch.testing.assert_close(rigid_columns(p, about, length), slopes, rtol=0.0, atol=1e-14)
    torch.testing.assert_close(rigid_columns(p - about), rigid_columns(p, about), rtol=0.0, atol=0.0)


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 170.0])
def test_a_narrow_run_tells_how_the_tracker_is_turned_about_it(angle: float) -> None:
    draws, turn = np.random.default_rng(0), Rotation.from_euler("z", angle, degrees=True).as_matrix()
    place = draws.uniform(-1.0, 1.0, (60, 3)) * [2.0, 2.0, 100.0]
    read = place @ turn.T + PLACE + draws.normal(0.0, SIGMA, place.shape)
    found, shift = kabsch(place, read)
    np.testing.assert_allclose(found, turn, atol=2e-3)
    assert np.square(read - place @ found.T - shift).mean() < (1.1 * SIGMA) ** 2


def test_errors_of_places_on_a_line_do_not_turn_the_tracker_about_it() -> None:
    draws = np.random.default_rng(0)
    place = np.linspace(-1.0, 1.0, 50)[:, None] * [100.0, 0.0, 0.0]
    wrong = draws.normal(0.0, 0.05, place.shape)
    np.testing.assert_allclose(kabsch(place, place + wrong + PLACE)[0], np.eye(3), atol=1e-3)
    turn = Rotation.from_euler("y", 80.0, degrees=True).as_matrix()
    found, _ = kabsch(place, (place + wrong) @ turn.T + PLACE)
    np.testing.assert_allclose(found @ [1.0, 0.0, 0.0], turn @ [1.0, 0.0, 0.0], atol=1e-3)
    one = np.tile([12.3, -45.6, 78.9], (5, 1))
    np.testing.assert_allclose(kabsch(one, one + draws.normal(0.0, 0.01, one.shape))[0], np.eye(3))


def two_setups(file: MachineFile) -> Table:
    table = replace(empty_run(120), run=np.repeat([0, 1], 60), run_label=("a", "b"))
    view = build_view(file, table)
    reading = predict([], view).reading.numpy() + np.random.default_rng(5).normal(0.0, SIGMA, (120, 3))
    moved = reading @ TRACKER.T + PLACE
    return replace(table, measured=np.where(table.run[:, None] == 0, reading, moved))


def test_one_frame_per_run_takes_what_one_frame_cannot() -> None:
    per_run, once = machine(frame="fitted-per-run"), machine()
    good = residual_of(Model(per_run), build_problem(per_run, two_setups(per_run)))
    bad = residual_of(Model(once), build_problem(once, two_setups(once)))
    assert rms(good.residual, good.residual[:, 0] < 1e9)["total"] < 6.0
    assert np.nanmax(np.abs(bad.residual)) > 100.0
    assert good.layout.frames == 2 and "tracker x of run b" in good.layout.names


@pytest.mark.parametrize("few", [1, 2, 3, 4])
def test_a_set_up_of_few_readings_takes_nothing_from_the_fit(few: int) -> None:
    file = machine(frame="fitted-per-run")
    table = two_setups(file)
    read = np.where(np.arange(120)[:, None] < 60 + few, table.measured, np.nan)
    first = np.where(table.run[:, None] == 0, table.measured, np.nan)
    beside, alone = (
        fitted(["homing-offset"], build_problem(file, replace(table, measured=rows))) for rows in (read, first)
    )
    apart = (beside.model.terms[0].theta - alone.model.terms[0].theta).abs().numpy()
    assert beside.chi2 / beside.freedom < 2.0
    assert (apart < 2.0 * alone.model.terms[0].std.numpy()).all()


def test_base_reflectors_tell_the_frame_and_so_the_common_homing_offset() -> None:
    places = {"p": (300.0, 0.0, -200.0), "q": (-300.0, 100.0, -200.0), "r": (0.0, -300.0, 200.0)}
    places["s"] = (50.0, 300.0, 300.0)
    points = tuple(BasePoint(name=name, xyz_mm=xyz, sigma_mm=0.001) for name, xyz in places.items())
    file = machine(frame="measured", base_point=points)
    poses = empty_run(150)
    table = make_table(
        np.concatenate([np.full((4, 3), np.nan), poses.target]),
        role=np.array(["base"] * 4 + ["pose"] * 150),
        name=np.array([*places, *[""] * 150]),
    )
    view = build_view(file, replace(table, target=np.where(np.isfinite(table.target), table.target, 0.0)))
    truth = term("homing-offset", view, [0.3, 0.3, 0.3])
    reading = predict([(truth.effect, truth.theta)], view).reading.numpy()
    reading[:4] = np.array(list(places.values()))
    noisy = reading @ TRACKER.T + PLACE + np.random.default_rng(3).normal(0.0, 1e-4, reading.shape)
    problem = build_problem(file, replace(table, measured=noisy))
    result = fitted(["homing-offset"], problem)
    assert bool(result.model.terms[0].measured.all())
    torch.testing.assert_close(result.model.terms[0].theta, truth.theta, atol=0.01, rtol=0.0)


def test_a_base_reflector_that_the_machine_file_lacks_is_refused() -> None:
    points = tuple(BasePoint(name=name, xyz_mm=(i, i * i, 0.0)) for i, name in enumerate("pqr"))
    file = machine(frame="measured", base_point=points)
    poses = empty_run(20)
    role, name = np.array(["base", *["pose"] * 19]), np.array(["z", *[""] * 19])
    with pytest.raises(TableError, match="base reflector 'z' is not in the machine file"):
        build_problem(file, replace(poses, measured=poses.target.copy(), role=role, name=name))
