"""What weight and warmth do to the rig, and faults that no effect of the library describes."""

import numpy as np
import pandas as pd
import pytest
from test_rig_bench import MEASURED, bench, inverse_jacobian, slider_space, table, truth, volume

from ptt.rig import simulate
from ptt.rig.schema import Room, Thermal
from ptt.rig.thermal import follow_temperatures, lag

POSES = volume(80)
COMMAND = ["b1_cmd", "b2_cmd", "b3_cmd"]
ALL_HEIGHTS = np.linspace(230.0, 330.0, 401)


def level(**sections: object) -> np.ndarray:
    """(401, 3) mm, slider errors over their height, all sliders level."""
    sent = pd.DataFrame(np.repeat(ALL_HEIGHTS[:, None], 3, axis=1), columns=COMMAND)
    rig = bench(**sections)
    poses = simulate(bench(), sent, noise=False).truth
    moved = simulate(rig, sent, noise=False).truth - poses
    return np.einsum("nij,nj->ni", inverse_jacobian(poses), moved)


def test_payload_example() -> None:
    """5 kg at x = 60 mm, 5 N/um: (-11, 0, -6) um."""
    rig = bench(drive={"compliance_um_per_n": 0.2}, conditions={"payload_kg": 5.0})
    pose = np.array([[60.0, 0.0, 0.0]])
    np.testing.assert_allclose(1e3 * (truth(rig, pose) - pose), [[-11.3, 0.0, -5.9]], atol=0.05)


def test_forces_do_the_work_of_the_weight() -> None:
    """Virtual work: sum of slider force x slider move = weight x tool move, F = J^-T ... for any small move."""
    rig = bench({"platform_mass_kg": 1.5}, conditions={"payload_kg": 2.0})
    force = simulate(rig, table(POSES), noise=False).force
    weight = np.array([0.0, 0.0, -3.5 * 9.80665])
    np.testing.assert_allclose(np.einsum("nji,nj->ni", inverse_jacobian(POSES), force), weight + 0.0 * force, atol=1e-9)


