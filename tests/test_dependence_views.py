"""A problem seen in tool and slider space, levelled, and where it fails."""

import numpy as np
import pytest
from test_dependence import Bench

from ptt.challenge.challenge import bench as bench_machine
from ptt.dependence.contexts import context_views, joint_residual, remove_frame, residual_views
from ptt.dependence.following import dependence_of
from ptt.dependence.parts import by_payload, part_of
from ptt.dependence.where import where_it_fails, worst_region
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table

SIGMA = 0.005


def _problem(seed: int = 0):
    random = np.random.default_rng(seed)
    bench = Bench("volume", 200, random)
    error = bench.tool(0.03 * (bench.height > [1e9, 275.0, 1e9])) + SIGMA * random.normal(size=bench.place.shape)
    payload = np.repeat([0.0, 2.0], 100)
    table = make_table(bench.place, measured=bench.place + error, payload_kg=payload, time_s=bench.time)
    problem = build_problem(bench_machine(), table)
    return problem, problem.measured - problem.view.p.numpy(), bench


def test_a_problem_is_seen_in_tool_and_slider_space() -> None:
    problem, residual, bench = _problem()
    residual[3] = np.nan
    views, context = residual_views(problem, residual), context_views(problem)
    assert list(views) == ["x", "y", "z", "slider 1", "slider 2", "slider 3"]
    inner = np.column_stack([views[f"slider {i}"] for i in (1, 2, 3)])
    seen = np.isfinite(residual[:, 0])
    expected = np.einsum("nij,nj->ni", bench.jacobian, residual)
    np.testing.assert_allclose(inner[seen], expected[seen], atol=1e-9)
    assert np.isnan(inner[3]).all()
    assert {"b1", "b2", "b3", "x", "y", "z", "time", "payload", "direction1"} <= set(context)
    assert not {"run", "temperature"} & set(context)
    found = dependence_of(problem, residual)
    assert found[0].on == "b2"


def test_levelling_takes_out_the_frame() -> None:
    problem, residual, bench = _problem()
    turned = residual + np.cross(np.array([1e-3, -2e-3, 5e-4]), bench.place) + [0.1, 0.2, -0.3]
    np.testing.assert_allclose(remove_frame(problem, turned), remove_frame(problem, residual), atol=3e-3)


def test_redundant_arms_get_the_smallest_joint_errors() -> None:
    random = np.random.default_rng(5)
    jacobian, error = random.normal(size=(20, 3, 6)), random.normal(size=(20, 3))
    inner = joint_residual(jacobian, error)
    np.testing.assert_allclose(np.einsum("nck,nk->nc", jacobian, inner), error, atol=1e-9)
    other = inner + np.linalg.svd(jacobian)[2][:, -1]  # the null space adds length
    assert (np.linalg.norm(inner, axis=1) < np.linalg.norm(other, axis=1)).all()


def test_where_it_fails_names_the_place_and_the_rows() -> None:
    problem, residual, bench = _problem()
    corner = (bench.place > [20.0, -1e9, -1e9]).all(axis=1)
    residual = 0.2 * residual
    residual[corner] += [0.2, 0.0, 0.0]
    where = where_it_fails(problem, residual)
    assert where.region is not None
    assert corner[((bench.place >= where.region.low) & (bench.place <= where.region.high)).all(axis=1)].mean() > 0.9
    assert where.region.mean > 0.15 > where.region.error
    sizes = np.linalg.norm(residual, axis=1)
    assert [row.size for row in where.rows] == sorted(sizes, reverse=True)[:10]
    assert where.rows[0].line == problem.table.line[int(sizes.argmax())]
    assert [part.label for part in where.by_joint] == ["slider 1", "slider 2", "slider 3"]
    assert [part.label for part in where.by_payload] == ["0 kg", "2 kg"]
    assert sum(part.rows for part in where.by_time) == sum(part.rows for part in where.by_payload) == 200
    assert where.to_dict()["worst_region"] is not None
    assert {row.run for row in where.rows} <= set(problem.table.run_label)


def test_parts_say_um_or_urad() -> None:
    way, turn = part_of("slider 1", np.full(4, 2e-3)).to_dict(), part_of("joint 1", np.full(4, 2e-6), "rad").to_dict()
    assert (way["rms_um"], turn["rms_urad"]) == (pytest.approx(2.0), pytest.approx(2.0))
    assert "rms_um" not in turn


def test_regions_need_readings_and_levels_need_variety() -> None:
    assert worst_region(np.zeros((0, 3)), np.zeros(0)) is None
    assert worst_region(np.eye(3), np.ones(3)) is None
    assert by_payload(np.full(5, 2.0), np.ones(5)) == ()
    assert sum(part.rows for part in by_payload(np.arange(40.0), np.ones(40))) == 40
    parts = by_payload(np.array([1.0, 2.0, np.nan, 2.0]), np.ones(4))  # nobody knows that it was no load
    assert [(part.label, part.rows) for part in parts] == [("1 kg", 1), ("2 kg", 2)]


def test_the_noise_of_loud_coordinates_is_not_carried_into_a_quiet_one() -> None:
    """A frame fitted by weights to sound readings that scatter by 0.5 um along y and by 7 um across it."""
    problem, _, bench = _problem()
    sigma = 1e-3 * np.array([7.0, 0.5, 7.0])
    sharp = problem.with_noise(Noise(np.diag(np.square(sigma)), "std columns"))
    turns = np.stack([np.cross(axis, bench.place - bench.place.mean(axis=0)) for axis in np.eye(3)], axis=2)
    rigid = np.concatenate([np.tile(np.eye(3), (200, 1, 1)), turns], axis=2) / sigma[:, None]
    wrong = 0
    for seed in range(8):
        white = np.random.default_rng(seed).normal(size=(200, 3))
        solved = np.linalg.lstsq(rigid.reshape(-1, 6), white.ravel(), rcond=None)[0]
        sound = (white - rigid @ solved) * sigma
        np.testing.assert_array_equal(remove_frame(sharp, sound), sound)
        wrong += bool(dependence_of(sharp, sound))
    assert wrong <= 1
    bent = sound + 0.03 * rigid[:, :, 5] * sigma  # what is lacking holds the frame off by 30 urad
    np.testing.assert_allclose(remove_frame(sharp, bent), remove_frame(problem, sound), atol=2e-4)
