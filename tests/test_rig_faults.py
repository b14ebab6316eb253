"""Faults beside those of the sample data: lost zeros, soft links, controllers that take out too much."""

import numpy as np
import pandas as pd
import pytest
from test_rig_bench import bench, link_parts, slider_space, table, truth, volume

from ptt.challenge.hide import FAULTS, clear_faults, hide_faults
from ptt.challenge.truth import find_truth
from ptt.effects import library
from ptt.errors import InputError
from ptt.rig import simulate
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.motion import travel_direction

POSES = volume(60)
WEIGHT = 9.80665
COMMAND = ["b1_cmd", "b2_cmd", "b3_cmd"]


def test_a_slip_is_a_homing_error_from_its_row_on() -> None:
    slipped = truth(bench(drive={"slip_mm": [0.0, 0.3, 0.0], "slip_row": 25}), POSES)
    homed = truth(bench(drive={"homing_mm": [0.0, 0.3, 0.0]}), POSES)
    np.testing.assert_allclose(slipped[:25], POSES[:25], atol=1e-9)
    np.testing.assert_allclose(slipped[25:], homed[25:], atol=1e-12)


def test_a_slip_at_a_time() -> None:
    time = simulate(bench(), table(POSES), noise=False).frame["time_s"].to_numpy()
    moment = float(time[30] - time[0])
    by_time = bench(drive={"slip_mm": [0.1, 0.0, 0.0], "slip_time_s": moment})
    by_row = bench(drive={"slip_mm": [0.1, 0.0, 0.0], "slip_row": 30})
    np.testing.assert_array_equal(truth(by_time, POSES), truth(by_row, POSES))
    with pytest.raises(InputError, match="slip_row and slip_time_s"):
        bench(drive={"slip_row": 3, "slip_time_s": 5.0})


@pytest.mark.parametrize("sliders", ["above", "below"])
def test_soft_links_let_the_platform_sink(sliders: str) -> None:
    """In the middle every link carries m g L / (3 w), grows by c times that, and dz = dL L / w: down either way."""
    machine = {"sliders": sliders}
    if sliders == "below":
        machine |= {"slider_travel_mm": [-420.0, -150.0]}
    rig = bench(machine, geometry={"link_compliance_um_per_n": 0.4}, conditions={"payload_kg": 3.0})
    middle = np.zeros((1, 3))
    tension = 3.0 * WEIGHT / 3.0 * 300.0 / np.sqrt(300.0**2 - 100.0**2)
    sink = 0.4e-3 * tension * 300.0 / np.sqrt(300.0**2 - 100.0**2)
    np.testing.assert_allclose(truth(rig, middle), [[0.0, 0.0, -sink]], atol=2e-6)


def test_one_soft_link_is_a_longer_link() -> None:
    """Slider space: dL L / w of that leg alone, dL = c N, and N from three balances of force."""
    rig = bench(geometry={"link_compliance_um_per_n": [0.0, 0.3, 0.0]}, conditions={"payload_kg": 4.0})
    q, w = link_parts(POSES)
    unit = np.concatenate([q, w[..., None]], axis=-1) / 300.0
    pull = np.linalg.solve(np.swapaxes(unit, 1, 2), np.tile([0.0, 0.0, -4.0 * WEIGHT], (len(POSES), 1))[..., None])
    want = np.zeros_like(POSES)
    want[:, 1] = (0.3e-3 * pull[..., 0] * 300.0 / w[..., :])[:, 1]
    np.testing.assert_allclose(slider_space(rig, POSES), want, atol=3e-6)
    assert np.abs(want).max() > 0.004


def test_no_load_no_give() -> None:
    rig = bench(geometry={"link_compliance_um_per_n": 0.5})
    np.testing.assert_allclose(truth(rig, POSES), POSES, atol=1e-9)


def test_a_controller_that_takes_out_too_much_overshoots() -> None:
    rig = bench(controller={"backlash_mm": [0.05, 0.0, 0.0]})
    sent = simulate(bench(), table(POSES), noise=False).frame[COMMAND].to_numpy()
    run = simulate(rig, table(POSES), noise=False)
    ahead = (run.slider_actual - sent)[1:]
    np.testing.assert_allclose(ahead[:, 0], 0.025 * travel_direction(sent)[1:, 0], atol=1e-12)
    np.testing.assert_allclose(ahead[:, 1:], 0.0, atol=1e-12)


def test_half_the_play_taken_out_leaves_half_the_play() -> None:
    far = pd.DataFrame(np.repeat(np.array([280.0, 300.0, 260.0, 310.0, 240.0])[:, None], 3, axis=1), columns=COMMAND)
    both = bench(drive={"backlash_mm": 0.08}, controller={"backlash_mm": 0.05})
    less = bench(drive={"backlash_mm": 0.03})
    places = [simulate(rig, far, noise=False).slider_actual for rig in (both, less)]
    np.testing.assert_allclose(places[0][1:], places[1][1:], atol=1e-12)


@pytest.mark.parametrize(
    "name", ["homing-slip", "link-compliance", "over-compensation", "tracker-scale", "joint-offset"]
)
def test_these_faults_can_be_hidden_seen_and_taken_out(name: str) -> None:
    fault = FAULTS[name]
    for seed in range(3):
        sound = draw_foreign(seed, fault.protocols[-1], rows=150, noise="white")
        drawn = hide_faults(sound, [fault.name], seed)
        assert clear_faults(drawn.rig, drawn.truth, [fault.name]) == sound.rig
        (hidden,) = find_truth(drawn, library()).faults
        assert hidden.name == fault.called
        assert hidden.size > 1e-4


def test_every_known_fault_can_be_hidden_in_a_foreign_machine() -> None:
    for seed, fault in enumerate(fault for fault in FAULTS.values() if fault.section != "odd"):
        sound = draw_foreign(seed, fault.protocols[0], rows=60)
        drawn = hide_faults(sound, [fault.name], seed)
        here, there = (simulate(rig, drawn.targets, noise=False).truth for rig in (drawn.rig, sound.rig))
        assert np.isfinite(here).all()
        assert fault.section == "tracker" or np.abs(here - there).max() > 1e-4, fault.name


def test_one_effect_is_not_hidden_twice() -> None:
    sound = draw_foreign(1, "path", rows=40)
    with pytest.raises(InputError, match="hidden already"):
        hide_faults(sound, ["backlash", "over-compensation"], 1)