def test_sag_is_linear_in_the_payload_of_the_row() -> None:
    rows = table(np.repeat(POSES[:1], 3, axis=0)).assign(payload_kg=[0.0, 2.0, 4.0])
    sag = simulate(bench(drive={"compliance_um_per_n": 0.3}), rows, noise=False).truth - POSES[0]
    np.testing.assert_allclose(sag[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(sag[2], 2.0 * sag[1], rtol=1e-3)
    assert sag[1, 2] < -0.001


def test_clearance_changes_side_with_the_link_force() -> None:
    inside, outside = np.array([[0.0, 0.0, 0.0]]), np.array([[-75.0, 0.0, 0.0]])
    rig = bench(geometry={"clearance_um": [20.0, 0.0, 0.0]}, conditions={"payload_kg": 3.0})
    link_over_w = -300.0 / np.sqrt(300.0**2 - np.array([100.0, 175.0]) ** 2)
    got = slider_space(rig, np.vstack([inside, outside]))[:, 0]
    np.testing.assert_allclose(got, 0.010 * link_over_w * [1.0, -1.0], rtol=1e-3)
    unloaded = bench(geometry={"clearance_um": 20.0})
    np.testing.assert_allclose(truth(unloaded, outside), outside, atol=1e-9)


def test_column_bends_more_at_the_top() -> None:
    structure = {"column_bend_um_per_kg": [2.0, -1.0], "column_height_mm": 800.0}
    rig = bench(structure=structure, conditions={"payload_kg": 5.0})
    heights = np.array([[0.0, 0.0, -40.0], [0.0, 0.0, 0.0], [0.0, 0.0, 40.0]])
    moved = truth(rig, heights) - heights
    lever = (1.0 + heights[:, 2] / 800.0) ** 2
    np.testing.assert_allclose(moved, np.outer(lever, [0.010, -0.005, 0.0]), atol=1e-8)
    apart = bench(structure={**structure, "column_per_slider": True}, conditions={"payload_kg": 5.0})
    tilted = np.array([[40.0, 0.0, 0.0]])
    assert np.abs(truth(apart, tilted) - truth(rig, tilted)).max() > 5e-5


def test_lag_of_a_step() -> None:
    step = np.full(50, 60.0)
    state = lag(np.full((50, 1), 30.0), step, 600.0, 20.0)[:, 0]
    np.testing.assert_allclose(state, 30.0 - 10.0 * np.exp(-np.cumsum(step) / 600.0), atol=1e-12)


def test_lag_behind_a_room_that_warms_up() -> None:
    """Closed form of a first-order lag behind 1 - exp(-t / T)."""
    room, screws = 4000.0, 900.0
    time = np.cumsum(np.full(400, 30.0))
    temperatures = follow_temperatures(
        Room(start_c=20.0, rise_k=8.0, time_constant_s=room),
        Thermal(screw_lag_s=screws, frame_lag_s=0.0),
        time,
        np.zeros((400, 3)),
        np.zeros(400),
    )
    want = 28.0 - 8.0 * (room * np.exp(-time / room) - screws * np.exp(-time / screws)) / (room - screws)
    np.testing.assert_allclose(temperatures.screw[:, 1], want, atol=1e-3)
    np.testing.assert_allclose(temperatures.frame, 28.0 - 8.0 * np.exp(-time / room), atol=1e-12)
    assert (temperatures.room - temperatures.screw[:, 0]).max() > 0.5


def test_duty_heats_the_screw_that_works() -> None:
    time = np.cumsum(np.full(300, 10.0))
    travelled = np.outer(np.full(300, 50.0), [1.0, 0.0, 2.0])
    heated = Thermal(screw_lag_s=200.0, duty_k_s_per_mm=0.4, sensor="screw 3")
    temperatures = follow_temperatures(Room(), heated, time, travelled, np.zeros(300))
    np.testing.assert_allclose(temperatures.screw[-1], [22.0, 20.0, 24.0], atol=1e-5)
    np.testing.assert_array_equal(temperatures.sensor, temperatures.screw[:, 2])


def test_leading_in_takes_no_time_and_warms_no_screw() -> None:
    """Screws that follow at once: the first row of each run is as warm as its way on the clock alone makes it."""
    rig = bench(
        thermal={"duty_k_s_per_mm": 0.1, "growth_um_per_m_k": 11.5},
        conditions={"cycles": 2, "run_per_cycle": True, "dwell_s": 0.0, "feed_mm_s": 10.0},
    )
    poses = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 20.0]])
    screw = simulate(rig, table(poses), noise=False).screw_temp
    np.testing.assert_allclose(screw, np.repeat([[20.0], [21.0], [21.0], [21.0]], 3, axis=1), atol=1e-9)


def test_screw_grows_from_its_fixed_end() -> None:
    room = {"start_c": 30.0}
    thermal = {"growth_um_per_m_k": 11.5, "fixed_end_mm": 450.0}
    got = level(thermal=thermal, conditions={"room": room})
    np.testing.assert_allclose(got, np.repeat(11.5e-5 * (ALL_HEIGHTS - 450.0)[:, None], 3, 1), atol=2e-6)


def test_splice_steps_once() -> None:
    got = level(odd=[{"kind": "splice", "leg": 2, "height_mm": 280.1, "step_um": 30.0}])
    np.testing.assert_allclose(got[:, 1], np.where(ALL_HEIGHTS > 280.1, 0.030, 0.0), atol=2e-5)
    np.testing.assert_allclose(got[:, [0, 2]], 0.0, atol=2e-5)


