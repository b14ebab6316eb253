"""Geometry faults of the rig against the first-order law J dp = s, and the platform against its own constraints."""

import numpy as np
import pytest
from test_rig_bench import bench, inverse_jacobian, link_parts, slider_space, table, truth, volume

from ptt.rig import simulate
from ptt.rig.legs import build_legs
from ptt.rig.nominal import ideal_machine, nominal_sliders
from ptt.rig.platform import solve_platform

POSES = volume(60)
HOME = np.sqrt(300.0**2 - 100.0**2)
ANGLE = np.radians([0.0, 120.0, 240.0])
OUTWARD = np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
SIDEWAYS = np.column_stack([-np.sin(ANGLE), np.cos(ANGLE)])
SIZE = np.array([1e-4, -2e-4, 1.5e-4])
HEIGHT = POSES[:, 2:] - link_parts(POSES)[1] - HOME


def along(direction: np.ndarray) -> np.ndarray:
    """q . direction / w per leg, (n, 3)."""
    q, w = link_parts(POSES)
    return (q * direction).sum(-1) / w


def over_w() -> np.ndarray:
    return 300.0 / link_parts(POSES)[1]


def sideways_cosine() -> np.ndarray:
    q, _ = link_parts(POSES)
    return np.sqrt(1.0 - ((q * SIDEWAYS).sum(-1) / 300.0) ** 2)


# Pulls straight down, from so far away that the direction is the same everywhere, and so little that nothing yields.
WEIGHT = {"kind": "hose", "anchor_mm": [0.0, 0.0, -9e6], "pull_n": 1e-6, "compliance_um_per_n": 0.0}

CASES = {
    "homing": ({"drive": {"homing_mm": SIZE}}, lambda: SIZE),
    "scale": ({"drive": {"scale_um_per_m": 10.0}}, lambda: 1e-5 * HEIGHT),
    "tower radial": ({"geometry": {"tower_radial_mm": SIZE}}, lambda: SIZE * along(OUTWARD)),
    "tower tangential": ({"geometry": {"tower_tangential_mm": SIZE}}, lambda: SIZE * along(SIDEWAYS)),
    "platform joint radial": ({"geometry": {"platform_joint_radial_mm": SIZE}}, lambda: -SIZE * along(OUTWARD)),
    "platform joint tangential": (
        {"geometry": {"platform_joint_tangential_mm": SIZE}},
        lambda: -SIZE * along(SIDEWAYS),
    ),
    "lean radial": ({"geometry": {"lean_radial_mrad": 1e3 * SIZE / 100}}, lambda: SIZE / 100 * HEIGHT * along(OUTWARD)),
    "lean tangential": (
        {"geometry": {"lean_tangential_mrad": 1e3 * SIZE / 100}},
        lambda: SIZE / 100 * HEIGHT * along(SIDEWAYS),
    ),
    "link": ({"geometry": {"link_mm": SIZE}}, lambda: SIZE * over_w()),
    "clearance, pulled": (
        {"geometry": {"clearance_um": np.abs(2e3 * SIZE)}, "odd": [WEIGHT]},
        lambda: np.abs(SIZE) * over_w() * np.sign(pull()),
    ),
    "joint offset along the rail": ({"geometry": {"joint_offset_rail_mm": SIZE}}, lambda: -SIZE + 0.0 * over_w()),
    "joint offset at the slider": (
        {"geometry": {"joint_offset_slider_mm": SIZE}},
        lambda: SIZE * sideways_cosine() * over_w(),
    ),
    "joint offset at the platform": (
        {"geometry": {"joint_offset_platform_mm": SIZE}},
        lambda: SIZE * sideways_cosine() * over_w(),
    ),
    "frame growth": (
        {"thermal": {"frame_um_per_m_k": 0.5}, "conditions": {"room": {"start_c": 21.0}}},
        lambda: 0.5e-6 * 200.0 * along(OUTWARD),
    ),
    "platform growth": (
        {"thermal": {"platform_um_per_m_k": 0.5}, "conditions": {"room": {"start_c": 21.0}}},
        lambda: -0.5e-6 * 100.0 * along(OUTWARD),
    ),
    "link growth": (
        {"thermal": {"link_um_per_m_k": 0.5}, "conditions": {"room": {"start_c": 21.0}}},
        lambda: 0.5e-6 * 300.0 * over_w(),
    ),
    "screw growth": (
        {"thermal": {"growth_um_per_m_k": 1.0, "fixed_end_mm": 400.0}, "conditions": {"room": {"start_c": 20.5}}},
        lambda: 0.5e-6 * (HEIGHT + HOME - 400.0),
    ),
}


