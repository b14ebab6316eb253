"""Kinematics of the 3-PTT: against an independent delta, by numerical derivatives, out of reach, by hand."""

import csv
import math
from pathlib import Path

import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from made_legs import at_random, drawing, made, tensor
from torch.func import jacfwd, jvp, vmap
from torch.testing import assert_close

from ptt.errors import MachineError
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.dexterity import singularities
from ptt.mechanisms.spheres import BLOCK_ROWS
from ptt.mechanisms.three_ptt import ThreePtt

GOLDEN = Path(__file__).parent / "golden" / "linear_delta.csv"
# torch itself still scripts its forward-mode formulas on first use
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


def golden_cases():
    with GOLDEN.open(encoding="utf-8") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def golden_machine(case) -> ThreePtt:
    azimuth = [math.radians(case[f"azimuth{leg}_deg"]) for leg in (1, 2, 3)]
    radius = [case[f"radius{leg}_mm"] for leg in (1, 2, 3)]
    foot = [[r * math.cos(a), r * math.sin(a), 0.0] for r, a in zip(radius, azimuth, strict=True)]
    return ThreePtt.from_legs(foot, [[0, 0, 1]] * 3, [case[f"link{leg}_mm"] for leg in (1, 2, 3)], [[0.0] * 3] * 3)


def test_golden_file_forward_and_inverse():
    cases = golden_cases()
    assert len(cases) == 120
    for case in cases:
        machine = golden_machine(case)
        b, p = tensor([case["b1"], case["b2"], case["b3"]]), tensor([case["x"], case["y"], case["z"]])
        assert_close(machine.forward(b), p, rtol=0.0, atol=1e-9)
        assert_close(machine.inverse(p), b, rtol=0.0, atol=1e-9)


@st.composite
def machines(draw) -> ThreePtt:
    """Any sensible leg geometry: leaning rails, unequal legs, either side, either order, R under or over r."""
    number = lambda low, high: st.floats(low, high, allow_subnormal=False)  # noqa: E731
    spread = draw(number(40.0, 150.0)) * draw(st.sampled_from([-1.0, 1.0]))
    platform = draw(number(50.0, 120.0)) + max(0.0, -spread)
    turn = draw(st.sampled_from([-1.0, 1.0])) * 2.0 * math.pi / 3.0
    first = draw(number(0.0, 2.0 * math.pi))
    per_leg = st.tuples(number(-0.15, 0.15), number(-0.15, 0.15), number(-8.0, 8.0), number(0.95, 1.05))
    above, length = draw(st.booleans()), abs(spread) * draw(number(1.8, 4.0))
    foot, rail, link, joint = [], [], [], []
    for leg in range(3):
        radial, tangential, off, factor = draw(per_leg)
        angle = first + leg * turn
        c, s = math.cos(angle), math.sin(angle)
        foot.append([(platform + spread + off) * c, (platform + spread + off) * s, 3.0 * off])
        rail.append([radial * c - tangential * s, radial * s + tangential * c, 1.0])
        link.append(length * factor)
        joint.append([platform * c, platform * s, off])
    return ThreePtt.from_legs(foot, rail, link, joint, above=above, joint_height_mm=draw(number(-50.0, 50.0)))


