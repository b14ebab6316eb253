"""Derivatives by reverse mode are those of forward mode, and numerical ones, and load no compiler."""

import subprocess
import sys

import pytest
import torch
from torch.testing import assert_close

from ptt.effects.bench import sample_view
from ptt.effects.registry import library
from ptt.mechanisms.derivatives import by_input, by_parameters
from ptt.model.chain import differentiate
from ptt.model.model import start_term

CASES = [(name, kind) for name, cls in library().items() for kind in cls.mechanisms]


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_every_effect_is_differentiated_as_forward_mode_does(name, kind):
    view = sample_view(kind)
    effect = library()[name]()
    generator = torch.Generator().manual_seed(3)
    theta = start_term(effect, view).theta
    theta = theta + 1e-2 * torch.rand(theta.shape, generator=generator, dtype=theta.dtype)
    given = [p.role == "given" for p in effect.parameters for _ in range(p.size(view.joints))]
    shift, derivative = differentiate(effect, theta, view)
    forward = torch.func.jacfwd(lambda x: effect.shift(x, view))(theta)
    kept = [index for index, held in enumerate(given) if not held]
    assert_close(shift, effect.shift(theta, view))
    assert_close(derivative[..., kept], forward[..., kept], rtol=1e-10, atol=1e-12 * (1.0 + float(forward.abs().max())))


def test_rows_by_themselves_and_what_does_not_depend():
    x = torch.rand(7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))

    def function(value: torch.Tensor) -> torch.Tensor:
        return torch.stack([value[:, 0] * value[:, 1], value[:, 2].exp(), torch.ones(len(value))], dim=1)

    exact = torch.zeros(7, 3, 3, dtype=torch.float64)
    exact[:, 0, 0], exact[:, 0, 1], exact[:, 1, 2] = x[:, 1], x[:, 0], x[:, 2].exp()
    assert_close(by_input(function, x), exact)
    assert_close(by_input(torch.ones_like, x), torch.zeros(7, 3, 3, dtype=torch.float64))
    assert_close(by_parameters(torch.ones_like, x[0]), torch.zeros(3, 3, dtype=torch.float64))
    assert by_parameters(lambda theta: theta.sum() + x, x[0, :0]).shape == (7, 3, 0)


def test_no_compiler_is_loaded():
    code = (
        "import sys, torch; from ptt.mechanisms.derivatives import by_input, by_parameters\n"
        "x = torch.rand(5, 3, dtype=torch.float64)\n"
        "by_input(lambda v: torch.where(v > 0.5, v / 2.0, torch.minimum(v * v, 1 - v)), x)\n"
        "by_parameters(lambda t: x / 2.0 * t.clamp(min=0.0), x[0])\n"
        "print([m for m in ('torch._dynamo', 'sympy', 'torch._decomp.decompositions_for_jvp') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