def pull() -> np.ndarray:
    """Sign of the tension in each link when the platform is pulled down, (n, 3)."""
    q, w = link_parts(POSES)
    unit = np.concatenate([q, w[..., None]], axis=-1) / 300.0
    return np.linalg.solve(np.swapaxes(unit, 1, 2), np.array([[0.0], [0.0], [-1.0]]))[..., 0]


def plain(value: object) -> object:
    """Arrays as lists."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


@pytest.mark.parametrize("name", CASES)
def test_first_order_law(name: str) -> None:
    sections, expected = CASES[name]
    got = slider_space(bench(**plain(sections)), POSES)
    want = np.broadcast_to(expected(), got.shape)
    assert np.abs(want).max() > 2e-5
    np.testing.assert_allclose(got, want, atol=2e-8)


def test_centre_gains_of_a_slider_error() -> None:
    """A slider error of 1 moves the tool 1.89 sideways and 0.33 up at the centre."""
    moved = truth(bench(drive={"homing_mm": [1e-3, 0.0, 0.0]}), np.zeros((1, 3)))[0] / 1e-3
    assert np.hypot(*moved[:2]) == pytest.approx(1.886, abs=2e-3)
    assert moved[2] == pytest.approx(1 / 3, abs=1e-3)


def test_leaning_rail_keeps_its_length() -> None:
    """The slider moves along its own rail: at 20 mrad the cosine counts, which no first-order law has."""
    drawing = ideal_machine(bench().spec)
    slider = nominal_sliders(drawing, POSES)
    still = np.zeros(len(POSES))
    faults = bench(geometry={"lean_radial_mrad": 20.0, "lean_tangential_mrad": -10.0}).geometry
    legs = build_legs(
        drawing,
        faults,
        slider,
        wander=np.zeros((60, 3, 2)),
        bend=np.zeros((60, 3, 3)),
        growth=(still, still, still),
        stretch=np.zeros((60, 3)),
    )
    away = legs.slider - drawing.pivot
    np.testing.assert_allclose(np.linalg.norm(away, axis=-1), np.abs(slider - drawing.home), atol=1e-10)


def skewed(**more: object) -> dict[str, object]:
    axes = {
        "slider_axis_radial_mrad": [1.0, -2.0, 0.5],
        "slider_axis_vertical_mrad": [-0.7, 0.4, 1.1],
        "platform_axis_radial_mrad": [0.3, 1.5, -1.2],
        "platform_axis_vertical_mrad": [2.0, -0.6, 0.9],
    }
    return {**axes, **more}


def solved(geometry: dict[str, object]):
    rig = bench(geometry=geometry)
    drawing = ideal_machine(rig.spec)
    still = np.zeros(len(POSES))
    legs = build_legs(
        drawing,
        rig.geometry,
        nominal_sliders(drawing, POSES),
        wander=np.zeros((60, 3, 2)),
        bend=np.zeros((60, 3, 3)),
        growth=(still, still, still),
        stretch=np.zeros((60, 3)),
    )
    return legs, solve_platform(legs, POSES)


def test_platform_keeps_links_and_universal_joints() -> None:
    legs, pose = solved(skewed(link_mm=[0.1, -0.2, 0.3], tower_radial_mm=0.3))
    end = pose.position[:, None] + np.einsum("nij,nlj->nli", pose.rotation, legs.platform)
    axis = np.einsum("nij,lj->nli", pose.rotation, legs.platform_axis)
    span = end - legs.slider
    np.testing.assert_allclose(np.linalg.norm(span, axis=-1), legs.length, atol=1e-9)
    plane = (span * np.cross(legs.slider_axis, axis)).sum(-1) / 300.0
    np.testing.assert_allclose(plane, 0.0, atol=1e-12)
    square = pose.rotation @ np.swapaxes(pose.rotation, 1, 2)
    np.testing.assert_allclose(square, np.broadcast_to(np.eye(3), square.shape), atol=1e-12)
    assert np.abs(pose.rotation - np.eye(3)).max() > 1e-3


def test_offset_axes_are_a_true_mechanism() -> None:
    """Along the outer axis the link's own length, across it the link's and the offset: Pythagoras, not first order."""
    offset = np.array([5.0, -8.0, 3.0])
    legs, pose = solved({"joint_offset_slider_mm": offset.tolist()})
    span = pose.position[:, None] + legs.platform - legs.slider
    lengthwise = (span * legs.slider_axis).sum(-1)
    across = np.linalg.norm(span - lengthwise[..., None] * legs.slider_axis, axis=-1)
    np.testing.assert_allclose((across - offset) ** 2 + lengthwise**2, 300.0**2, rtol=1e-12)


def test_platform_turns_by_the_linear_law() -> None:
    """(s - (s.e) e) . w = -s . (e x d), d the axis error of the platform's joint against the slider's."""
    small = 1e-5
    geometry = {"platform_axis_radial_mrad": [1e3 * small, 0, 0], "slider_axis_vertical_mrad": [0, 1e3 * small, 0]}
    turn = simulate(bench(geometry=geometry), table(POSES), noise=False).rotation
    q, w = link_parts(POSES)
    link = np.concatenate([q, w[..., None]], axis=-1) / 300.0
    axis = np.column_stack([SIDEWAYS, np.zeros(3)])
    error = np.zeros((3, 3))
    error[0, :2], error[1, 2] = small * OUTWARD[0], -small
    rows = link - (link * axis).sum(-1, keepdims=True) * axis
    right = -(link * np.cross(axis, error)).sum(-1)
    np.testing.assert_allclose(turn, np.linalg.solve(rows, right[..., None])[..., 0], atol=5e-9)
    assert np.abs(turn).max() > small / 2


def test_reflector_off_centre_sees_the_turn() -> None:
    offset = np.array([0.0, 0.0, -80.0])
    geometry = {"platform_axis_radial_mrad": [0.05, 0.0, 0.0]}
    centred = simulate(bench(geometry=geometry), table(POSES), noise=False)
    seen = simulate(bench({"reflector_mm": offset.tolist()}, geometry=geometry), table(POSES), noise=False)
    np.testing.assert_allclose(seen.truth - centred.truth, np.cross(centred.rotation, offset), atol=1e-6)
    assert np.abs(seen.truth - centred.truth).max() > 2e-3
    upright = simulate(bench({"reflector_mm": offset.tolist()}), table(POSES), noise=False)
    np.testing.assert_allclose(upright.truth, POSES, atol=1e-9)


def test_a_leaning_slider_may_carry_its_joint_axis() -> None:
    lean = {"lean_tangential_mrad": [1.0, 0.0, 0.0]}
    level = simulate(bench(geometry=lean), table(POSES), noise=False)
    tipped = simulate(bench(geometry={**lean, "lean_turns_joint_axis": True}), table(POSES), noise=False)
    assert np.abs(level.rotation).max() < 1e-12
    assert np.abs(tipped.rotation).max() > 5e-4


def test_random_guide_is_smooth_and_has_neither_place_nor_lean() -> None:
    from ptt.rig.legs import guide_wander

    rig = bench(geometry={"straightness_um": 10.0, "straightness_seed": 3, "straightness_span_mm": [200.0, 340.0]})
    height = np.repeat(np.linspace(200.0, 340.0, 2001)[:, None], 3, axis=1)
    wander = guide_wander(rig.spec, rig.geometry, height)
    assert wander.shape == (2001, 3, 2)
    np.testing.assert_allclose(wander.std(axis=0), 0.010, rtol=0.01)
    for leg in range(3):
        for way in range(2):
            np.testing.assert_allclose(np.polyfit(height[:, leg] - 270.0, wander[:, leg, way], 1), 0.0, atol=5e-5)
    assert np.abs(np.diff(wander, axis=0)).max() < 2e-4
    other = bench(geometry={**rig.geometry.model_dump(), "straightness_seed": 4})
    assert np.abs(guide_wander(other.spec, other.geometry, height) - wander).max() > 0.005


def test_given_guide_is_followed() -> None:
    knots = [180.0, 230.0, 280.0, 330.0, 380.0]
    lists = [[0.0, 5.0, -3.0, 2.0, 0.0], [0.0] * 5, [0.0] * 5]
    rig = bench(geometry={"straightness_height_mm": knots, "straightness_tangential_um": lists})
    from ptt.rig.legs import guide_wander

    beyond = guide_wander(rig.spec, rig.geometry, np.array([[80.0, 80.0, 80.0], [480.0, 480.0, 480.0]]))
    np.testing.assert_allclose(beyond, 0.0, atol=1e-12)  # as at the ends of the table
    drawing = ideal_machine(rig.spec)
    pose = np.array([[0.0, 0.0, 230.0 - drawing.home[0]]])
    error = truth(rig, pose) - pose
    q, w = link_parts(pose)
    want = np.array([[0.005 * (q[0, 0] @ SIDEWAYS[0]) / w[0, 0], 0.0, 0.0]])
    np.testing.assert_allclose(np.einsum("nij,nj->ni", inverse_jacobian(pose), error), want, atol=1e-7)