def test_guide_damage_is_local() -> None:
    got = level(odd=[{"kind": "guide-damage", "leg": 1, "height_mm": 270.0, "size_um": 40.0, "width_mm": 10.0}])[:, 0]
    assert got[np.argmin(np.abs(ALL_HEIGHTS - 270.0))] == pytest.approx(0.040, abs=2e-5)
    assert np.abs(got[np.abs(ALL_HEIGHTS - 270.0) > 5.0]).max() < 1e-9
    sideways = {"kind": "guide-damage", "leg": 1, "height_mm": 270.0, "size_um": 40.0, "direction": "radial"}
    pushed = level(odd=[sideways])[:, 0]
    assert pushed[np.argmin(np.abs(ALL_HEIGHTS - 270.0))] == pytest.approx(0.040 * 100.0 / np.sqrt(8e4), abs=2e-5)


def test_roller_has_its_own_period() -> None:
    got = level(odd=[{"kind": "periodic", "leg": 3, "size_um": 10.0, "period_mm": 7.3, "phase_rad": 1.0}])[:, 2]
    np.testing.assert_allclose(got, 0.010 * np.cos(2 * np.pi * ALL_HEIGHTS / 7.3 - 1.0), atol=2e-6)


def test_bump_is_gaussian() -> None:
    got = level(odd=[{"kind": "bump", "leg": 1, "height_mm": 290.0, "size_um": -12.0, "width_mm": 8.0}])[:, 0]
    np.testing.assert_allclose(got, -0.012 * np.exp(-0.5 * ((ALL_HEIGHTS - 290.0) / 8.0) ** 2), atol=2e-6)


def test_hose_pulls_only_when_taut_and_towards_its_anchor() -> None:
    hose = {"kind": "hose", "anchor_mm": [300.0, 0.0, 0.0], "stiffness_n_per_mm": 2.0, "free_length_mm": 300.0}
    rig = bench(odd=[hose])
    poses = np.array([[40.0, 0.0, 0.0], [-40.0, 0.0, 0.0], [-20.0, 0.0, 0.0]])
    moved = truth(rig, poses) - poses
    np.testing.assert_allclose(moved[0], 0.0, atol=1e-9)
    assert moved[1, 0] > 0.01
    assert moved[1, 0] > 1.8 * moved[2, 0]


def test_the_forces_of_the_drives_bear_the_hose_as_well() -> None:
    """At the centre the links share a pull along z evenly: 6 N up by the hose against 10 N of weight leaves 4 N."""
    hose = {"kind": "hose", "anchor_mm": [0.0, 0.0, 900.0], "pull_n": 6.0}
    rig = bench(odd=[hose], conditions={"payload_kg": 10.0 / 9.80665, "report_force": True})
    frame = simulate(rig, table(np.zeros((1, 3))), noise=False).frame
    np.testing.assert_allclose(frame[["tau1", "tau2", "tau3"]], np.full((1, 3), -4.0 / 3.0), atol=1e-6)


def test_backlash_that_opens_when_warm() -> None:
    odd = [{"kind": "warm-backlash", "leg": 1, "gap_um_per_k": 10.0, "opens_at_c": 22.0}]
    sent = pd.DataFrame(np.outer(280.0 + 20.0 * (np.arange(40) % 2), np.ones(3)), columns=COMMAND)
    room = {"start_c": 20.0, "rise_k": 8.0, "time_constant_s": 100.0}
    result = simulate(bench(odd=odd, conditions={"room": room}), sent, noise=False)
    error = result.slider_actual[:, 0] - sent["b1_cmd"].to_numpy()
    gap = 0.010 * np.maximum(result.screw_temp[:, 0] - 22.0, 0.0)
    direction = np.where(np.arange(40) % 2 == 1, 1.0, -1.0)
    np.testing.assert_allclose(error, -0.5 * gap * direction, atol=1e-12)
    assert gap[0] == 0.0
    assert gap[-1] > 0.02
    np.testing.assert_array_equal(result.slider_actual[:, 1:], sent[COMMAND[1:]].to_numpy())
    assert MEASURED[0] in result.frame
