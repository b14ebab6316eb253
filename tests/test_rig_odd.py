"""Faults outside the library: each by its own closed form, random laws by what they may and may not depend on."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from sweep_judge import leads_of
from test_rig_bench import MEASURED, bench, link_parts, slider_space, table, truth, volume

from ptt.challenge.hide import FAULTS, clear_faults, hide_faults
from ptt.challenge.truth import find_truth
from ptt.effects import library
from ptt.errors import InputError
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.draw_unseen import ALWAYS, BESIDES, describable
from ptt.rig.nominal import ideal_machine
from ptt.rig.odd_law import random_law, variable
from ptt.rig.odd_schema import RandomLaw, Variable
from ptt.rig.odd_state import SliderState

POSES = volume(80)
COMMAND = ["b1_cmd", "b2_cmd", "b3_cmd"]
ODD = [fault for fault in FAULTS.values() if fault.section == "odd"]
ZIGZAG = np.array([250.0, 280.0, 300.0, 290.0, 260.0, 255.0, 300.0, 240.0])


def level(heights: np.ndarray, odd: dict, **sections: object):
    """A run with all sliders at the same height."""
    sent = pd.DataFrame(np.repeat(heights[:, None], 3, axis=1), columns=COMMAND)
    return simulate(bench(odd=[odd], **sections), sent, noise=False)


def along(heights: np.ndarray, odd: dict, **sections: object) -> np.ndarray:
    """(n, 3) mm, tool errors of such a run seen as slider errors."""
    error = level(heights, odd, **sections).truth - level(heights, odd | {"size_um": 0.0}, **sections).truth
    q, w = link_parts(np.zeros((1, 3)))
    jacobian = np.concatenate([q / w[..., None], np.ones((1, 3, 1))], axis=-1)[0]
    return error @ jacobian.T


# --- by hand -------------------------------------------------------------------------------------------------------


def test_a_crossbeam_sags_under_the_other_slider() -> None:
    odd = {"kind": "cross-coupling", "leg": 2, "other": 3, "height_mm": 280.0, "span_mm": 50.0, "size_um": 30.0}
    sent = simulate(bench(), table(POSES), noise=False).frame[COMMAND].to_numpy()
    want = np.zeros_like(POSES)
    want[:, 1] = -0.030 * ((sent[:, 2] - 280.0) / 50.0) ** 2
    np.testing.assert_allclose(slider_space(bench(odd=[odd]), POSES), want, atol=1e-4)


def test_a_cable_chain_drags_against_the_travel() -> None:
    odd = {"kind": "cable-drag", "leg": 1, "low_mm": 240.0, "high_mm": 300.0, "size_um": 40.0}
    up = np.array([1, 1, 1, -1, -1, -1, 1, -1])
    got = along(ZIGZAG, odd)
    np.testing.assert_allclose(got[1:, 0], (-0.040 * (ZIGZAG - 240.0) / 60.0 * up)[1:], atol=2e-5)
    np.testing.assert_allclose(got[:, 1:], 0.0, atol=2e-5)


def test_a_nut_that_the_payload_loosens() -> None:
    odd = {"kind": "load-backlash", "leg": 3, "gap_um_per_kg": 10.0, "opens_at_kg": 1.0}
    loose = level(ZIGZAG, odd, conditions={"payload_kg": 4.0}).slider_actual[:, 2]
    tight = level(ZIGZAG, odd, conditions={"payload_kg": 1.0}).slider_actual[:, 2]
    np.testing.assert_allclose((loose - tight)[1:], -0.015 * np.array([1, 1, -1, -1, -1, 1, -1]), atol=1e-12)
    np.testing.assert_allclose(tight, ZIGZAG, atol=1e-12)


def test_a_joint_that_rattles_across() -> None:
    """Leg 1 lies on x: its link is longer where y is positive, slider error dL L / w."""
    got = slider_space(bench(odd=[{"kind": "loose-joint", "leg": 1, "size_um": 24.0}]), POSES)
    _, w = link_parts(POSES)
    np.testing.assert_allclose(got[:, 0], 0.012 * np.sign(POSES[:, 1]) * 300.0 / w[:, 0], atol=3e-5)
    np.testing.assert_allclose(got[:, 1:], 0.0, atol=3e-5)


def test_a_table_tilts_about_its_pivot_towards_the_load() -> None:
    odd = {"kind": "settling-table", "urad_per_kg_mm": 0.1, "moving_kg": 8.0, "pivot_mm": 400.0}
    rig = bench(odd=[odd], conditions={"payload_kg": 2.0})
    moved = truth(rig, POSES) - POSES
    tilt = 1e-6 * 0.1 * 10.0 * POSES[:, :2]
    vector = np.column_stack([-tilt[:, 1], tilt[:, 0], np.zeros(len(POSES))])  # towards +x is about +y
    lever = POSES + np.array([0.0, 0.0, 400.0])
    np.testing.assert_allclose(moved, Rotation.from_rotvec(vector).apply(lever) - lever, atol=2e-6)
    assert np.abs(moved).max() > 0.01


@pytest.mark.parametrize("direction", ["radial", "tangential"])
def test_a_clamp_yields_above_a_height(direction: str) -> None:
    """The slider's way sideways is a slider error q . way / w, with the opposite sign of the link's."""
    odd = {"kind": "loose-clamp", "leg": 2, "height_mm": 280.0, "um_per_mm": 1.5, "direction": direction}
    sent = simulate(bench(), table(POSES), noise=False).frame[COMMAND].to_numpy()
    angle = np.radians(120.0 if direction == "radial" else 210.0)
    q, w = link_parts(POSES)
    way = -(q[:, 1] @ [np.cos(angle), np.sin(angle)]) / -w[:, 1]
    want = 0.0015 * np.maximum(sent[:, 1] - 280.0, 0.0) * way
    np.testing.assert_allclose(slider_space(bench(odd=[odd]), POSES)[:, 1], want, atol=2e-5)


def test_a_motor_keeps_its_heat() -> None:
    heights = 280.0 + 20.0 * (np.arange(60) % 2)
    odd = {"kind": "motor-heat", "leg": 1, "um_s_per_mm": 12.0, "constant_s": 90.0}
    run = level(heights, odd, conditions={"dwell_s": 9.5, "feed_mm_s": 40.0})
    sound = level(heights, odd | {"um_s_per_mm": 0.0}, conditions={"dwell_s": 9.5, "feed_mm_s": 40.0})
    q, w = link_parts(np.zeros((1, 3)))
    got = (run.truth - sound.truth) @ np.append(q[0, 0] / w[0, 0], 1.0)
    time = run.frame["time_s"].to_numpy() - run.frame["time_s"].iloc[0]
    step = time[1]
    np.testing.assert_allclose(np.diff(time), step)
    want = 0.012 * 20.0 / step * -np.expm1(-time / 90.0)
    np.testing.assert_allclose(got, want, atol=2e-4 * want.max() + 2e-5)


def test_an_encoder_repeats_with_its_pitch() -> None:
    odd = {"kind": "scale-pitch", "leg": 3, "pitch_mm": 1.3, "size_um": 9.0, "phase": 0.2}
    heights = np.linspace(240.0, 300.0, 173)
    got = along(heights, odd)[:, 2]
    want = 0.009 * 2.0 * (np.modf(heights / 1.3 + 0.2)[0] - 0.5)
    np.testing.assert_allclose(got, want, atol=1e-5)


def test_short_steps_stick() -> None:
    odd = {"kind": "stick-slip", "leg": 1, "size_um": 50.0, "step_mm": 8.0}
    step = np.diff(ZIGZAG)
    np.testing.assert_allclose(
        along(ZIGZAG, odd)[1:, 0], -0.050 * np.sign(step) * np.exp(-np.abs(step) / 8.0), atol=2e-5
    )


def test_a_coupling_slips_at_every_reversal() -> None:
    odd = {"kind": "slipping-coupling", "leg": 2, "um_per_reversal": 5.0}
    sound = level(ZIGZAG, odd | {"um_per_reversal": 0.0}).truth
    q, w = link_parts(np.zeros((1, 3)))
    got = (level(ZIGZAG, odd).truth - sound) @ np.append(q[0, 1] / w[0, 1], 1.0)
    np.testing.assert_allclose(got, -0.005 * np.array([0, 0, 0, 1, 1, 1, 2, 3]), atol=1e-5)


def test_a_carriage_tips_over_on_reversal() -> None:
    odd = {"kind": "carriage-tip", "leg": 1, "size_um": 60.0, "direction": "radial"}
    lever = 100.0 / np.sqrt(300.0**2 - 100.0**2)  # of the slider's way outwards on the slider's height
    want = 0.030 * lever * np.array([1, 1, -1, -1, -1, 1, -1])
    np.testing.assert_allclose(along(ZIGZAG, odd)[1:, 0], want, atol=2e-5)


# --- random laws ---------------------------------------------------------------------------------------------------


def law(**changes) -> RandomLaw:
    usual = {
        "kind": "random-law",
        "place": "along",
        "leg": 2,
        "form": "smooth",
        "variables": ["b1", "direction3"],
        "span": [[230.0, 330.0], [-1.0, 1.0]],
        "size_um": 20.0,
        "law_seed": 5,
    }
    return RandomLaw.model_validate(usual | changes)


def anywhere(rows: int, seed: int = 0) -> SliderState:
    """A run whose variables fill their spans, one by one."""
    random = np.random.default_rng(seed)
    return SliderState(
        drawing=ideal_machine(bench().spec),
        joint=random.uniform(230.0, 330.0, (rows, 3)),
        tool=random.uniform(-60.0, 60.0, (rows, 3)),
        direction=random.choice([-1.0, 1.0], (rows, 3)),
        step=random.uniform(0.0, 50.0, (rows, 3)),
        reversals=np.cumsum(random.integers(0, 2, (rows, 3)), axis=0).astype(float),
        speed=random.uniform(-40.0, 40.0, (rows, 3)),
        payload=random.uniform(0.0, 6.0, rows),
        platform=1.0,
        temperature=random.uniform(20.0, 28.0, rows),
        time=np.sort(random.uniform(0.0, 5000.0, rows)),
    )


@pytest.mark.parametrize("form", ["smooth", "jumpy", "periodic"])
def test_a_law_is_of_unit_size_and_repeats(form: str) -> None:
    state = anywhere(20000)
    for seed in range(8):
        value = random_law(law(form=form, law_seed=seed), state)
        assert abs(value.mean()) < 0.075 and value.std() == pytest.approx(1.0, rel=0.08)
        np.testing.assert_array_equal(value, random_law(law(form=form, law_seed=seed), state))
    assert not np.allclose(value, random_law(law(form=form, law_seed=99), state))
    assert (len(np.unique(np.round(value, 9))) < 17) == (form == "jumpy")


def test_a_law_depends_on_its_variables_and_on_no_other() -> None:
    one, two = anywhere(500, 1), anywhere(500, 2)
    same = replace(two, joint=np.column_stack([one.joint[:, 0], two.joint[:, 1:]]), direction=one.direction)
    for form in ("smooth", "jumpy"):
        np.testing.assert_array_equal(random_law(law(form=form), one), random_law(law(form=form), same))
        assert not np.allclose(random_law(law(form=form), one), random_law(law(form=form), two))
    smooth = law(variables=["x"], span=[[-60.0, 60.0]])
    near = replace(one, tool=one.tool + 0.01)
    assert np.abs(random_law(smooth, near) - random_law(smooth, one)).max() < 0.0025


def test_every_variable_has_a_value() -> None:
    state = anywhere(50)
    for name in Variable.__args__:
        values = variable(name, state)
        assert values.shape == (50,) and np.isfinite(values).all() and values.std() > 0.0, name
    warm, late = variable("temperature", state), variable("memory", state, 1e6)
    assert np.ptp(late) < 0.05 * np.ptp(warm)
    np.testing.assert_allclose(variable("memory", state, 1e-6)[1:], warm[1:], atol=1e-9)


@pytest.mark.parametrize("place", ["along", "radial", "tangential", "link", "tool-y", "sight-z"])
def test_a_law_acts_where_it_says(place: str) -> None:
    leg = None if "-" in place else 2
    fault = law(place=place, leg=leg, variables=["x", "z"], span=[[-60, 60], [-50, 50]]).model_dump(exclude_none=True)
    run = simulate(bench(odd=[fault]), table(POSES), noise=False)
    error = run.truth - POSES
    seen = run.frame[MEASURED].to_numpy() - POSES
    if leg:
        slides = slider_space(bench(odd=[fault]), POSES)
        assert np.abs(slides[:, 1]).max() > 0.002
        np.testing.assert_allclose(slides[:, [0, 2]], 0.0, atol=2e-5)
        np.testing.assert_allclose(seen, error, atol=1e-9)
    else:
        axis = "xyz".index(place[-1])
        others = [number for number in range(3) if number != axis]
        assert np.abs(seen[:, axis]).max() > 0.01 and np.abs(seen[:, others]).max() < 1e-9
        np.testing.assert_allclose(error, seen if place.startswith("tool") else 0.0, atol=1e-9)


def test_bad_laws_are_refused() -> None:
    fine = law().model_dump(exclude_none=True)
    for changes, message in (({"leg": None}, "leg"), ({"span": [[0.0, 1.0]]}, "span"), ({"place": "tool-x"}, "leg")):
        broken = {key: value for key, value in (fine | changes).items() if value is not None}
        with pytest.raises(InputError, match=message):
            bench(odd=[broken])


def test_what_the_library_describes_is_no_unknown_law() -> None:
    assert describable("along", 1, "smooth", ["b1"]) and not describable("along", 1, "jumpy", ["b1"])
    assert describable("along", 1, "smooth", ["direction1"]) and not describable("along", 1, "smooth", ["direction2"])
    assert describable("radial", 2, "smooth", ["b2"]) and not describable("radial", 2, "smooth", ["direction2"])
    assert describable("tool-x", None, "jumpy", ["time"]) and describable("link", 1, "smooth", ["payload", "time"])
    assert not describable("tool-x", None, "jumpy", ["time", "x"])


# --- as they are drawn ---------------------------------------------------------------------------------------------


def test_there_are_enough_kinds_and_many_are_kept_unseen() -> None:
    laws = [fault for fault in ODD if fault.name.startswith("random-")]
    assert len(ODD) >= 20 and len(laws) >= 10 and all(fault.unseen for fault in laws)
    assert {fault.unseen for fault in ODD if fault not in laws} == {True, False}
    assert {"scale-splice", "guide-damage", "roller-period", "hose", "warm-backlash"} <= {
        fault.name for fault in ODD if not fault.unseen
    }


@pytest.mark.parametrize("fault", ODD, ids=lambda fault: fault.name)
def test_odd_faults_can_be_hidden_seen_written_and_taken_out(fault) -> None:
    for seed, protocol in enumerate(fault.protocols):
        sound = draw_foreign(seed, protocol, rows=150, noise="white")
        drawn = hide_faults(sound, [fault.name], seed)
        assert hide_faults(sound, [fault.name], seed).rig == drawn.rig
        assert parse_rig(format_rig(drawn.rig)) == drawn.rig
        assert clear_faults(drawn.rig, drawn.truth, [fault.name]) == sound.rig
        (hidden,) = find_truth(drawn, library()).faults
        assert hidden.size > 1e-4 and not hidden.known
        leads = set(leads_of(drawn.truth[fault.name]))
        allowed = {*ALWAYS, *(name for names in BESIDES.values() for name in names)}
        assert leads and leads <= allowed


def test_laws_of_all_protocols_use_what_varies_there() -> None:
    for protocol, special in BESIDES.items():
        found = set()
        for seed in range(60):
            sound = draw_foreign(seed, protocol, rows=30, noise="white")
            values = hide_faults(sound, ["random-slider-smooth"], seed).truth["random-slider-smooth"]
            found |= set(values["variables"])
        assert found >= set(special) and not found & {v for p, v in BESIDES.items() if p != protocol for v in v}
