"""The rig's laser tracker: frame, scale, drift, knock, noise, base reflectors."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from test_rig_bench import BENCH, MEASURED, bench, table, volume

from ptt.errors import TableError, WorkspaceError
from ptt.rig import Rig, parse_rig, simulate

STATION = np.array([1200.0, -2700.0, 400.0])
POSES = volume(40)


def read(rig: Rig, poses: np.ndarray = POSES, *, noise: bool = False) -> np.ndarray:
    return simulate(rig, table(poses), noise=noise).frame[MEASURED].to_numpy()


def many(tracker: dict[str, object], rows: int = 6000) -> np.ndarray:
    """(n, 3) mm, noise of a held pose."""
    pose = np.array([[20.0, -10.0, 5.0]])
    return read(bench(tracker=tracker, seed=5), np.repeat(pose, rows, axis=0), noise=True) - pose


def test_frame_is_an_exact_rigid_motion() -> None:
    rig = bench(tracker={"translation_mm": [900.0, -4.0, 70.0], "rotation_mrad": [300.0, -200.0, 500.0]})
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5])
    np.testing.assert_allclose(read(rig), turn.apply(POSES) + np.array([900.0, -4.0, 70.0]), atol=1e-9)


def test_scale_is_about_the_station() -> None:
    rig = bench(tracker={"scale_ppm": 20.0, "station_mm": STATION.tolist()})
    np.testing.assert_allclose(read(rig) - POSES, 20e-6 * (POSES - STATION), atol=1e-9)


def test_drift_follows_the_clock() -> None:
    rig = bench(tracker={"drift_um_per_h": [36.0, 0.0, 0.0], "drift_um": [0.0, 5.0, 0.0], "drift_constant_s": 100.0})
    frame = simulate(rig, table(POSES), noise=False).frame
    elapsed = frame["time_s"].to_numpy() - frame["time_s"].iloc[0]
    shift = frame[MEASURED].to_numpy() - POSES
    want = np.column_stack([1e-5 * elapsed, 0.005 * (1 - np.exp(-elapsed / 100.0)), 0.0 * elapsed])
    np.testing.assert_allclose(shift, want, atol=1e-9)


@pytest.mark.parametrize("when", [{"knock_row": 15}, {"knock_time_s": 40.0}])
def test_knock_moves_everything_from_then_on(when: dict[str, float]) -> None:
    rig = bench(tracker={**when, "knock_um": [30.0, 0.0, -10.0], "knock_mrad": [0.0, 0.2, 0.0]})
    frame = simulate(rig, table(POSES), noise=False).frame
    after = frame.index >= 15 if "knock_row" in when else frame["time_s"] - frame["time_s"].iloc[0] >= 40.0
    moved = POSES + np.array([0.030, 0.0, -0.010]) + np.cross([0.0, 2e-4, 0.0], POSES)
    got = frame[MEASURED].to_numpy()
    np.testing.assert_allclose(got[after], moved[after], atol=5e-6)
    np.testing.assert_allclose(got[~after], POSES[~after], atol=1e-9)
    assert 3 < np.sum(after) < 37


def test_noise_is_small_along_the_beam_and_grows_with_range_across() -> None:
    noise = many({"station_mm": STATION.tolist(), "radial_um": 1.0, "sideways_um_per_m": 1.2})
    beam = np.array([20.0, -10.0, 5.0]) - STATION
    distance = np.linalg.norm(beam)
    along = noise @ (beam / distance)
    across = noise - np.outer(along, beam / distance)
    assert along.std() == pytest.approx(0.001, rel=0.04)
    assert np.sqrt((across**2).sum(1).mean() / 2) == pytest.approx(0.0012 * distance / 1e3, rel=0.04)


def test_white_noise_is_the_same_everywhere() -> None:
    noise = many({"white_mm": 0.004})
    np.testing.assert_allclose(np.cov(noise.T), 16e-6 * np.eye(3), atol=1e-6)


def test_stated_deviation_is_the_true_one() -> None:
    settings = {"station_mm": STATION.tolist(), "report_std": True, "rotation_mrad": [0.0, 0.0, 900.0]}
    rig = bench(tracker=settings, seed=2)
    frame = simulate(rig, table(np.zeros((6000, 3)))).frame
    np.testing.assert_allclose(frame[MEASURED].std(), frame[["x_std", "y_std", "z_std"]].iloc[0], rtol=0.04)


def test_wander_is_correlated_in_time() -> None:
    slow = many({"white_mm": 0.0, "wander_um": 3.0, "wander_s": 20.0})
    assert slow.std() == pytest.approx(0.003, rel=0.15)
    lagged = np.corrcoef(slow[:-5, 0], slow[5:, 0])[0, 1]
    assert lagged == pytest.approx(np.exp(-10.0 / 20.0), abs=0.08)


def test_outliers_and_missing_readings_have_their_share() -> None:
    rig = bench(tracker={"white_mm": 0.001, "outlier_share": 0.05, "outlier_mm": 0.5, "missing_share": 0.1}, seed=8)
    result = simulate(rig, table(np.zeros((4000, 3))))
    got = result.frame[MEASURED].to_numpy()
    missing = np.isnan(got).any(1)
    assert missing.mean() == pytest.approx(0.1, abs=0.02)
    assert result.outlier.mean() == pytest.approx(0.05, abs=0.015)
    far = np.linalg.norm(got, axis=1) > 0.4
    np.testing.assert_array_equal(far[~missing], result.outlier[~missing])


def measured_bench(**sections: object) -> Rig:
    points = [
        {"name": f"base {number}", "xyz_mm": place, "sigma_mm": 0.002}
        for number, place in enumerate(([400.0, 0, -200.0], [-300.0, 300.0, -200.0], [-300.0, -300.0, 250.0]), start=1)
    ]
    whole = {"machine": BENCH, "tracker": {"frame": "measured", "base_point": points}}
    return parse_rig({"machine": whole, **sections})


def test_base_reflectors_are_measured_along() -> None:
    frame_key = {"translation_mm": [5.0, 6.0, 7.0], "rotation_mrad": [100.0, 0.0, 50.0], "base_every": 15}
    result = simulate(measured_bench(tracker=frame_key), table(POSES), noise=False)
    base = result.frame[result.frame["role"] == "base"]
    assert base["name"].tolist() == ["base 1", "base 2", "base 3"] * 4
    assert base.index[:3].tolist() == [0, 1, 2]
    assert base.index[-1] == len(result.frame) - 1
    assert base[["x_cmd", "b1_cmd"]].isna().all().all()
    turn = Rotation.from_rotvec([0.1, 0.0, 0.05])
    first = turn.apply([400.0, 0.0, -200.0]) + np.array([5.0, 6.0, 7.0])
    np.testing.assert_allclose(base[MEASURED].iloc[0], first, atol=1e-9)


def test_base_reflectors_lie_within_their_sigma() -> None:
    off = []
    for seed in range(60):
        quiet = measured_bench(tracker={"white_mm": 0.0}, seed=seed)
        base = simulate(quiet, table(POSES[:2])).truth[:3]
        off.append(base - [[400.0, 0, -200.0], [-300.0, 300.0, -200.0], [-300.0, -300.0, 250.0]])
    assert np.std(off) == pytest.approx(0.002, rel=0.15)
    again = measured_bench(tracker={"white_mm": 0.0}, seed=0)
    np.testing.assert_array_equal(
        simulate(again, table(POSES[:2]), seed=99).truth[:3], simulate(again, table(POSES[:2])).truth[:3]
    )


def test_the_machine_stands_still_while_the_base_is_measured() -> None:
    faults = {"drive": {"backlash_mm": 0.1}}
    plain = simulate(bench(**faults), table(POSES), noise=False)
    along = simulate(measured_bench(tracker={"base_every": 7}, **faults), table(POSES), noise=False)
    pose = (along.frame["role"] == "pose").to_numpy()
    np.testing.assert_allclose(along.truth[pose], plain.truth, atol=1e-12)


def test_a_target_out_of_reach_is_named_although_the_base_is_read_from_it() -> None:
    with pytest.raises(WorkspaceError, match="row 1 of the targets is out of reach") as caught:
        simulate(measured_bench(), table(np.array([[350.0, 0.0, 0.0], [0.0, 0.0, 0.0]])))
    assert caught.value.rows == (0,)
    with pytest.raises(TableError, match="base reflectors and no pose"):
        simulate(measured_bench(), pd.DataFrame({"name": ["base 1"], "role": ["base"]}))


def test_targets_may_ask_for_base_reflectors_by_name() -> None:
    rows = table(POSES[:3]).assign(name=["a", "base 2", "c"], role=["pose", "base", "pose"])
    rig = measured_bench(tracker={"measure_base": False})
    frame = simulate(rig, rows, noise=False).frame
    np.testing.assert_allclose(frame[MEASURED].iloc[1], [-300.0, 300.0, -200.0], atol=1e-9)
    with pytest.raises(TableError, match="base reflector 'base 9' is not in the machine file"):
        simulate(rig, rows.assign(name=["a", "base 9", "c"]), noise=False)


def test_every_run_may_have_a_set_up_of_its_own() -> None:
    rig = bench(
        conditions={"cycles": 3, "run_per_cycle": True}, tracker={"frame_scatter_mm": 0.2, "frame_scatter_mrad": 0.1}
    )
    shift = read(rig, np.zeros((2, 3))).reshape(3, 2, 3)
    np.testing.assert_allclose(shift[:, 0], shift[:, 1], atol=1e-12)
    assert len(np.unique(shift[:, 0].round(9), axis=0)) == 3
    assert isinstance(simulate(rig, table(POSES)).frame["run"], pd.Series)
