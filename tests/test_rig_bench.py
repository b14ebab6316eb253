"""The virtual bench that the other rig tests share, and what it does when nothing is wrong with it."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ptt.errors import WorkspaceError
from ptt.rig import Rig, parse_rig, simulate
from ptt.rig.nominal import ideal_machine, nominal_sliders

GOLDEN = Path(__file__).parent / "golden" / "linear_delta.csv"
TARGET = ["x_cmd", "y_cmd", "z_cmd"]
COMMAND = ["b1_cmd", "b2_cmd", "b3_cmd"]
MEASURED = ["x_meas", "y_meas", "z_meas"]
BENCH = {
    "kind": "three-ptt",
    "base_radius_mm": 200.0,
    "platform_radius_mm": 100.0,
    "link_length_mm": 300.0,
    "slider_travel_mm": [150.0, 420.0],
    "screw_lead_mm": 5.0,
}


def bench(machine: dict[str, Any] | None = None, **sections: Any) -> Rig:
    """The bench with the given faults and a few keys of its drawing changed."""
    return parse_rig({"machine": {**BENCH, **(machine or {})}, **sections})


def volume(rows: int, seed: int = 0) -> np.ndarray:
    """(n, 3) mm, random poses."""
    return np.random.default_rng(seed).uniform([-60.0, -60.0, -50.0], [60.0, 60.0, 50.0], (rows, 3))


def table(poses: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(np.atleast_2d(poses), columns=TARGET)


def truth(rig: Rig, poses: np.ndarray) -> np.ndarray:
    """(n, 3) mm, where the tool really goes."""
    return simulate(rig, table(poses), noise=False).truth


def inverse_jacobian(poses: np.ndarray) -> np.ndarray:
    """J = db/dp of the upright bench, (n, 3, 3), by the closed formula."""
    q, w = link_parts(poses)
    return np.concatenate([q / w[..., None], np.ones((*w.shape, 1))], axis=-1)


def link_parts(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal (n, 3, 2) and vertical (n, 3) part of the links, from slider to platform, by the closed formula."""
    angle = np.radians([0.0, 120.0, 240.0])
    q = poses[:, None, :2] - 100.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    return q, -np.sqrt(300.0**2 - (q**2).sum(-1))


def slider_space(rig: Rig, poses: np.ndarray) -> np.ndarray:
    """Tool errors seen as slider errors, (n, 3) mm."""
    return np.einsum("nij,nj->ni", inverse_jacobian(poses), truth(rig, poses) - poses)


def test_without_faults_the_tool_is_where_it_should_be() -> None:
    poses = volume(300)
    result = simulate(bench(), table(poses), noise=False)
    np.testing.assert_allclose(result.truth, poses, atol=1e-9)
    np.testing.assert_allclose(result.frame[MEASURED], poses, atol=1e-9)
    assert np.abs(result.rotation).max() < 1e-12


@settings(max_examples=40, deadline=None)
@given(
    base=st.floats(120.0, 400.0),
    platform=st.floats(20.0, 100.0),
    stretch=st.floats(1.3, 3.0),
    height=st.floats(-50.0, 50.0),
    sliders=st.sampled_from(["above", "below"]),
    turn=st.floats(0.0, 120.0),
    lean=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    seed=st.integers(0, 1000),
)
def test_forward_undoes_inverse_on_any_machine(
    base: float,
    platform: float,
    stretch: float,
    height: float,
    sliders: str,
    turn: float,
    lean: tuple[float, ...],
    seed: int,
) -> None:
    link = stretch * (base - platform) + 50.0
    machine = {
        "base_radius_mm": base,
        "platform_radius_mm": platform,
        "link_length_mm": link,
        "joint_height_mm": height,
        "sliders": sliders,
        "slider_azimuth_deg": [turn, turn + 120.0, turn + 240.0],
        "slider_lean_deg": list(lean),
        "slider_travel_mm": [-5000.0, 5000.0],
    }
    reach = 0.2 * (link - base + platform)
    poses = np.random.default_rng(seed).uniform(-reach, reach, (20, 3))
    rig = bench(machine)
    np.testing.assert_allclose(truth(rig, poses), poses, atol=1e-9)
    sent = nominal_sliders(ideal_machine(rig.spec), poses)
    back = simulate(rig, pd.DataFrame(sent, columns=COMMAND), noise=False)
    np.testing.assert_allclose(back.truth, poses, atol=1e-9)


def test_inverse_is_the_textbook_formula() -> None:
    poses = volume(50)
    _, w = link_parts(poses)
    got = nominal_sliders(ideal_machine(bench({"joint_height_mm": 12.0}).spec), poses)
    np.testing.assert_allclose(got, poses[:, 2:] + 12.0 - w, atol=1e-10)


def test_unequal_legs_agree_with_golden_values() -> None:
    with GOLDEN.open(encoding="utf-8") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    assert len(rows) > 50
    for row in rows:
        machine = {
            "base_radius_mm": row["radius_mm"] + 30.0,
            "platform_radius_mm": 30.0,
            "link_length_mm": 300.0,
            "slider_travel_mm": [-2000.0, 2000.0],
            "slider_azimuth_deg": [row[f"azimuth{leg}_deg"] for leg in (1, 2, 3)],
        }
        faults = {
            "tower_radial_mm": [row[f"radius{leg}_mm"] - row["radius_mm"] for leg in (1, 2, 3)],
            "link_mm": [row[f"link{leg}_mm"] - 300.0 for leg in (1, 2, 3)],
        }
        sent = pd.DataFrame([[row[f"b{leg}"] for leg in (1, 2, 3)]], columns=COMMAND)
        got = simulate(bench(machine, geometry=faults), sent, noise=False).truth
        np.testing.assert_allclose(got, [[row["x"], row["y"], row["z"]]], atol=2e-9)


def test_targets_out_of_reach_are_named() -> None:
    with pytest.raises(WorkspaceError, match="row 2 of the targets is out of reach") as caught:
        simulate(bench(), table(np.array([[0.0, 0.0, 0.0], [350.0, 0.0, 0.0]])))
    assert caught.value.rows == (1,)
    with pytest.raises(WorkspaceError, match="out of its travel, 150 to 420 mm"):
        simulate(bench(), table(np.array([[0.0, 0.0, 300.0]])))
    with pytest.raises(WorkspaceError, match=r"row 1 of the targets is out of reach \(the first of 2 such rows\)"):
        simulate(bench(), table(np.array([[350.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 350.0, 0.0]])))
    with pytest.raises(WorkspaceError, match="the datum pose is out of reach"):
        simulate(bench(tracker={"datum_every": 1, "datum_mm": [350.0, 0.0, 0.0]}), table(np.zeros((3, 3))))
