"""Fewer columns say the same of a wide effect or block, and kept sums are those of the whole covariance."""

import numpy as np
from scipy.stats import multivariate_normal

from ptt.diagnosis.evidence.atoms import Atom, atoms_of_blocks
from ptt.diagnosis.evidence.narrow import narrow
from ptt.diagnosis.evidence.row_sums import FewSums
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.noise.poses import poses_of
from ptt.diagnosis.noise.wander import Clock
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.places import FEATURE_SIZE, Place
from ptt.effects.registry import library, make_effect
from ptt.fitting.evidence import maximise

ROWS, WIDTH, KNOWN = 440, 160, 3


def wide() -> tuple[dict[str, Atom], np.ndarray, np.ndarray, np.ndarray]:
    """A map of 80 harmonics, cosines and sines, over a third of a turn in two groups, behind three other columns."""
    random = np.random.default_rng(3)
    angle = random.uniform(0.0, 2.0, (ROWS, 3))
    order = np.arange(1, WIDTH // 2 + 1)
    shapes = np.concatenate([np.cos(angle[..., None] * order), np.sin(angle[..., None] * order)], axis=2)
    columns = np.concatenate([random.normal(size=(ROWS, 3, KNOWN)), 3.0 * shapes], axis=2)
    group = np.arange(WIDTH) % 2
    effect = make_effect(library(), "joint-error-map")
    whole = Atom("map", "map", np.arange(KNOWN, KNOWN + WIDTH), group, np.ones(2), 7.0, np.zeros(WIDTH, bool), effect)
    few = Atom("few", "few", np.arange(1, KNOWN), np.zeros(2, int), np.ones(1), 7.0, np.zeros(2, bool), effect)
    values = columns[:, :, KNOWN:] @ random.normal(0.0, 0.3, WIDTH) + random.normal(size=(ROWS, 3))
    return {"map": whole, "few": few}, columns, np.linspace(0.5, 2.0, KNOWN + WIDTH), values


def test_fewer_columns_have_the_evidence_and_the_values_of_all() -> None:
    atoms, columns, scale, values = wide()
    narrowed = narrow(atoms, columns, scale)
    turned = narrowed.columns(columns)
    assert turned.shape[2] < 0.75 * columns.shape[2] and len(narrowed.scale(scale)) == turned.shape[2]
    np.testing.assert_array_equal(turned[:, :, narrowed.atoms["few"].columns], columns[:, :, atoms["few"].columns])
    told = []
    for atom, all_ in ((atoms["map"], columns), (narrowed.atoms["map"], turned)):
        own = all_[:, :, atom.columns].reshape(3 * ROWS, -1)
        found = maximise(own.T @ own, own.T @ values.ravel(), values.ravel() @ values.ravel(), values.size, atom.group,
                      freedom=50.0, ceiling=atom.most)  # fmt: skip
        told.append((found, atom.amplitudes(found.values, scale if atom.reduction is None else narrowed.scale(scale))))
    (whole, plain), (few, mapped) = told
    np.testing.assert_allclose(few.total, whole.total, atol=0.01)
    np.testing.assert_allclose(few.group_variances, whole.group_variances, rtol=0.02)
    error = np.sqrt(np.diag(whole.covariance)) * scale[KNOWN:]
    assert np.abs((mapped - plain) / error).max() < 0.02


def test_a_block_on_fewer_columns_puts_the_same_into_the_readings() -> None:
    """60 curves along a path of a twentieth of their travel are a handful of ways."""
    random = np.random.default_rng(5)
    along = np.linspace(0.0, 0.05, ROWS)
    place = Place("tool", "tool", np.broadcast_to(np.eye(3), (ROWS, 3, 3)))
    block = Block("tool on x", place, ("x",), np.cos(np.pi * along[:, None] * np.arange(20)))
    atoms, scale = atoms_of_blocks([block], 0, 9.0), np.ones(60)
    columns = block.features / FEATURE_SIZE
    narrowed = narrow(atoms, columns, scale)
    few = narrowed.atoms["tool on x"]
    assert len(few.columns) < 30
    values = random.normal(size=len(few.columns))
    part = block.features @ few.amplitudes(values, narrowed.scale(scale))
    np.testing.assert_allclose(part, FEATURE_SIZE * narrowed.columns(columns)[:, :, few.columns] @ values, atol=1e-12)


def test_kept_sums_are_those_of_the_whole_covariance() -> None:
    """Evidence of white readings whose poses err together, by the dense normal density."""
    random = np.random.default_rng(4)
    pose = np.array([0, 0, 1, 2, 2, 2, 3, 0])
    values = random.normal(size=(len(pose), 3))
    rows = values.T[None]
    sums = FewSums(lambda: rows, np.zeros((1, 1)), Clock(np.arange(8.0), np.arange(8) == 0), poses_of(pose))
    for size in (0.0, 0.5, 40.0):
        found = sums.of(Memory(None, size))
        covariance = np.eye(len(pose)) + size * (pose[:, None] == pose)
        density = sum(multivariate_normal(cov=covariance).logpdf(column) for column in values.T)
        mine = -0.5 * found.square - found.log_noise - 0.5 * values.size * np.log(2.0 * np.pi)
        np.testing.assert_allclose(mine, density, rtol=1e-10)
