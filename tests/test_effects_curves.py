"""Curves along an axis: no level, no slope, the energy of bending, and files of older ones."""

import numpy as np
import pytest
import torch
from scipy.interpolate import CubicSpline
from small_files import BARE
from test_effects_physics import heights, tensor
from torch.testing import assert_close

from ptt.effects import library
from ptt.effects.curve import Curve
from ptt.effects.shapes import (
    FINE,
    KNOTS,
    SHAPES,
    WAVES,
    curve_pieces,
    smooth_shapes,
    straight_shapes,
    wave_shapes,
    wavy_pieces,
)
from ptt.errors import ModelError
from ptt.machine import parse_machine
from ptt.model.entries import read_model
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


@pytest.mark.parametrize("name", ["screw-error-map", "guide-straightness"])
def test_curves_hold_no_level_and_no_slope(bench, name):
    knots = np.linspace(260.0, 300.0, 17)
    view = build_view(bench, make_table(None, heights(*knots)))
    effect = library()[name]()
    basis = effect.basis(view, effect.search(view)[0])
    curves = basis.sum(dim=1)[:, : effect.parameters[0].count]  # of leg 1: one shape each
    straight = torch.stack([torch.ones(17, dtype=torch.float64), tensor(knots - 280.0) / 20.0])
    assert curves.abs().max() > 0.9
    assert_close(straight @ curves, torch.zeros(2, curves.shape[1], dtype=torch.float64), atol=1e-10, rtol=0.0)


def test_a_usual_curve_costs_its_bending_energy(bench):
    """Least squares with a prior of equal sizes on the shapes is a smoothing spline, which scipy has too."""
    from scipy.interpolate import make_smoothing_spline

    random = np.random.default_rng(5)
    knots = np.linspace(0.0, 1.0, 17)
    wanted = np.sin(7.0 * knots) + 0.1 * random.normal(size=17)
    shapes = np.column_stack([smooth_shapes(tensor(knots)).numpy(), straight_shapes(tensor(knots)).numpy()])
    fine = np.linspace(0.0, 1.0, 20001)
    first = smooth_shapes(tensor(fine)).numpy()[:, 0]
    energy = np.trapezoid(np.gradient(np.gradient(first, fine), fine)[2:-2] ** 2, fine[2:-2])
    toll = 1e-4
    prior = np.diag([toll * energy] * 15 + [0.0, 0.0])
    values = np.linalg.solve(shapes.T @ shapes + prior, shapes.T @ wanted)
    assert_close(
        tensor(shapes @ values), tensor(make_smoothing_spline(knots, wanted, lam=toll)(knots)), atol=1e-4, rtol=0.0
    )


def test_waves_are_all_that_a_spline_on_dense_knots_can_do_beside_the_curve(bench):
    knots = tensor(np.linspace(0.0, 1.0, KNOTS))
    assert_close(wave_shapes(knots), torch.zeros(KNOTS, WAVES, dtype=torch.float64), atol=1e-12, rtol=0.0)
    dense = np.linspace(0.0, 1.0, FINE * (KNOTS - 1) + 1)
    shapes = torch.cat([smooth_shapes(tensor(dense)), straight_shapes(tensor(dense)), wave_shapes(tensor(dense))], 1)
    rough = np.random.default_rng(3).normal(size=len(dense)).cumsum()
    values = np.linalg.solve(shapes.numpy(), rough)
    cut = values[:SHAPES], values[SHAPES : SHAPES + 2], values[SHAPES + 2 :]
    spline = CubicSpline(dense, rough, bc_type="natural")
    np.testing.assert_allclose(wavy_pieces(*cut), spline.c.T, rtol=0.0, atol=1e-6 * np.abs(spline.c).max())
    plain = curve_pieces(*cut[:2])[:, 3]  # where a piece begins
    np.testing.assert_allclose(wavy_pieces(*cut[:2], np.zeros(WAVES))[::FINE, 3], plain, rtol=0.0, atol=1e-12)


def test_a_curve_of_no_known_form_is_refused():
    entry = '[[effect]]\nname = "screw-error-map"\n[effect.parameters]\ncurve_mm = { value = [0.3, 0.1, 0.2] }\n'
    with pytest.raises(ModelError, match=r"'curve_mm' has 3 values; give one, or 45"):
        read_model(parse_machine(f"{BARE}\n{entry}straight_mm = {{ value = 0.0 }}\n"))


class Hurried(Curve):
    """A slider whose error follows its speed."""

    name = "hurried"
    mechanisms = ("three-ptt",)
    on = "speed2"
    between = (0.0, 40.0)


def test_a_curve_that_follows_a_speed_needs_speeds():
    still = build_view(parse_machine(BARE), make_table(np.random.default_rng(0).uniform(-40.0, 40.0, (20, 3))))
    assert "speed" in Hurried.requires and Hurried().needs(still)


def test_a_curve_of_either_familys_joints_is_in_radians_on_an_arm():
    """It followed a direction on both, and said of an arm's joint 'mm', with the usual size of a slider: 1 deg."""

    class Dragged(Curve):
        name = "dragged"
        on, shape = "direction1", "levels"
        between = (-1.0, 1.0)

    (size,) = Dragged.parameters
    assert [(size.on(kind).name, size.on(kind).usual) for kind in Dragged.mechanisms] == [
        ("size_mm", 0.02),
        ("size_rad", 1e-4),
    ]
