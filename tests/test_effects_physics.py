"""Effects against physics worked out by hand, or by a solver that shares nothing with them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.optimize import root
from scipy.spatial.transform import Rotation
from torch.testing import assert_close

from ptt.effects import library
from ptt.effects.bench import sample_view
from ptt.effects.geometry import tension
from ptt.effects.layout import total_size
from ptt.mechanisms.statics import GRAVITY
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.chain import predict
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

RADIUS, SMALL, LINK, HOME = 200.0, 100.0, 300.0, np.sqrt(300.0**2 - 100.0**2)
AZIMUTH = np.radians([0.0, 120.0, 240.0])
OUTWARD = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH), np.zeros(3)], axis=1)
TANGENT = np.stack([-np.sin(AZIMUTH), np.cos(AZIMUTH), np.zeros(3)], axis=1)
POSES = np.array([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [-40.0, 55.0, 30.0], [25.0, -50.0, -45.0]])


def tensor(values):
    return torch.as_tensor(np.asarray(values, dtype=float))


def heights(*column):
    """Joint commands with all sliders at the same heights."""
    return np.repeat(np.asarray(column, dtype=float)[:, None], 3, axis=1)


def shift_of(name, theta, view, label=""):
    return predict([(library()[name](label), tensor(theta))], view).reading - view.p


def jacobian_by_hand(p):
    """J = db/dp of the vertical-slider machine, row by row of the printed formula, and w, (n, 3, 3) and (n, 3)."""
    reach = p[:, None, :2] - (RADIUS - SMALL) * OUTWARD[None, :, :2]
    drop = -np.sqrt(LINK**2 - (reach**2).sum(axis=-1))
    return np.concatenate([reach / drop[..., None], np.ones((*drop.shape, 1))], axis=-1), reach, drop


# The common law: J dp = s, s_i = db_i + dA_z + q_i . dA_xy / w_i + L dL_i / w_i.


@pytest.mark.parametrize(
    ("name", "size", "law"),
    [
        ("homing-offset", 1e-4, lambda b, reach, drop, a: a[:3] + 0.0 * b),
        ("lead-scale", 1e-7, lambda b, reach, drop, a: a[:3] * (b - HOME)),
        ("link-length", 1e-4, lambda b, reach, drop, a: LINK * a[:3] / drop),
        ("tower-position", 1e-4, lambda b, reach, drop, a: sideways(reach, a) / drop),
        ("tower-tilt", 1e-6, lambda b, reach, drop, a: (b - HOME) * sideways(reach, a) / drop),
    ],
)
def test_common_law_of_small_errors(bench, name, size, law):
    view = build_view(bench, make_table(POSES))
    theta = size * np.array([1.0, -0.6, 0.4, -0.7, 0.9, 0.5])[: total_size(library()[name](), 3)]
    jacobian, reach, drop = jacobian_by_hand(POSES)
    expected = np.linalg.solve(jacobian, law(POSES[:, 2:] - drop, reach, drop, theta)[..., None])[..., 0]
    assert_close(shift_of(name, theta, view), tensor(expected), rtol=2e-5, atol=2e-6 * np.abs(expected).max())


def sideways(reach, theta):
    moved = theta[:3, None] * OUTWARD[:, :2] + theta[3:, None] * TANGENT[:, :2]
    return (reach * moved).sum(axis=-1)


def test_payload_on_soft_axes(bench):
    view = build_view(bench, make_table([[60.0, 0.0, 0.0], [0.0, 0.0, 0.0]], payload_kg=4.0))
    um = 1e3 * shift_of("axis-compliance", np.full(3, 1.0 / 5000.0), view)
    assert_close(um[0], tensor([-11.0, 0.0, -6.0]), atol=0.6, rtol=0.0)
    # In the middle each slider carries a third; the tool sinks a third of m g / (3 k) on each, times three sliders.
    assert_close(um[1], tensor([0.0, 0.0, -5.0 * GRAVITY / 3.0 / 5.0]), atol=1e-3, rtol=0.0)


def test_measured_load_comes_before_virtual_work(bench):
    view = build_view(bench, make_table(POSES, payload_kg=5.0, torque=np.tile([10.0, 0.0, -20.0], (4, 1))))
    effect = library()["axis-compliance"]()
    assert_close(effect.shift(tensor([1e-3, 1e-3, 1e-3]), view), tensor(np.tile([0.01, 0.0, -0.02], (4, 1))))


@pytest.mark.parametrize(("name", "stem"), [("windup", "length"), ("tracker-drift", "settling")])
def test_constants_are_refined_between_their_neighbours(name, stem):
    view, effect = sample_view("three-ptt"), library()[name]()
    trials = effect.search(view)
    low, own, high = sorted(float(trial[stem][0]) for trial in trials[1:4])
    found = sorted(float(trial[stem][0]) for trial in effect.refine(view, trials[2]))
    assert found[0] > low and found[-1] < high and own in found
    steps = np.diff(np.log([low, *found, high]))
    assert steps.min() > 0.8 * steps.max()
    again = effect.refine(view, {**trials[2], stem: trials[2][stem] * (found[0] / own)})
    assert len(again) > 5


def test_links_stretch_under_their_pull(bench):
    table = make_table([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-70.0, 0.0, 0.0]], payload_kg=[0.0, 4.0, 4.0])
    view = build_view(bench, table)
    shift = shift_of("link-compliance", [1e-4] * 3, view)
    pulls = GRAVITY * np.array([1.0, 5.0]) / 3.0 * LINK / HOME  # of 1 kg platform and payload, by symmetry
    assert_close(shift[:2, 2], tensor(-1e-4 * pulls * LINK / HOME), rtol=1e-5, atol=0.0)
    slots = library()["link-compliance"]().shift(tensor([1e-4, 0.0, 0.0]), view)
    assert slots[2, 3] < 0.0  # beyond the triangle's edge leg 1 is pushed, and gets shorter
    assert library()["link-compliance"]().needs(view) is None
    empty = build_view(type(bench)(bench.machine.model_copy(update={"platform_mass_kg": 0.0})), make_table(POSES))
    assert "payload" in library()["link-compliance"]().needs(empty)


def test_a_rail_that_leans_far_is_turned_not_stretched(bench):
    spec = bench.machine.model_copy(update={"slider_lean_deg": (4.0, -3.0, 0.0)})
    view = build_view(replace(bench, machine=spec), make_table(POSES))
    lean = np.array([[0.016, -0.006], [-0.01, 0.012], [0.0, 0.016]])  # outward, counter-clockwise
    shift = library()["tower-tilt"]().shift(tensor(lean.T.ravel()), view)
    moved = shift[:, :12].unflatten(1, (3, 4))
    tangential, rail = view.mechanism.outer_axis.numpy(), view.mechanism.rail.numpy()
    outward = np.cross(tangential, rail)
    turned = Rotation.from_rotvec(lean[:, :1] * tangential - lean[:, 1:] * outward).apply(rail)
    exact = (view.q - view.home).numpy()[..., None] * (turned - rail)
    assert_close(moved[..., :3], tensor(exact), atol=2e-4, rtol=0.0)
    assert not moved[..., 3].any() and not shift[:, 12:].any()


def test_screw_growth(bench):
    view = build_view(bench, make_table(POSES, temp_c=[20.0, 30.0, 25.0, 15.0]))
    shift = library()["screw-growth"]().shift(tensor([1.1e-5] * 3 + [2e-3] * 3 + [0.0] * 5), view)
    warmth = np.array([0.0, 10.0, 5.0, -5.0])[:, None]
    assert_close(shift, tensor(warmth * (1.1e-5 * (view.q.numpy() - HOME) + 2e-3)))


def test_frame_growth_is_a_bigger_machine(bench):
    view, share = build_view(bench, make_table(POSES, temp_c=[20.0, 30.0, 30.0, 30.0])), np.array([2.3e-5, 1.1e-5])
    spec = bench.machine
    update = {"base_radius_mm": RADIUS * (1 + 10 * share[0]), "link_length_mm": LINK * (1 + 10 * share[1])}
    warm = ThreePtt.from_spec(spec.model_copy(update=update)).forward(view.q) - view.p
    shift = shift_of("frame-growth", [*share, *[0.0] * 5], view)
    assert_close(shift[1:], warm[1:], rtol=0.0, atol=1e-10)
    assert shift[0].abs().max() == 0.0


def test_link_force_is_what_holds_the_sliders(bench):
    view = build_view(bench, make_table(np.vstack([POSES, [-70.0, 0.0, 0.0]]), payload_kg=2.0))
    weight = -GRAVITY * 3.0  # 2 kg and the platform's 1 kg
    slider = weight * view.jacobian[:, 2, :].numpy()  # virtual work of a vertical force
    reach = jacobian_by_hand(view.p.numpy())[1]
    steep = np.sqrt(LINK**2 - (reach**2).sum(axis=-1)) / LINK
    assert_close(tension(view), tensor(-slider / steep))
    assert (tension(view)[0] > 0).all()  # the platform hangs
    assert tension(view)[4, 0] < 0  # beyond the triangle's edge at x = -50 the leg opposite is pushed


def test_clearance_lets_a_hanging_platform_down(bench):
    view = build_view(bench, make_table(POSES[:1]))
    assert_close(
        shift_of("joint-clearance", [0.02] * 3, view)[0], tensor([0.0, 0.0, -0.01 * LINK / HOME]), atol=1e-6, rtol=0.0
    )


def test_clearance_is_seen_where_pins_change_side_or_first_bear_a_load(bench):
    weightless = type(bench)(bench.machine.model_copy(update={"platform_mass_kg": 0.0}))
    inside = np.tile(POSES[:1], (6, 1)) + np.arange(6)[:, None]
    effect = library()["joint-clearance"]()
    assert "changes sign" in effect.needs(build_view(bench, make_table(inside, payload_kg=np.repeat([0.0, 2.0], 3))))
    assert effect.needs(build_view(weightless, make_table(inside, payload_kg=np.repeat([0.0, 2.0], 3)))) is None
    assert "changes sign" in effect.needs(build_view(weightless, make_table(inside, payload_kg=2.0)))


def twisted(view, reflector, theta):
    """Shift of the reflector of one row whose platform's joint axes are skew, mm, and its turn, rad.

    Six equations for six unknowns: each link keeps its length, and lies across what both of its joint axes span.
    """
    pose = view.p[0].numpy()
    skewed = TANGENT + theta[:3, None] * OUTWARD + theta[3:, None] * np.array([0.0, 0.0, 1.0])
    sliders = RADIUS * OUTWARD + view.q[0].numpy()[:, None] * np.array([0.0, 0.0, 1.0])

    def closure(x):
        turn = Rotation.from_rotvec(x[3:] / LINK)
        links = pose + x[:3] + turn.apply(SMALL * OUTWARD) - sliders
        lengths = (links**2).sum(axis=1) - LINK**2
        return np.concatenate([lengths / LINK, (links * np.cross(TANGENT, turn.apply(skewed))).sum(axis=1)])

    found = root(closure, np.zeros(6), tol=1e-13).x
    assert np.abs(closure(found)).max() < 1e-9
    turn = found[3:] / LINK
    return found[:3] + Rotation.from_rotvec(turn).apply(reflector) - reflector, turn


SKEW = np.array([1.0, -0.4, 0.3, 0.8, -0.2, 0.6])


@pytest.mark.parametrize("beyond", [1, 2, 3])
def test_clearance_is_not_read_off_one_or_two_rows_beyond_the_triangle_of_the_joints(bench, beyond):
    """At x = -70 the link of leg 1 is pushed, where it is pulled at all the others."""
    place = np.concatenate([np.tile(POSES[0], (9, 1)), np.tile([-70.0, 0.0, 0.0], (beyond, 1))])
    said = library()["joint-clearance"]().needs(build_view(bench, make_table(place)))
    assert (said is None) == (beyond >= 3)


@pytest.mark.parametrize("reflector", [(0.0, 0.0, 0.0), (30.0, -20.0, -50.0)])
@pytest.mark.parametrize("pose", POSES.tolist())
def test_platform_twist_against_six_equations(bench, reflector, pose):
    spec = bench.machine.model_copy(update={"reflector_mm": reflector})
    view = build_view(type(bench)(spec), make_table([pose]))
    moved, _ = twisted(view, reflector, 1e-6 * SKEW)
    assert np.abs(moved).max() > 1e-5
    assert_close(shift_of("platform-twist", 1e-6 * SKEW, view)[0], tensor(moved), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("pose", POSES.tolist())
def test_what_is_left_out_of_a_platform_twist_is_of_third_order(bench, pose):
    """Of three times the skew it is 27 times as much; of second order it would be nine times."""
    reflector = (30.0, -20.0, -50.0)
    spec = bench.machine.model_copy(update={"reflector_mm": reflector})
    view, missed = build_view(type(bench)(spec), make_table([pose])), []
    for size in (1e-3, 3e-3):
        moved, turn = twisted(view, reflector, size * SKEW)
        assert np.linalg.norm(turn) > size  # the platform turns by more than its joints are skew
        missed.append(np.linalg.norm(shift_of("platform-twist", size * SKEW, view)[0].numpy() - moved))
    assert missed[1] / missed[0] == pytest.approx(27.0, rel=0.1)


def test_column_bends_with_payload_and_height(bench):
    view = build_view(bench, make_table([[0, 0, 0], [0, 0, 50], [30, 0, 50]], payload_kg=[2.0, 2.0, 0.0]))
    shift = shift_of("column-bend", [1e-3, 2e-3, 1e-5, -1e-5], view)
    assert_close(shift[:2], tensor([[2e-3, 4e-3, 0.0], [3e-3, 3e-3, 0.0]]), atol=1e-12, rtol=0.0)
    assert shift[2].abs().max() == 0.0


def test_metrology_by_hand(bench):
    view = build_view(bench, make_table(POSES, time_s=[0.0, 100.0, 200.0, 400.0]))
    station = np.array([-2000.0, 1500.0, 400.0])
    about = shift_of("tracker-scale", [1e-5, *(-1e-5 * station)], view)
    assert_close(about, tensor(1e-5 * (POSES - station)), atol=1e-12, rtol=0.0)
    turn = np.array([1e-4, -2e-4, 3e-4])
    rigid = np.array([0.1, 0.2, 0.3]) + np.cross(turn, POSES)
    assert_close(shift_of("tracker-frame", [0.1, 0.2, 0.3, *turn], view), tensor(rigid), atol=1e-12, rtol=0.0)
    knocked = np.where(np.array([0.0, 0.0, 1.0, 1.0])[:, None] > 0, rigid, 0.0)
    assert_close(shift_of("setup-jump", [0.1, 0.2, 0.3, *turn, 100.0], view), tensor(knocked), atol=1e-12, rtol=0.0)
    straight = np.array([0.0, 0.25, 0.5, 1.0])[:, None] * np.array([0.1, 0.0, -0.2])
    assert_close(shift_of("tracker-drift", [0.1, 0.0, -0.2, 4e7, 400.0], view), tensor(straight), atol=1e-6, rtol=0.0)
    settled = -np.expm1(-np.array([0, 100, 200, 400]) / 100.0) / -np.expm1(-4.0)
    drift = shift_of("tracker-drift", [0.1, 0.0, -0.2, 100.0, 400.0], view)
    assert_close(drift[:, 0], tensor(0.1 * settled), atol=1e-12, rtol=0.0)


def test_a_joint_offset_counts_by_the_angles_of_its_link(bench):
    """At (0, 150, 0) link 1 leans 30 degrees sideways, and reaches 100 mm inward."""
    view = build_view(bench, make_table([[0.0, 150.0, 0.0]]))
    steep = np.sqrt(LINK**2 - 100.0**2 - 150.0**2) / LINK
    rail, tangential = (library()["joint-offset"]().shift(tensor(np.eye(6)[place]), view)[0, 3] for place in (0, 3))
    assert float(rail) == pytest.approx(steep, rel=1e-12)
    assert float(tangential) == pytest.approx(np.cos(np.radians(30.0)), rel=1e-12)


def test_joint_offset_rail_part_is_a_homing_offset(bench):
    view = build_view(bench, make_table(POSES))
    offset = 1e-4 * np.array([1.0, -0.5, 0.3])
    rail = shift_of("joint-offset", [*offset, 0.0, 0.0, 0.0], view)
    assert_close(rail, shift_of("homing-offset", -offset, view), rtol=1e-4, atol=1e-10)


def test_common_tangential_shift_is_a_turn_of_the_tracker(bench):
    view = build_view(bench, make_table(POSES))
    shift = shift_of("tower-position", [0, 0, 0, 1e-3, 1e-3, 1e-3], view)
    turned = shift_of("tracker-frame", [0, 0, 0, 0, 0, 1e-3 / (RADIUS - SMALL)], view)
    assert_close(shift, turned, rtol=1e-4, atol=1e-8)
