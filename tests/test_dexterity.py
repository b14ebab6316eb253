"""How well a pose can be moved and held: determinants, singularities and forces against closed forms."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from made_legs import at_random, drawing, made, tensor
from torch.testing import assert_close

from ptt.commands.main import run
from ptt.machine import load_machine
from ptt.mechanisms import dexterity_report
from ptt.mechanisms.dexterity import (
    condition_number,
    determinant,
    manipulability,
    near_singularity,
    singular_values,
    singularities,
)
from ptt.mechanisms.dexterity_report import describe_dexterity
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.statics import GRAVITY, link_forces, weight
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.mechanisms.workspace import reach, travel_margin, workspace_map
from ptt.show.plots.common import save
from ptt.show.plots.workspace import _heights, draw_dexterity

DATA = Path(__file__).resolve().parents[1] / "data"
SINE = math.sqrt(3.0) / 2.0


def radial(azimuth_deg=(0.0, 120.0, 240.0)) -> torch.Tensor:
    angle = torch.deg2rad(tensor(*azimuth_deg))
    return torch.stack((angle.cos(), angle.sin(), 0.0 * angle), -1)


def upright(links, spread: float = 100.0) -> ThreePtt:
    """Upright rails with unequal links."""
    u = radial()
    return ThreePtt.from_legs((spread + 100.0) * u, [[0, 0, 1]] * 3, links, 100.0 * u)


@settings(max_examples=50, deadline=None)
@given(
    base=st.floats(60.0, 300.0),
    platform=st.floats(60.0, 300.0),
    slack=st.floats(1.2, 4.0),
    first=st.floats(0.0, 360.0),
    sliders=st.sampled_from(["above", "below"]),
)
def test_determinant_formula(base, platform, slack, first, sliders):
    spread = abs(base - platform)
    link = slack * max(spread, 40.0)
    machine = made(
        base_radius_mm=base,
        platform_radius_mm=platform,
        link_length_mm=link,
        sliders=sliders,
        slider_azimuth_deg=(first, first + 120.0, first + 240.0),
    )
    p = at_random(10, size=0.3 * (link - spread))
    w = p[:, 2:] - machine.inverse(p) - machine.joint_height_mm
    coplanarity = ((base - platform + 2.0 * p @ machine.outward.T) * w).sum(-1)
    product = 0.5 * math.sqrt(3.0) * (base - platform) * coplanarity / w.prod(-1)
    assert_close(determinant(machine, p), product, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize(
    "changes",
    [{"slider_lean_deg": (0.0, 0.1, 0.0)}, {"slider_azimuth_deg": (0.0, 119.0, 240.0)}],
    ids=["lean", "angle"],
)
def test_determinant_of_legs_that_are_not_alike(changes):
    machine, p = made(**changes), at_random(5)
    assert_close(determinant(machine, p), torch.linalg.det(machine.jacobian(machine.inverse(p))).reciprocal())


def test_inverse_singularity_where_a_link_lies_square_to_its_rail():
    # leg 1 stands at x = 100, so the link of 300 lies flat at x = -200
    x = torch.cat((torch.linspace(-150.0, -199.9, 30, dtype=torch.float64), tensor(-200.0)))
    found = singularities(made(), torch.stack((x, 0.0 * x, 0.0 * x), -1))
    assert_close(found.edge_mm, x + 200.0, rtol=0.0, atol=1e-9)
    assert_close(found.inverse_mm, (300.0**2 - (x - 100.0) ** 2).sqrt(), rtol=0.0, atol=1e-9)
    assert bool((found.inverse_mm.diff() < 0.0).all())
    assert (float(found.inverse[-1]), float(found.manipulability[-1])) == (0.0, 0.0)
    assert math.isinf(float(found.condition[-1]))
    assert not bool(found.near[0])
    assert bool(found.near[-1])


def test_leaning_rail_has_its_inverse_singularity_square_to_the_rail():
    machine = made(slider_lean_deg=(8.0, 0.0, 0.0))
    square = torch.linalg.cross(machine.rail[0], tensor(0.0, 1.0, 0.0))
    p = machine.foot[0] + 280.0 * machine.rail[0] - square * 300.0 * math.copysign(1.0, float(square[0]))
    found = singularities(machine, p[None] + tensor([0.001, 0.0, 0.0]))
    assert float(found.inverse_mm) < 1.0
    assert float(found.edge_mm) == pytest.approx(0.001, abs=2e-5)


def test_direct_singularity_where_the_radii_are_equal():
    found = singularities(made(base_radius_mm=100.0), at_random(10))
    assert_close(found.direct, torch.zeros(10, dtype=torch.float64), rtol=0.0, atol=1e-7)
    assert bool(found.near.all())
    assert bool(torch.isnan(made(base_radius_mm=100.0).forward(made().home()[None])).all())


def test_direct_singularity_where_the_factor_s_vanishes():
    # at (150, 0) S = 400 w_1 - 100 w_2 = 0 asks for a first link that is short: w_1 = w_2 / 4
    w2 = math.sqrt(300.0**2 - 200.0**2 - (100.0 * SINE) ** 2)
    machine = upright([math.hypot(50.0, w2 / 4.0), 300.0, 300.0])
    p = tensor([149.0, 0.0, 0.0], [150.0, 0.0, 0.0], [151.0, 0.0, 0.0])
    found = singularities(machine, p)
    assert float(determinant(machine, p)[1]) == pytest.approx(0.0, abs=1e-12)
    assert float(found.direct[1]) < 1e-12
    assert float(found.direct_volume[0] * found.direct_volume[2]) < 0.0
    assert float(found.direct[0]) > 1e-4
    assert float(found.inverse_mm.min()) > 10.0


@settings(max_examples=50, deadline=None)
@given(spread=st.floats(10.0, 200.0), seed=st.integers(0, 1000))
def test_equal_links_have_no_direct_singularity_but_equal_radii(spread, seed):
    found = singularities(made(base_radius_mm=100.0 + spread), at_random(50, size=300.0, seed=seed))
    share = found.direct[torch.isfinite(found.direct)] / (math.sqrt(1.5) * spread / 300.0)
    assert bool(((share > 0.95) & (share < 1.0 + 1e-9)).all())
    assert bool((found.direct_volume[torch.isfinite(found.direct_volume)] < 0.0).all())


def test_constraint_volume_is_the_polynomial_of_the_joint_axes():
    machine, p, u = made(), at_random(20, size=100.0), radial()
    w = p[:, 2:] - machine.inverse(p)
    g = p @ u.T - 100.0
    g1, g2, g3, w1, w2, w3 = *g.unbind(-1), *w.unbind(-1)
    polynomial = g1 * g2 * w3 + g2 * g3 * w1 + g1 * g3 * w2
    scale = torch.hypot(g, w).prod(-1)
    assert_close(singularities(machine, p).constraint_volume, SINE * polynomial / scale)


def test_constraint_singularity_where_two_outer_planes_stand_upright():
    # p = -2 rho u_3 has p . u_1 = p . u_2 = rho, so g_1 = g_2 = 0
    machine, place = made(base_radius_mm=180.0), -160.0 * radial()[2]
    found = singularities(machine, torch.stack((0.98 * place, place, 1.02 * place)))
    assert float(found.constraint[1]) < 1e-12
    assert float(found.constraint_volume[0] * found.constraint_volume[2]) < 0.0
    assert float(found.constraint[0]) > 1e-4
    assert float(found.direct.min()) > 0.3
    assert float(found.inverse.min()) > 0.4
    assert bool(found.near.all())


def test_paper_machine_is_far_from_singular_in_its_working_volume():
    assert not bool(singularities(made(), at_random(500, size=60.0)).near.any())


def test_condition_and_manipulability_are_those_of_the_jacobian():
    machine, p = made(slider_lean_deg=(3.0, 0.0, -2.0)), at_random(20)
    jacobian, found = machine.jacobian(machine.inverse(p)), singularities(machine, p)
    assert_close(found.condition, torch.linalg.cond(jacobian))
    assert_close(condition_number(jacobian), found.condition)
    assert_close(condition_number(torch.linalg.inv(machine.jacobian(machine.inverse(p)))), found.condition)
    assert_close(found.manipulability, torch.linalg.det(jacobian).abs())
    assert_close(manipulability(jacobian), found.manipulability)


def test_condition_number_of_the_bench_at_its_centre():
    # sideways singular value sqrt(3/2) 4 sqrt(2)/3, upward one sqrt(3)/3
    found = singularities(made(), torch.zeros(1, 3, dtype=torch.float64))
    assert float(found.condition) == pytest.approx(4.0)


def test_a_singular_pose_has_no_finite_condition():
    flat = torch.tensor([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]], dtype=torch.float64)
    assert condition_number(flat[None]).tolist() == [math.inf]
    assert condition_number(torch.diag(tensor([1.0, 1.0, 1e-12])[0])[None]).item() == pytest.approx(1e12)
    assert bool(torch.isnan(condition_number(math.nan * flat[None])).all())


@pytest.mark.parametrize("joints", [2, 3, 4])
def test_a_singular_pose_has_no_least_move_and_the_others_theirs(joints):
    whole, flat = torch.eye(3, joints, dtype=torch.float64), torch.ones(3, joints, dtype=torch.float64)
    wanted = tensor([1.0, 2.0, 3.0]).expand(3, 3)
    move = least_move(torch.stack((whole, flat, math.nan * whole)), wanted, min(joints, 3))
    assert move[0].tolist() == [1.0, 2.0, 3.0, 0.0][:joints]
    assert bool(torch.isnan(move[1:]).all())


def test_singular_values_keep_nan_in_its_own_row():
    matrix = torch.eye(3, dtype=torch.float64).repeat(2, 1, 1)
    matrix[1, 0, 0] = math.nan
    values = singular_values(matrix)
    assert values[0].tolist() == [1.0, 1.0, 1.0]
    assert bool(torch.isnan(values[1]).all())


def test_reach_names_the_status_of_each_target():
    p = tensor([0.0, 0.0, 0.0], [0.0, 0.0, 140.0], [0.0, 0.0, -140.0], [400.0, 0.0, 0.0], [-199.0, 0.0, 140.0])
    status = reach(made(), p)
    assert status.tolist() == ["ok", "out of travel", "out of travel", "out of reach", "near singular"]
    assert reach(made(), torch.full((1, 3), math.nan, dtype=torch.float64)).tolist() == ["out of reach"]


@pytest.mark.parametrize("platform_radius_mm", [100.0, 170.0, 196.0])
def test_who_is_near_a_singularity_is_told_without_singular_values_where_a_bound_tells_it(platform_radius_mm):
    mechanism, places = made(platform_radius_mm=platform_radius_mm), at_random(4000, size=320.0)
    expected = singularities(mechanism, places).near
    assert bool((near_singularity(mechanism, places) == expected).all())
    assert bool(expected.any()) and bool(torch.isnan(mechanism.inverse(places)).any())


def test_travel_margin_counts_to_the_nearest_end():
    q = tensor([150.0, 300.0, 300.0], [300.0, 410.0, 300.0], [300.0, 300.0, 430.0])
    assert travel_margin(made(), q).tolist() == [0.0, 10.0, -10.0]


def test_a_kilogram_weighs_what_standard_gravity_says():
    """9.80665 m/s2, as the third General Conference on Weights and Measures agreed on in 1901."""
    assert_close(weight(2.0, 1.0), 3.0 * tensor(0.0, 0.0, -9.80665), rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("sliders", ["above", "below"])
def test_link_forces_balance_the_platform(sliders):
    machine, p = made(sliders=sliders, slider_lean_deg=(4.0, 0.0, -3.0)), at_random(20)
    payload = torch.linspace(0.0, 9.5, 20, dtype=torch.float64)
    force = link_forces(machine, p, payload, 2.0)
    unit = torch.nn.functional.normalize(machine.link_vectors(p), dim=-1)
    rest = (force.unsqueeze(-1) * unit).sum(1)
    rest[:, 2] -= (payload + 2.0) * GRAVITY
    assert_close(rest, torch.zeros_like(rest), rtol=0.0, atol=1e-9)
    pushes = sliders == "below"
    assert bool(((link_forces(machine, torch.zeros(1, 3, dtype=torch.float64), 5.0) > 0.0) == pushes).all())


def test_axis_forces_are_the_links_parts_along_the_rails():
    machine, p = made(slider_lean_deg=(4.0, 0.0, -3.0)), at_random(20)
    unit = torch.nn.functional.normalize(machine.link_vectors(p), dim=-1)
    along = -link_forces(machine, p, 5.0, 1.0) * (unit * machine.rail).sum(-1)
    by_virtual_work = (machine.jacobian(machine.inverse(p)) * weight(5.0, 1.0).unsqueeze(-1)).sum(-2)
    assert_close(by_virtual_work, along)


def test_link_force_changes_sign_only_outside_the_joint_triangle():
    # u_1's opposite side lies at x = -rho / 2 for links of equal inclination; well beyond it link 1 is relieved
    force = link_forces(made(), tensor([-40.0, 0.0, 0.0], [-70.0, 0.0, 0.0]), 5.0)
    assert float(force[0, 0]) < 0.0 < float(force[1, 0])


def test_workspace_map_is_the_pointwise_condition():
    x, y, z = (torch.linspace(-low, low, n, dtype=torch.float64) for low, n in ((260.0, 9), (240.0, 7), (60.0, 3)))
    result = workspace_map(made(), x, y, z)
    assert result.condition.shape == (3, 7, 9)
    p = tensor([float(x[3]), float(y[2]), float(z[1])])
    assert_close(result.condition[1, 2, 3], singularities(made(), p).condition[0])
    assert_close(result.travel_margin[1, 2, 3], travel_margin(made(), made().inverse(p))[0])
    assert bool(torch.isnan(result.condition[:, 0, 0]).all())
    assert_close(result.condition, result.condition.flip(1), equal_nan=True)


def test_workspace_map_picture(tmp_path, monkeypatch):
    monkeypatch.setattr("ptt.show.plots.workspace.GRID", 81)
    for name, changes in (("upright", {}), ("leaning", {"slider_lean_deg": (6.0, 6.0, 6.0), "sliders": "below"})):
        spec = drawing(**changes, slider_travel_mm=(-420.0, -150.0) if changes else (150.0, 420.0))
        save(draw_dexterity(spec), tmp_path / f"{name}.png")
        picture = matplotlib.image.imread(tmp_path / f"{name}.png")
        assert picture.shape[1] > 2 * picture.shape[0]
        colour = np.round(255.0 * picture[..., :3]) @ [1e6, 1e3, 1.0]  # one number each: rows sort slowly
        assert len(np.unique(colour)) > 200


@pytest.mark.parametrize(
    "changes",
    [
        {"slider_lean_deg": (60.0, 60.0, 60.0)},
        {"slider_lean_deg": (90.0, 90.0, 90.0), "slider_travel_mm": (150.0, 400.0)},
        {"slider_lean_deg": (180.0, 180.0, 180.0), "slider_travel_mm": (-420.0, -150.0)},
        {"slider_travel_mm": ((150.0, 200.0), (250.0, 300.0), (320.0, 400.0))},
        {"slider_travel_mm": (1000.0, 1200.0)},
        {"slider_travel_mm": (280.0, 282.5)},
    ],
    ids=["lean", "flat", "turned", "none in common", "far", "short"],
)
def test_the_heights_that_are_drawn_can_be_reached(changes):
    """Travel along a leaning rail is no height of the tool."""
    mechanism = made(**changes)
    heights = tensor(*_heights(mechanism))
    across = torch.linspace(-350.0, 350.0, 141, dtype=torch.float64)
    found = workspace_map(mechanism, across, across, heights)
    assert bool((found.travel_margin >= 0.0).any(2).any(1).all())
    assert heights.tolist() == sorted(set(heights.tolist()))


def test_the_heights_of_upright_rails_are_shares_of_the_travel():
    home = float(made().home()[0])
    assert _heights(made(slider_travel_mm=(home - 60.0, home + 60.0))) == pytest.approx([-40.0, 0.0, 40.0], abs=1.0)


def test_equal_radii_are_told_as_the_singularity_that_they_are(tmp_path, capsys):
    text = (DATA / "machine.toml").read_text()
    path = tmp_path / "m.toml"
    path.write_text(re.sub(r"base_radius_mm = \d+", "base_radius_mm = 100", text))
    file = load_machine(path)
    assert file.machine.base_radius_mm == file.machine.platform_radius_mm
    told = describe_dexterity(file)
    home, space = told["home"], told["workspace"]
    assert (home["p_mm"], home["status"], home["direct"]) == ([0.0, 0.0, 0.0], "near singular", 0.0)
    assert home["condition"] == space["condition"]["median"] == math.inf and space["near_singular_share"] == 1.0
    assert run(["dexterity", str(path), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["home"]
    assert said["condition"] is None and said["status"] == "near singular"


def test_a_place_of_infinite_condition_number_is_drawn_dark_and_not_as_out_of_reach(monkeypatch):
    monkeypatch.setattr("ptt.show.plots.workspace.GRID", 81)
    drawn = draw_dexterity(drawing(base_radius_mm=100.0))
    for panel in drawn.axes[:3]:
        shown = np.ma.masked_invalid(panel.collections[0].get_array())
        middle = shown.reshape(81, 81)[40, 40]
        assert middle is not np.ma.masked and middle > panel.collections[0].norm.vmax


@pytest.mark.parametrize("lean", [0.0, 30.0, 80.0])
@pytest.mark.parametrize("travel", [(150.0, 420.0), (280.0, 300.0)])
def test_the_poses_looked_at_are_all_over_what_the_travel_reaches(lean, travel, monkeypatch):
    """Upright rails lift the tool further than a slider travels, and leaning ones carry it across."""
    maps = []
    monkeypatch.setattr(dexterity_report, "workspace_map", lambda *given: maps.append(given) or workspace_map(*given))
    drawn = drawing(slider_lean_deg=(lean,) * 3, slider_travel_mm=travel)
    told = describe_dexterity(replace(load_machine(DATA / "machine.toml"), machine=drawn))["workspace"]
    ((mechanism, *axes),) = maps
    low, high = mechanism.limits()
    share = torch.rand(2000, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    place = mechanism.forward(low + share * (high - low))
    least, most = (torch.stack([axis[end] for axis in axes]) for end in (0, -1))
    room = 0.03 * (most - least)
    assert bool(((place > least - room) & (place < most + room)).all())
    assert bool((most - least < 2.0 * (place.amax(dim=0) - place.amin(dim=0))).all())
    assert told["poses"] > 300


@pytest.mark.parametrize(
    ("machine", "words"), [("machine", "condition number: median"), ("ur10", "of the position alone")]
)
def test_how_evenly_the_targets_can_be_moved_is_told(machine, words, tmp_path, capsys):
    path = DATA / "machine.toml" if machine == "machine" else DATA / "machines" / "ur10.toml"
    rows = ["0,0,10", "20,0,10", "0,30,-10"] if machine == "machine" else ["400,300,500", "500,-200,300", "600,0,400"]
    targets = tmp_path / "t.csv"
    targets.write_text("\n".join(["name,x_cmd,y_cmd,z_cmd", *(f"p{i},{row}" for i, row in enumerate(rows))]) + "\n")
    assert run(["dexterity", str(path), "--targets", str(targets), "--json"]) == 0
    entries = json.loads(capsys.readouterr().out)["targets"]
    assert run(["dexterity", str(path), "--targets", str(targets)]) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    values = sorted(entry["condition"] for entry in entries)
    worst = max(entries, key=lambda entry: entry["condition"])
    assert words in line
    assert f"median {values[1]:.3g}, worst {values[2]:.3g} (row {worst['line']} {worst['name']})" in line