@settings(max_examples=150, deadline=None)
@given(machine=machines(), seed=st.integers(0, 10_000))
def test_forward_of_inverse_is_the_identity(machine, seed):
    size = 0.25 * float(machine.link.min())
    p, geometry = at_random(20, size=size, seed=seed), at_random(20, 15, size=0.5, seed=seed + 1)
    inside = singularities(machine, p)
    kept = (inside.inverse > 0.15) & (inside.direct > 0.1)
    assume(bool(kept.any()))
    assert_close(machine.forward(machine.inverse(p))[kept], p[kept], rtol=0.0, atol=1e-9)
    assert_close(machine.forward(machine.inverse(p, geometry), geometry)[kept], p[kept], rtol=0.0, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(machine=machines(), seed=st.integers(0, 10_000))
def test_jacobians_are_the_derivatives(machine, seed):
    p = at_random(6, size=0.15 * float(machine.link.min()), seed=seed)
    inside = singularities(machine, p)
    p = p[(inside.inverse > 0.15) & (inside.direct > 0.1)]
    assume(len(p) > 0)
    geometry = at_random(len(p), 15, size=0.5, seed=seed)
    q = machine.inverse(p, geometry)
    assert_close(machine.jacobian(q, geometry), vmap(jacfwd(machine.forward))(q, geometry), rtol=1e-9, atol=1e-9)
    by_autograd = vmap(jacfwd(machine.inverse))(p, geometry)
    product = by_autograd @ machine.jacobian(q, geometry)
    assert_close(product, torch.eye(3, dtype=torch.float64).expand_as(product), rtol=0.0, atol=1e-9)


def test_jacobian_of_upright_machine_is_the_papers():
    machine, p = made(), at_random(10)
    w = p[:, 2:] - machine.inverse(p)
    angle = torch.deg2rad(tensor(0.0, 120.0, 240.0))
    row = torch.stack(((p[:, :1] - 100.0 * angle.cos()) / w, (p[:, 1:2] - 100.0 * angle.sin()) / w, w / w), -1)
    assert_close(torch.linalg.inv(machine.jacobian(machine.inverse(p))), row, rtol=1e-9, atol=1e-9)


def test_slider_error_at_the_centre_of_the_bench():
    jacobian = made().jacobian(made().home()[None])[0]
    assert_close(jacobian[:2].norm(dim=0), torch.full((3,), 4.0 * math.sqrt(2.0) / 3.0, dtype=torch.float64))
    assert_close(jacobian[2], torch.full((3,), 1.0 / 3.0, dtype=torch.float64))


@pytest.mark.parametrize(("sliders", "sign"), [("above", 1.0), ("below", -1.0)])
def test_home_has_sliders_on_the_stated_side(sliders, sign):
    machine = made(sliders=sliders, joint_height_mm=12.0, slider_lean_deg=(3.0, -2.0, 7.0))
    drop = math.sqrt(300.0**2 - 100.0**2)
    assert_close(machine.home(), torch.full((3,), 12.0 + sign * drop, dtype=torch.float64))
    assert_close(machine.forward(machine.home()[None]), torch.zeros(1, 3, dtype=torch.float64), rtol=0.0, atol=1e-9)


def test_leaning_rail_goes_outward_at_its_upper_end():
    upright, leaning = made(), made(slider_lean_deg=(5.0, 0.0, 0.0))
    for height, outward in ((50.0, 1.0), (-50.0, -1.0)):
        q = upright.home() + height
        centre = (leaning.foot - upright.foot) + q[:, None] * (leaning.rail - upright.rail)
        assert float(centre[0, 0]) == pytest.approx(outward * 50.0 * math.sin(math.radians(5.0)))
        assert_close(centre[1:], torch.zeros(2, 3, dtype=torch.float64), rtol=0.0, atol=1e-9)


def test_geometry_slots_move_what_their_names_say():
    machine, q = made(), made().inverse(at_random(8))
    assert len(machine.slots) == 15
    assert (machine.slots[0], machine.slots[7], machine.slots[14]) == (
        "leg 1 centre x [mm]",
        "leg 2 link length [mm]",
        "tool z [mm]",
    )
    geometry = torch.zeros(1, 15, dtype=torch.float64)
    geometry[0, 4:7], geometry[0, 11], geometry[0, 12:] = tensor(0.3, -0.2, 0.1), 0.5, tensor(1.0, 2.0, 3.0)
    foot, link = machine.foot.clone(), machine.link.clone()
    foot[1] += tensor(0.3, -0.2, 0.1)
    link[2] += 0.5
    other = ThreePtt(foot, machine.rail, link, machine.outer_axis, machine.above, machine.side)
    assert_close(machine.forward(q, geometry), other.forward(q) + tensor(1.0, 2.0, 3.0), rtol=0.0, atol=1e-9)
    assert_close(machine.forward(q, torch.zeros_like(geometry)), machine.forward(q), rtol=0.0, atol=1e-10)


def test_derivative_by_geometry_is_the_numerical_one():
    machine, q = made(slider_lean_deg=(2.0, 0.0, -1.0)), made().home() + at_random(4, size=30.0)
    analytic = vmap(jacfwd(machine.forward, argnums=1))(q, torch.zeros(4, 15, dtype=torch.float64))
    step = 1e-4 * torch.eye(15, dtype=torch.float64)
    numeric = [(machine.forward(q, s[None]) - machine.forward(q, -s[None])) / 2e-4 for s in step]
    assert_close(analytic, torch.stack(numeric, -1), rtol=0.0, atol=1e-7)
    tangent = at_random(1, 15, size=1.0)
    value, slope = jvp(lambda shift: machine.forward(q, shift), (torch.zeros_like(tangent),), (tangent,))
    assert_close(value, machine.forward(q), rtol=0.0, atol=1e-10)
    assert_close(slope, analytic @ tangent[0], rtol=0.0, atol=1e-9)


def test_batch_equals_loop():
    machine, p, geometry = made(slider_lean_deg=(1.0, 2.0, 3.0)), at_random(30), at_random(30, 15, size=0.5)
    q = machine.inverse(p, geometry)
    for name, argument in (("forward", q), ("inverse", p), ("jacobian", q)):
        batch = getattr(machine, name)(argument, geometry)
        loop = [getattr(machine, name)(argument[i : i + 1], geometry[i : i + 1]) for i in range(30)]
        assert_close(batch, torch.cat(loop), rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("shifts", ["none", "one", "each"])
def test_long_batches_are_the_same_in_blocks(shifts):
    machine, n = made(), 2 * BLOCK_ROWS + 7
    p, one, each = at_random(n), at_random(1, 15, size=0.5), at_random(n, 15, size=0.5)
    geometry = {"none": None, "one": one, "each": each}[shifts]
    last = slice(n - 5, n)
    part = geometry[last] if shifts == "each" else geometry
    q = machine.inverse(p, geometry)
    assert_close(q[last], machine.inverse(p[last], part), rtol=1e-13, atol=1e-12)
    assert_close(machine.forward(q, geometry), p, rtol=0.0, atol=1e-9)
    assert_close(machine.jacobian(q, geometry)[last], machine.jacobian(q[last], part), rtol=1e-13, atol=1e-12)


def test_out_of_reach_is_nan_in_its_own_row_only():
    machine = made()
    p = tensor([0.0, 0.0, 0.0], [500.0, 0.0, 0.0], [10.0, 20.0, 30.0])
    q = machine.inverse(p)
    assert torch.isfinite(q).all(-1).tolist() == [True, False, True]
    q[1] = tensor(0.0, 0.0, 2000.0)
    assert torch.isfinite(machine.forward(q)).all(-1).tolist() == [True, False, True]


def test_home_out_of_reach_is_an_error():
    far = [[1000.0, 0.0, 0.0], [1200.0, 100.0, 0.0], [1200.0, -100.0, 0.0]]
    machine = ThreePtt.from_legs(far, [[0, 0, 1]] * 3, [300.0] * 3, [[0.0] * 3] * 3)
    with pytest.raises(MachineError, match="p = 0"):
        machine.home()


def test_factory_builds_the_drawing():
    machine = build_mechanism(drawing())
    assert isinstance(machine, ThreePtt)
    assert machine.joints == 3
    assert machine.limits().tolist() == [[150.0] * 3, [420.0] * 3]


def test_every_slider_has_its_own_travel():
    ends = ((150.0, 420.0), (160.0, 410.0), (100.0, 500.0))
    drawn = drawing(slider_travel_mm=ends)
    limits = ThreePtt.from_spec(drawn).limits()
    torch.testing.assert_close(limits, torch.tensor(ends, dtype=torch.float64).T)
    assert drawn.common_travel == (160.0, 410.0)
    assert drawn.whole_travel == (100.0, 500.0)
    assert drawing().travel_ends == ((150.0, 420.0),) * 3
    with pytest.raises(ValueError, match="lower end"):
        drawing(slider_travel_mm=((150.0, 420.0), (420.0, 150.0), (0.0, 1.0)))
