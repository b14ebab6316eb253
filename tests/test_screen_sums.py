"""Sums under any memory are those of whole covariances, in whatever order they are asked for."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import linalg
from scipy.stats import multivariate_normal

from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.evidence.memories import prior_of
from ptt.diagnosis.evidence.row_sums import FewSums, SumsOfRows, sums_of_poses, sums_of_rows
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.gains import BATCH_ROWS, MANY_COLUMNS
from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.noise.poses import poses_of
from ptt.diagnosis.noise.wander import Clock, Wander, filtered, innovations, likelihoods
from ptt.effects import library
from ptt.fitting.linear import linear_columns
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.noise import Noise
from ptt.run.problem import build_problem


@pytest.mark.parametrize("registered", [False, True])
@pytest.mark.parametrize("width", [1, MANY_COLUMNS])
@pytest.mark.parametrize("wander", [None, Wander(2.0, 6.0), Wander(2.0, 6.0, (9.0, 0.4, 1.0))])
@pytest.mark.parametrize("size", [0.0, 3.0, 200.0])
def test_sums_have_the_density_of_the_whole_covariance(
    size: float, wander: Wander | None, width: int, registered: bool
) -> None:
    """Of a wander, of errors of poses and of both at once, read off the sums of the last of some columns."""
    random, memory = np.random.default_rng(6), Memory(wander, size)
    pose, time = np.array([0, 0, 1, 2, 2, 2, 3, 0]), np.array([0.0, 1.0, 3.0, 4.0, 9.0, 10.0, 0.0, 2.0])
    starts = np.isin(np.arange(8), [0, 6])
    values = random.normal(size=(8, 3, width))
    clock = Clock(time, starts, registered)
    found = FewSums(lambda: values.T, np.zeros((1, 1)), clock, poses_of(pose)).of(memory)
    columns = np.zeros((8, 3, 0))
    rows = RowSystem(
        np.arange(8), np.zeros(0, int), {}, clock, Noise(np.eye(3), "first guess"), 0.0, np.ones(0), columns,
        values[:, :, -1], poses_of(pose), pose, {}, SimpleNamespace(), np.zeros((0, 3, 0)), np.zeros((0, 3)),
    )  # fmt: skip
    lasted = np.repeat([10.0, 2.0], [6, 2])  # s, each run, both from zero on
    run, density = np.cumsum(starts), 0.0
    for axis, column in enumerate(values[:, :, -1].T):
        covariance = np.eye(8) + memory.pose * (pose[:, None] == pose)
        if memory.wander is not None:
            apart = np.exp(-np.abs(time[:, None] - time) / memory.wander.constant)
            if registered:  # it begins with the variance that it gains from nothing until the run's end
                kept = np.exp(-(time[:, None] + time) / memory.wander.constant)
                apart -= np.exp(-2.0 * lasted / memory.wander.constant) * kept
            covariance += memory.wander.share * memory.wander.axes[axis] * apart * (run[:, None] == run)
        density += multivariate_normal(cov=covariance).logpdf(column)
    none = np.zeros(0, dtype=int)
    for sums in (found, rows.sums_of(none, memory), rows.sums(memory), rows.sums_of(none, memory)):
        mine = -0.5 * sums.square - sums.log_noise - 12.0 * np.log(2.0 * np.pi)
        np.testing.assert_allclose(mine, density, rtol=1e-10)


def test_wanders_are_told_apart_as_their_whole_covariances_do() -> None:
    random = np.random.default_rng(8)
    time, starts = np.cumsum(random.uniform(1.0, 4.0, 30)), np.isin(np.arange(30), [0, 17])
    left, uneven = random.normal(size=(30, 3)), (0.3, 8.0, 1.0)
    wanders = [Wander(0.4, 5.0), Wander(6.0, 5.0), Wander(6.0, 40.0), Wander(0.4, 5.0, uneven)]
    run, truth = np.cumsum(starts), []
    for wander in wanders:
        apart = np.exp(-np.abs(time[:, None] - time) / wander.constant)
        square, half = 0.0, 0.0  # the white variance at its best is square / 90
        for axis, column in zip(wander.axes, left.T, strict=True):
            covariance = np.eye(30) + axis * wander.share * apart * (run[:, None] == run)
            square += column @ np.linalg.solve(covariance, column)
            half += 0.5 * np.linalg.slogdet(covariance)[1]
        truth.append(wander.log_prior - half - 45.0 * np.log(square))
    np.testing.assert_allclose(likelihoods(left, wanders, Clock(time, starts)), truth, rtol=1e-10)


@pytest.mark.parametrize("rows", [20, 100])
def test_sums_are_those_of_all_columns_in_whatever_order_they_are_asked_for(rows: int) -> None:
    random = np.random.default_rng(7)
    white, values = random.normal(size=(12, rows)), random.normal(size=rows)
    sums = sums_of_rows(white, values, 0.0)
    gram = white @ white.T
    atoms = np.array([[0, 3], [11, 5]])
    for block, place in zip(sums.own(atoms), atoms, strict=True):
        np.testing.assert_allclose(block, gram[np.ix_(place, place)], rtol=1e-12)
    for chosen, width in ((np.array([5, 1]), 2), (np.array([1, 7, 0]), 12), (np.array([4, 1]), 12)):
        others = np.arange(width)
        np.testing.assert_allclose(sums.across(chosen, others), gram[np.ix_(chosen, others)], rtol=1e-12)
        np.testing.assert_allclose(sums.of(chosen).gram, gram[np.ix_(chosen, chosen)], rtol=1e-12)


def test_sums_beside_errors_of_poses_are_those_of_the_whole_covariance_and_stay_when_columns_come() -> None:
    random, size = np.random.default_rng(11), 3.0
    pose = random.integers(0, 9, 30)
    rows, values = random.normal(size=(34, 3, 30)), random.normal(size=(3, 30))
    inverse = np.linalg.inv(np.eye(30) + size * (pose[:, None] == pose))
    gram, side = np.einsum("pcm,mn,qcn->pq", rows, inverse, rows), np.einsum("pcm,mn,cn->p", rows, inverse, values)
    poses, flat = poses_of(pose), rows.reshape(34, -1)
    plain = sums_of_rows(flat[:30], values.ravel(), 0.0)
    assert isinstance(plain, SumsOfRows)
    plain.across(np.array([3, 1]), np.arange(30))
    wider = plain.widened(flat[30:], values.ravel())
    np.testing.assert_allclose(wider.across(np.array([1]), np.arange(34))[0], flat[1] @ flat.T, rtol=1e-10)
    sums = sums_of_poses(wider, poses.means(rows).reshape(34, -1), poses.means(values).ravel(), poses, size)
    for chosen in (np.array([2, 32]), np.array([1, 2, 33])):
        np.testing.assert_allclose(sums.of(chosen).gram, gram[np.ix_(chosen, chosen)], rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(sums.across(chosen, np.arange(34)), gram[chosen], rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(sums.own(chosen[None])[0], gram[np.ix_(chosen, chosen)], rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(sums.side, side, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(sums.square, np.einsum("cm,mn,cn->", values, inverse, values), rtol=1e-10)
    np.testing.assert_allclose(sums.log_noise, -1.5 * np.linalg.slogdet(inverse)[1], rtol=1e-10)


def test_rows_behind_each_other_and_columns_behind_each_other_are_filtered_alike() -> None:
    random, rows = np.random.default_rng(12), 3 * BATCH_ROWS + 7
    clock = Clock(np.cumsum(random.uniform(1.0, 4.0, rows)), np.isin(np.arange(rows), [0, 17, 2 * BATCH_ROWS]))
    for wander in (Wander(2.0, 30.0), Wander(2.0, 30.0, (9.0, 0.4, 1.0))):
        values = random.normal(size=(rows, 3))
        mine, log_noise = filtered(values.T, wander, clock)
        theirs, other = innovations(values, wander, clock)
        np.testing.assert_allclose(mine.T, theirs, rtol=1e-9, atol=1e-12)
        assert log_noise == other


def test_all_moments_of_what_is_sudden_have_the_columns_that_each_has_alone() -> None:
    machine = bench()
    drawn = draw_rig(3, machine, "volume", rows=40)
    problem = build_problem(machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    fitted = fit(Model(machine), problem)
    effects = [library()[name]() for name in ("homing-slip", "setup-jump")]
    linear = linear_columns(fitted, problem, effects, fitted.noise)
    assert linear.at is not None and len(linear.trials) > 40
    for trial in linear.trials[::7]:
        alone = linear.at.columns(trial.effect, trial.shape)
        np.testing.assert_allclose(linear.columns[:, :, trial.columns], alone, rtol=1e-12, atol=1e-12)


def test_where_a_frame_stands_is_no_news_of_the_scatter() -> None:
    """Memories are compared by the readings that are left once any rigid motion of each set-up is out of them."""
    random, rows = np.random.default_rng(8), 24
    runs = np.repeat(np.arange(4), 6)
    frames = np.concatenate(
        [np.where((runs == run)[:, None, None], random.normal(size=(rows, 3, 6)), 0.0) for run in range(4)], axis=2
    )
    clock = Clock(np.arange(rows, dtype=float), np.diff(runs, prepend=-1) != 0)
    values = 0.2 * random.normal(size=(rows, 3))
    none = np.zeros((0, 3, 24))
    system = RowSystem(
        np.arange(rows), np.arange(24), {}, clock, Noise(np.eye(3), "first guess"), 0.0, np.ones(24), frames, values,
        poses_of(np.arange(rows)), runs, {}, SimpleNamespace(), none, np.zeros((0, 3)),
    )  # fmt: skip
    out = linalg.null_space(frames.reshape(-1, 24).T)

    def restricted(memory: Memory) -> float:
        apart = np.abs(clock.time[:, None] - clock.time) / (memory.wander.constant if memory.wander else 1.0)
        wander = memory.wander.share * np.exp(-apart) * (runs[:, None] == runs) if memory.wander else 0.0
        left = out.T @ values.ravel()
        covariance = out.T @ np.kron(np.eye(rows) + wander, np.eye(3)) @ out
        square = left @ np.linalg.solve(covariance, left)
        return float(-0.5 * np.linalg.slogdet(covariance)[1] - 0.5 * len(left) * np.log(square)) + prior_of(
            memory, system
        )

    scorer = Scorer(system)
    for wander in (Wander(60.0, 4.0), Wander(0.5, 10.0)):
        gain = scorer.score((), Memory(wander)).total - scorer.score((), WHITE).total
        np.testing.assert_allclose(gain, restricted(Memory(wander)) - restricted(WHITE), atol=1e-2)
