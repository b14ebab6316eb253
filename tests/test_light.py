"""What is worked out by hand so that commands start quickly is what scipy says, and what is heavy stays out."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy import stats
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from ptt.effects.shapes import KNOTS, natural_pieces
from ptt.mechanisms.rotations import rotation_vector
from ptt.run import tails
from ptt.run.pace import pace_of
from ptt.run.table import make_table

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "data"
HEAVY = (
    "torch._dynamo",
    "sympy",
    "torch._inductor",
    "scipy.stats",
    "scipy.interpolate",
    "scipy.optimize",
    "matplotlib",
)


def test_natural_splines_are_those_of_scipy():
    values = np.random.default_rng(1).normal(size=(KNOTS, 4))
    scipys = CubicSpline(np.linspace(0.0, 1.0, KNOTS), values, bc_type="natural").c
    np.testing.assert_allclose(natural_pieces(values), scipys, rtol=1e-9, atol=1e-9)


def test_tails_are_those_of_scipy_stats():
    rng = np.random.default_rng(0)
    x, k, m = rng.exponential(5.0, 500), rng.uniform(0.5, 40.0, 500), rng.uniform(0.5, 40.0, 500)
    chance = 10.0 ** -rng.uniform(0.0, 15.0, 500)
    np.testing.assert_array_equal(tails.chi2_sf(x, k), stats.chi2.sf(x, k))
    np.testing.assert_array_equal(tails.chi2_isf(chance, k), stats.chi2.isf(chance, k))
    np.testing.assert_array_equal(tails.chi2_ppf(1.0 - chance, k), stats.chi2.ppf(1.0 - chance, k))
    np.testing.assert_array_equal(tails.f_sf(x, k, m), stats.f.sf(x, k, m))
    np.testing.assert_array_equal(tails.f_cdf(x, k, m), stats.f.cdf(x, k, m))
    assert [tails.poisson_sf(a, b) for a, b in zip(x - 2, k, strict=True)] == stats.poisson.sf(x - 2, k).tolist()
    assert tails.chi2_median(3) == stats.chi2.median(3) and tails.chi2_sf(-1.0, 3.0) == 1.0


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 1.0, 2.0, np.pi - 1e-6])
def test_rotation_vectors_are_those_of_scipy(size):
    rng = np.random.default_rng(1)
    for _ in range(50):
        axis = rng.normal(size=3)
        turn = Rotation.from_rotvec(size * axis / np.linalg.norm(axis))
        vector = rotation_vector(torch.from_numpy(turn.as_matrix())).numpy()
        np.testing.assert_allclose(vector, turn.as_rotvec(), rtol=0, atol=1e-13)


@pytest.mark.parametrize("rows", [4, 5, 40])
def test_velocities_along_a_smooth_way_are_those_of_scipys_spline(rows):
    rng = np.random.default_rng(rows)
    at, values = np.cumsum(rng.uniform(0.1, 3.0, rows)), rng.normal(size=(rows, 3))
    even = np.outer(at, [3.0, 4.0, 0.0])  # the tool's way: straight, at one speed
    pace = pace_of(even, np.arange(rows) == 0, make_table(even, time_s=at))
    assert pace is not None
    np.testing.assert_allclose(pace.velocity(values), CubicSpline(at, values)(at, 1), rtol=1e-11, atol=1e-11)


def test_what_is_heavy_stays_out(tmp_path):
    sample, run = DATA / "sealed_one", tmp_path / "run.csv"
    run.write_text("".join((sample / "run.csv").read_text().splitlines(keepends=True)[:121]))
    model = ["--model", str(sample / "machine.toml")]
    asked = [[verb, str(run), *model] for verb in ("compare", "check", "diagnose")]
    asked.append(["predict", str(sample / "targets.csv"), *model, "--out", str(tmp_path / "out.csv")])
    code = (
        f"import sys; from ptt.commands.main import run; assert [run(words) for words in {asked}] == [0] * 4\n"
        f"print([m for m in {HEAVY} if m in sys.modules])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert ended.stdout.splitlines()[-1] == "[]"
