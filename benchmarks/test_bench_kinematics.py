"""Forward and inverse kinematics of a million poses, beside plain numpy and beside one copy of the poses.

Rows lie as a table of x, y, z triplets or, as in a data frame, column after column: only these go straight into the
processor's vector registers.
"""

import shutil
from functools import partial

import numpy as np
import pytest
import torch
from poses import trilaterate
from torch.testing import assert_close

from ptt.machine import ThreePttSpec
from ptt.mechanisms.three_ptt import ThreePtt

# torch itself still scripts parts of its compiler
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit:DeprecationWarning")

LONG, FIT = 1_000_000, 1_260
MACHINE = ThreePtt.from_spec(
    ThreePttSpec(
        kind="three-ptt",
        base_radius_mm=200.0,
        platform_radius_mm=100.0,
        link_length_mm=300.0,
        slider_travel_mm=(150.0, 420.0),
    )
)


def poses(n: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    return 120.0 * torch.rand(n, 3, dtype=torch.float64, generator=generator) - 60.0


def numpy_inverse(p: np.ndarray) -> np.ndarray:
    foot, link = MACHINE.foot.numpy(), MACHINE.link.numpy()
    across = p[:, None, :2] - foot[None, :, :2]
    return p[:, 2:] - foot[:, 2] + np.sqrt(link**2 - (across**2).sum(-1))


def compiled(function):
    """The function through torch.compile; skips where no compiler is installed."""
    if not any(map(shutil.which, ("c++", "g++", "clang++"))):
        pytest.skip("torch.compile needs a C++ compiler")
    return torch.compile(function, dynamic=False)


@pytest.mark.benchmark(group="1e6 poses")
def test_copy_of_the_poses(benchmark):
    p = poses(LONG)
    assert_close(benchmark(p.clone), p)


@pytest.mark.benchmark(group="1e6 poses")
@pytest.mark.parametrize("lie", ["rows", "columns"])
@pytest.mark.parametrize("how", ["eager", "compiled"])
@pytest.mark.parametrize("name", ["inverse", "forward"])
def test_torch(benchmark, name, how, lie):
    p = poses(LONG)
    p, q = (table.T.contiguous().T if lie == "columns" else table.contiguous() for table in (p, MACHINE.inverse(p)))
    given, wanted = (p, q) if name == "inverse" else (q, p)
    function = getattr(MACHINE, name) if how == "eager" else compiled(getattr(MACHINE, name))
    function(given)
    assert_close(benchmark(function, given), wanted, rtol=0.0, atol=1e-9)


@pytest.mark.benchmark(group="1e6 poses")
@pytest.mark.parametrize("name", ["inverse", "forward"])
def test_plain_numpy(benchmark, name):
    p = poses(LONG)
    q = MACHINE.inverse(p)
    given, wanted = (p, q) if name == "inverse" else (q, p)
    function = numpy_inverse if name == "inverse" else partial(trilaterate, MACHINE)
    assert_close(torch.from_numpy(benchmark(function, given.numpy())), wanted, rtol=0.0, atol=1e-9)


@pytest.mark.benchmark(group="1260 poses, as in a fit")
@pytest.mark.parametrize("name", ["inverse", "forward", "jacobian", "forward with geometry"])
def test_rows_of_a_fit(benchmark, name):
    p = poses(FIT)
    q = MACHINE.inverse(p)
    if name == "forward with geometry":
        geometry = torch.zeros(FIT, len(MACHINE.slots), dtype=torch.float64)
        assert_close(benchmark(MACHINE.forward, q, geometry), p, rtol=0.0, atol=1e-9)
        return
    result = benchmark(getattr(MACHINE, name), p if name == "inverse" else q)
    assert bool(torch.isfinite(result).all())
