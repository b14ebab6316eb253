"""Effects against physics worked out by hand, or by a solver that shares nothing with them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.optimize import root
from scipy.spatial.transform import Rotation
from torch.testing import assert_close

from ptt.effects import library
from ptt.effects.bench import sample_view
from ptt.effects.case import make_case, usual_theta
from ptt.effects.geometry import pull
from ptt.effects.layout import total_size
from ptt.effects.memory import gradual_reversal, leave, play
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
from ptt.mechanisms.statics import GRAVITY
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.chain import differentiate, predict
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

RADIUS, SMALL, LINK, HOME = 200.0, 100.0, 300.0, np.sqrt(300.0**2 - 100.0**2)
AZIMUTH = np.radians([0.0, 120.0, 240.0])
OUTWARD = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH), np.zeros(3)], axis=1)
TANGENT = np.stack([-np.sin(AZIMUTH), np.cos(AZIMUTH), np.zeros(3)], axis=1)
POSES = np.array([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [-40.0, 55.0, 30.0], [25.0, -50.0, -45.0]])
THREE_PTT = [name for name, cls in library().items() if "three-ptt" in cls.mechanisms]


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


def test_play_on_a_hand_sequence(bench):
    command = [280.0, 281.0, 280.96, 280.88, 281.0, 281.0, 281.02]
    view = build_view(bench, make_table(None, heights(*command)))
    expected = [-0.05, -0.05, -0.01, 0.05, -0.05, -0.05, -0.05]  # arrives as the second moves; 0.04 back, then 0.12
    assert_close(
        library()["backlash"]().shift(tensor([0.1, 0.1, 0.1, 1.0]), view)[:, 1], tensor(expected), atol=1e-12, rtol=0.0
    )


def test_play_begins_anew_with_each_run(bench):
    view = build_view(bench, make_table(None, heights(280, 281, 290, 289, 288), run=np.array([0, 0, 1, 1, 1])))
    expected = [-0.05, -0.05, 0.05, 0.05, 0.05]
    assert_close(
        library()["backlash"]().shift(tensor([0.1, 0.1, 0.1, 1.0]), view)[:, 0], tensor(expected), atol=1e-12, rtol=0.0
    )


@settings(deadline=None, max_examples=40)
@given(st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=40), st.floats(0.0, 0.3), st.floats(0.05, 3.0), st.data())
def test_state_handed_on_gives_the_whole_run(steps, gap, length, data):
    view = build_view(parse_machine(MACHINE), make_table(None, heights(*(280.0 + np.cumsum(steps)))))
    cut = data.draw(st.integers(1, len(steps) - 1))
    late = view.of_rows(torch.arange(cut, len(steps)))
    late = replace(late, entries=(leave(view.of_rows(torch.arange(cut)), 0),))
    gaps, lengths = tensor([gap] * 3), tensor([length] * 3)
    assert_close(play(late, gaps), play(view, gaps)[cut:], atol=1e-10, rtol=0.0)
    assert_close(gradual_reversal(late, lengths), gradual_reversal(view, lengths)[cut:], atol=1e-10, rtol=0.0)


MACHINE = """
[machine]
kind = "three-ptt"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
"""


def test_a_gap_below_zero_throws_the_slider_ahead_at_once(bench):
    view = build_view(bench, make_table(None, heights(280.0, 281.0, 280.96, 280.88, 281.0, 281.0)))
    shift = library()["backlash"]().shift(tensor([-0.1, 0.1, 0.0, 1.0]), view)
    assert_close(shift[:, 0], tensor([0.05, 0.05, -0.05, -0.05, 0.05, 0.05]), atol=1e-12, rtol=0.0)
    assert_close(shift[:3, 1], tensor([-0.05, -0.05, -0.01]), atol=1e-12, rtol=0.0)
    assert shift[:, 2].abs().max() == 0.0
    _, slope = differentiate(library()["backlash"](), tensor([0.0, 0.0, 0.0, 1.0]), view)
    assert_close(slope[:, 0, 0], -0.5 * view.direction[:, 0])  # the same from both sides


def test_slip_begins_after_its_moment(bench):
    view = build_view(bench, make_table(POSES, time_s=[0.0, 100.0, 200.0, 400.0]))
    shift = library()["homing-slip"]().shift(tensor([0.1, 0.0, -0.05, 100.0]), view)
    assert_close(shift, tensor(np.array([0, 0, 1, 1])[:, None] * np.array([0.1, 0.0, -0.05])))
    blind = build_view(bench, make_table(POSES))
    shift = library()["homing-slip"]().shift(tensor([0.1, 0.0, -0.05, 2.0]), blind)
    assert_close(shift[:, 0], tensor([0.0, 0.0, 0.0, 0.1]))


def test_slip_and_knock_try_the_same_moments():
    view = sample_view("three-ptt")
    slip, knock = library()["homing-slip"](), library()["setup-jump"]()
    moments = [float(trial["after"]) for trial in slip.search(view)]
    assert moments == [float(trial["after"]) for trial in knock.search(view)]
    inner = [float(trial["after"]) for trial in slip.refine(view, slip.search(view)[20])]
    assert inner == sorted(set(view.time[(view.time >= moments[18]) & (view.time <= moments[22])].tolist()))


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


def test_a_straight_drift_stays_straight():
    view, effect = sample_view("three-ptt"), library()["tracker-drift"]()
    straight = effect.search(view)[0]
    assert [float(trial["settling"]) for trial in effect.refine(view, straight)] == [float(straight["settling"])]


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


def test_windup_turns_over_with_travel(bench):
    view = build_view(bench, make_table(None, heights(240, 320, 317, 316, 319)))
    at_317 = -1.0 + 2.0 * np.exp(-3.0 / 2.0)
    at_316 = -1.0 + (1.0 + at_317) * np.exp(-1.0 / 2.0)
    at_319 = 1.0 - (1.0 - at_316) * np.exp(-3.0 / 2.0)
    friction = np.array([1.0, 1.0, at_317, at_316, at_319])
    shift = library()["windup"]().shift(tensor([0.01, 0.01, 0.01, 9.0, 9.0, 2.0]), view)
    assert_close(shift[:, 2], tensor(-0.01 * friction), atol=1e-12, rtol=0.0)


def test_windup_is_tried_over_lengths_that_rows_near_a_reversal_show(bench):
    near = build_view(bench, make_table(None, heights(300, 302, 302.1, 301.9, 301, 299, 298.9, 299.1)))
    far = build_view(bench, make_table(None, heights(240, 320, 250, 310, 260)))
    short, long = ([float(trial["length"][0]) for trial in library()["windup"]().search(view)] for view in (near, far))
    assert short[0] == pytest.approx(2.0) and min(short) < 0.1
    assert min(long) > 5.0 and long[0] == min(long) and max(long) == max(short)  # next to the usual


def test_following_error_is_velocity_times_lag(bench):
    table = make_table(None, heights(280, 290, 300, 290, 280), feed_mm_s=20.0)
    shift = library()["following-error"]().shift(tensor([0.03, 0.0, 0.01, 0.0]), build_view(bench, table))
    expected = np.array([-0.6, -0.6, -0.6, 0.6, 0.6])  # 20 mm/s up, still so where it turns, 20 mm/s down
    assert_close(shift, tensor(np.stack([expected, 0.0 * expected, expected / 3.0], axis=1)), atol=1e-9, rtol=0.0)


def test_a_corner_after_a_move_as_short_as_the_lag_is_rounded_off(bench):
    table = make_table(None, heights(280, 280.5, 281, 280.5, 280), feed_mm_s=20.0)
    shift = library()["following-error"]().shift(tensor([0.03, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.6, -0.6, 0.0, 0.6, 0.6]), atol=1e-9, rtol=0.0)


def test_a_feed_is_that_of_its_row_however_short_the_move(bench):
    table = make_table(None, heights(280, 281, 282, 283), feed_mm_s=[20.0, 20.0, 10.0, 30.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.2, -0.2, -0.1, -0.3]), atol=1e-9, rtol=0.0)


def test_a_clock_tells_no_corner_where_a_way_goes_on_faster(bench):
    table = make_table(None, heights(280, 290, 305, 327.5), time_s=[0.0, 1.0, 2.0, 3.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.1, -0.125, -0.1875, -0.225]), atol=1e-9, rtol=0.0)


@pytest.mark.parametrize(
    ("pace", "expected"),
    [(0, [10.0, 10.0, 20.0, -20.0]), (1, [10.0, 50.0 / 3.0, 20.0 / 3.0, -20.0]), (2, [10.0, 10.0, 20.0, -20.0])],
)
def test_a_row_may_mean_the_speed_of_the_move_there_or_of_both_sides(bench, pace, expected):
    table = make_table(None, heights(280, 290, 300, 280), feed_mm_s=[10.0, 10.0, 20.0, 20.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, pace]), build_view(bench, table))
    assert_close(shift[:, 0], -0.01 * tensor(expected), atol=1e-9, rtol=0.0)


def test_a_row_read_at_standstill_does_not_know_that_it_will_move(bench):
    table = make_table(None, heights(280, 290, 290, 300, 310), time_s=[0.0, 1.0, 4.0, 5.0, 6.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.1, -0.1, 0.0, -0.1, -0.1]), atol=1e-9, rtol=0.0)


@pytest.mark.parametrize(
    ("label", "period"), [("", 5.0), ("harmonic 2", 2.5), ("harmonic 0", 5.0), ("second screw", 5.0)]
)
def test_once_per_rev_and_its_harmonics(bench, label, period):
    view = build_view(bench, make_table(None, heights(280.0, 281.3, 283.9, 287.77)))
    effect = library()["once-per-rev"](label)
    assert effect.search(view)[0]["period"].tolist() == [period]
    theta = [0.01, 0.02, 0.0, 0.003, 0.0, -0.001, *effect.search(view)[0]["period"].tolist()]
    phase = 2.0 * np.pi * view.q.numpy() / period
    expected = np.array([0.01, 0.02, 0.0]) * np.cos(phase) + np.array([0.003, 0.0, -0.001]) * np.sin(phase)
    assert_close(effect.shift(tensor(theta), view), tensor(expected))


def test_once_per_rev_says_when_all_heights_are_whole_leads(bench):
    effect = library()["once-per-rev"]()
    assert "commensurate" in effect.needs(build_view(bench, make_table(None, heights(*range(260, 310, 5)))))
    assert effect.needs(build_view(bench, make_table(None, heights(*np.arange(260, 310, 3.7))))) is None


def test_screw_growth(bench):
    view = build_view(bench, make_table(POSES, temp_c=[20.0, 30.0, 25.0, 15.0]))
    shift = library()["screw-growth"]().shift(tensor([1.1e-5] * 3 + [2e-3] * 3), view)
    warmth = np.array([0.0, 10.0, 5.0, -5.0])[:, None]
    assert_close(shift, tensor(warmth * (1.1e-5 * (view.q.numpy() - HOME) + 2e-3)))


def test_frame_growth_is_a_bigger_machine(bench):
    view, share = build_view(bench, make_table(POSES, temp_c=[20.0, 30.0, 30.0, 30.0])), np.array([2.3e-5, 1.1e-5])
    spec = bench.machine
    update = {"base_radius_mm": RADIUS * (1 + 10 * share[0]), "link_length_mm": LINK * (1 + 10 * share[1])}
    warm = ThreePtt.from_spec(spec.model_copy(update=update)).forward(view.q) - view.p
    shift = shift_of("frame-growth", share, view)
    assert_close(shift[1:], warm[1:], rtol=0.0, atol=1e-10)
    assert shift[0].abs().max() == 0.0


def test_link_force_is_what_holds_the_sliders(bench):
    view = build_view(bench, make_table(np.vstack([POSES, [-70.0, 0.0, 0.0]]), payload_kg=2.0))
    weight = -GRAVITY * 3.0  # 2 kg and the platform's 1 kg
    slider = weight * view.jacobian[:, 2, :].numpy()  # virtual work of a vertical force
    reach = jacobian_by_hand(view.p.numpy())[1]
    steep = np.sqrt(LINK**2 - (reach**2).sum(axis=-1)) / LINK
    assert_close(pull(view), tensor(-slider / steep))
    assert (pull(view)[0] > 0).all()  # the platform hangs
    assert pull(view)[4, 0] < 0  # beyond the triangle's edge at x = -50 the leg opposite is pushed


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


@pytest.mark.parametrize("reflector", [(0.0, 0.0, 0.0), (30.0, -20.0, -50.0)])
@pytest.mark.parametrize("pose", POSES.tolist())
def test_platform_twist_against_six_equations(bench, reflector, pose):
    spec = bench.machine.model_copy(update={"reflector_mm": reflector})
    view = build_view(type(bench)(spec), make_table([pose]))
    theta = 1e-6 * np.array([1.0, -0.4, 0.3, 0.8, -0.2, 0.6])
    skewed = TANGENT + theta[:3, None] * OUTWARD + theta[3:, None] * np.array([0.0, 0.0, 1.0])
    sliders = RADIUS * OUTWARD + view.q[0].numpy()[:, None] * np.array([0.0, 0.0, 1.0])

    def closure(x):
        turn = np.eye(3) + np.cross(np.eye(3), x[3:])  # (1 + [w x]) to first order
        links = x[:3] + SMALL * OUTWARD @ turn.T - sliders
        lengths = (links**2).sum(axis=1) - LINK**2
        return np.concatenate([lengths / LINK, (links * np.cross(TANGENT, skewed @ turn.T)).sum(axis=1)])

    start = np.concatenate([pose, np.zeros(3)])
    found = root(closure, start, tol=1e-13).x
    assert np.abs(closure(found)).max() < 1e-10
    moved = found[:3] - np.array(pose) + np.cross(found[3:], reflector)
    assert np.abs(moved).max() > 1e-5
    assert_close(shift_of("platform-twist", theta, view)[0], tensor(moved), rtol=1e-4, atol=1e-9)


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


OLD_HEIGHTS = (0.31, 0.05, -0.12, 0.02, 0.01, -0.03)
OLD_CURVE = f"""
[[effect]]
name = "screw-error-map"
[effect.parameters]
curve_mm = {{ value = {list(OLD_HEIGHTS) * 3}, std = {[0.001] * 18} }}
straight_mm = {{ value = [0.001, 0.002, 0.001, 0.002, 0.001, 0.002] }}
from_mm = {{ value = 250.0 }}
to_mm = {{ value = 310.0 }}
"""


def test_a_curve_of_an_older_file_is_the_same_curve():
    model = read_model(parse_machine(f"{MACHINE}\n{OLD_CURVE}", "old.toml"))
    view = build_view(model.file, make_table(None, heights(*np.linspace(245.0, 315.0, 41))))
    knots = np.linspace(-1.0, 1.0, 9)
    shapes = []
    for degree in range(2, 8):  # orthogonal to all lower degrees on the knots, one high, as those files state
        lower = np.polynomial.legendre.legvander(knots, degree)
        last = lower[:, degree] - lower[:, :degree] @ np.linalg.lstsq(lower[:, :degree], lower[:, degree])[0]
        shapes.append(last / np.abs(last).max())
    place = np.clip((view.q[:, 0].numpy() - 280.0) / 30.0, -1.0, 1.0)
    bow = CubicSpline(knots, np.array(OLD_HEIGHTS) @ np.array(shapes), bc_type="natural")(place)
    found = model.terms[0].effect.shift(model.terms[0].theta, view)
    assert_close(found[:, 0], tensor(bow + 0.001 * place + 0.002), atol=1e-12, rtol=0.0)
    assert_close(found[:, 2], found[:, 0])


def test_a_curve_of_no_known_form_is_refused():
    text = OLD_CURVE.replace(str(list(OLD_HEIGHTS) * 3), str(list(OLD_HEIGHTS))).replace(str([0.001] * 18), "0.001")
    with pytest.raises(ModelError, match=r"'curve_mm' has 6 values; give one, or 45"):
        read_model(parse_machine(f"{MACHINE}\n{text}", "old.toml"))


def model_of(bench, *names):
    model = Model(bench)
    for name in names:
        model = model + library()[name]()
    return model


def test_order_of_adding_does_not_matter(bench):
    names = ["setup-jump", "backlash", "link-length", "column-bend", "homing-offset"]
    assert model_of(bench, *names).keys == model_of(bench, *reversed(names)).keys
    assert model_of(bench, *names).keys == ("backlash", "homing-offset", "link-length", "column-bend", "setup-jump")


def test_the_same_twice_is_refused_and_two_of_a_kind_are_not(bench):
    with pytest.raises(ModelError, match="in the model already"):
        model_of(bench, "backlash", "backlash")
    knock = library()["setup-jump"]
    model = Model(bench) + knock("first") + knock("second")
    assert model.keys == ("setup-jump[first]", "setup-jump[second]")
    assert model.without("setup-jump[first]").keys == ("setup-jump[second]",)


def test_two_knocks_add_up(bench):
    view = build_view(bench, make_table(POSES, time_s=[0.0, 100.0, 200.0, 300.0]))
    knock, still = library()["setup-jump"], [0.0, 0.0, 0.0]
    terms = [(knock("a"), tensor([0.1, 0, 0, *still, 50.0])), (knock("b"), tensor([0, 0.2, 0, *still, 250.0]))]
    expected = [[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0], [0.1, 0.2, 0]]
    assert_close(predict(terms, view).reading - view.p, tensor(expected), atol=1e-12, rtol=0.0)


def test_effects_sum_to_the_whole_in_any_order():
    view = sample_view("three-ptt")
    cases = [make_case(library()[name](), "three-ptt", differentiate) for name in THREE_PTT]
    terms = [(case.effect, case.theta * 1e-3) for case in cases]
    whole = predict(terms, view).reading - view.p
    alone = [predict([term], view).reading - view.p for term in terms]
    assert_close(sum(alone), whole, rtol=0.0, atol=1e-5 * float(whole.abs().max()))
    shuffled = predict(terms[::-1], view)
    assert_close(shuffled.reading - view.p, whole, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", THREE_PTT)
def test_zero_amplitudes_read_nominal(name):
    view, effect = sample_view("three-ptt"), library()[name]()
    shape = effect.search(view)[0]
    theta = usual_theta(effect, "three-ptt", view, shape) * 0.0
    start = total_size(effect, 3) - sum(len(torch.as_tensor(value)) for value in shape.values())
    if shape:
        theta[start:] = torch.cat([torch.as_tensor(shape[p.stem]) for p in effect.parameters if p.role != "linear"])
    assert_close(predict([(effect, theta)], view).reading, view.p, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[effect]]\nname = "backlsh"', "did you mean 'backlash'"),
        ('[[effect]]\nname = "backlash"\n[[effect]]\nname = "backlash"', "in the model already"),
        ('[[effect]]\nname = "backlash"\n[effect.parameters]\ngap = { value = 0.1 }', "it has: gap_mm"),
        (
            '[[effect]]\nname = "backlash"\n[effect.parameters]\ngap_mm = { value = [0.1, 0.2] }',
            "has 2 values; give one, or 3",
        ),
        ('[[effect]]\nname = "windup"\n[effect.parameters]\nheight_mm = { value = 0.1 }', "'length_mm' is missing"),
        (
            '[[effect]]\nname = "windup"\n[effect.parameters]\nheight_mm = { value = 0.1 }\n'
            "length_mm = { value = [1, 2] }",
            "'length_mm' has 2 values; give one, or 3",
        ),
    ],
)
def test_a_machine_file_with_a_wrong_effect_is_refused(text, said):
    with pytest.raises(ModelError, match=r"\[\[effect\]\]") as caught:
        read_model(parse_machine(f"{MACHINE}\n{text}", "bad.toml"))
    assert said in str(caught.value) and "or 1" not in str(caught.value)
    assert str(caught.value).startswith("bad.toml")
