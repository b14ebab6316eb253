"""A serial arm as a rig: its drawing against a chain of rotations, faults against sums by hand, files and refusals."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.door.simulating import simulate as drive
from ptt.errors import InputError, TableError, WorkspaceError
from ptt.machine import load_machine
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.serial_arm import rigid

DATA = Path(__file__).resolve().parents[1] / "data"
MEASURED = ["x_meas", "y_meas", "z_meas"]
# Two links in a vertical plane, 400 and 300 mm long: joint 1 turns about the vertical, joints 2 and 3 lift.
CRANE = {
    "kind": "serial",
    "name": "crane",
    "convention": "standard",
    "joint": [
        {"alpha_deg": 90.0, "d_mm": 500.0, "limits_deg": [-170.0, 170.0]},
        {"a_mm": 400.0, "limits_deg": [-90.0, 90.0]},
        {"a_mm": 300.0, "limits_deg": [-150.0, 150.0]},
    ],
}
NAMES = ["q1_cmd_rad", "q2_cmd_rad", "q3_cmd_rad"]


def crane(**sections: object):
    return parse_rig({"machine": CRANE, **sections})


def poses(*rows: tuple[float, float, float], **columns: object) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=NAMES).assign(**columns)


def reading(rig, targets: pd.DataFrame, **how: object) -> np.ndarray:
    return simulate(rig, targets, noise=False, **how).frame[MEASURED].to_numpy()


def chain(spec, q: np.ndarray) -> np.ndarray:
    """Tool of a standard DH drawing, link after link: shift along z, turn about it, the same along x."""
    place = []
    for row in q:
        at, turn = np.zeros(3), Rotation.identity()
        for link, value in zip(spec.joint, row, strict=True):
            at = at + turn.apply([0.0, 0.0, link.d_mm])
            turn = turn * Rotation.from_euler("z", value + np.radians(link.theta_offset_deg))
            at = at + turn.apply([link.a_mm, 0.0, 0.0])
            turn = turn * Rotation.from_euler("x", link.alpha_deg, degrees=True)
        place.append(at + turn.apply(spec.tool_mm))
    return np.array(place)


def test_a_sound_arm_is_read_where_its_drawing_puts_it() -> None:
    file = load_machine(DATA / "machines" / "ur10.toml")
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (12, 6))
    columns = [f"q{i + 1}_cmd_rad" for i in range(6)]
    tracker = {"translation_mm": [300.0, -20.0, 5.0], "rotation_mrad": [0.0, 0.0, 700.0]}
    rig = parse_rig({"machine": str(DATA / "machines" / "ur10.toml"), "tracker": tracker})
    run = simulate(rig, pd.DataFrame(q, columns=columns), noise=False)
    nominal = chain(file.machine, q)
    np.testing.assert_allclose(run.frame[["x_cmd", "y_cmd", "z_cmd"]], nominal, atol=1e-9)
    np.testing.assert_allclose(run.truth, nominal, atol=1e-9)
    seen = Rotation.from_euler("z", 0.7).apply(nominal) + np.array([300.0, -20.0, 5.0])
    np.testing.assert_allclose(run.frame[MEASURED], seen, atol=1e-9)
    np.testing.assert_allclose(run.slider_actual, q, atol=1e-15)


def test_play_of_the_first_joint_swings_the_tool_by_half_of_it_to_either_side() -> None:
    q = [0.0, 0.1, 0.2, 0.1, 0.0]
    read = reading(crane(arm={"backlash_mrad": [2.0, 0.0, 0.0]}), poses(*((value, 0.0, 0.0) for value in q)))
    angle = np.arctan2(read[:, 1], read[:, 0])
    np.testing.assert_allclose(angle - q, [-1e-3, -1e-3, -1e-3, 1e-3, 1e-3], atol=1e-12)


def test_a_payload_bends_a_stretched_arm_by_its_lever() -> None:
    """5 kg, 700 mm before joint 2: 5 x 9.80665 x 700 N mm times 10 nrad per N mm."""
    rig = crane(arm={"compliance_nrad_per_nmm": [0.0, 10.0, 0.0]})
    low, high = reading(rig, poses((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), payload_kg=[5.0, 0.0]))
    droop = 5.0 * 9.80665 * 700.0 * 10e-9
    np.testing.assert_allclose(low - high, [-700.0 * droop**2 / 2.0, 0.0, -700.0 * droop], atol=1e-5)


def test_lengths_links_and_uneven_rings_move_the_tool_as_on_paper() -> None:
    stretched = poses((0.0, 0.0, 0.0))
    warm = crane(arm={"growth_um_per_m_k": 12.0}, conditions={"room": {"start_c": 25.0}})
    np.testing.assert_allclose(reading(warm, stretched)[0], np.array([700.0, 0.0, 500.0]) * (1.0 + 60e-6), atol=1e-9)
    longer = crane(arm={"link_a_mm": [0.0, 0.25, 0.0], "link_theta_mrad": [0.0, 0.0, 1.0]})
    tip = [400.25 + 300.0 * np.cos(1e-3), 0.0, 500.0 + 300.0 * np.sin(1e-3)]
    np.testing.assert_allclose(reading(longer, stretched)[0], tip, atol=1e-9)
    ring = crane(arm={"turn_urad": [80.0, 0.0, 0.0], "turn_phase_rad": [0.3, 0.0, 0.0], "turn_harmonic": 5})
    read = reading(ring, poses((0.2, 0.0, 0.0), (0.9, 0.0, 0.0)))
    off = np.arctan2(read[:, 1], read[:, 0]) - [0.2, 0.9]
    np.testing.assert_allclose(off, 80e-6 * np.cos(5.0 * np.array([0.2, 0.9]) - 0.3), atol=1e-12)


def test_commands_that_were_corrected_are_sent_and_the_targets_stay() -> None:
    wanted = poses((0.1, 0.2, 0.3), (0.4, 0.2, 0.1))
    sent = pd.DataFrame(wanted.to_numpy() + 0.01, columns=["q1", "q2", "q3"])
    run = simulate(crane(), wanted, sliders=sent, noise=False)
    spec = crane().serial
    np.testing.assert_allclose(run.frame[["x_cmd", "y_cmd", "z_cmd"]], chain(spec, wanted.to_numpy()), atol=1e-9)
    np.testing.assert_allclose(run.frame[MEASURED], chain(spec, sent.to_numpy()), atol=1e-9)
    np.testing.assert_allclose(run.frame[NAMES], sent, atol=1e-15)


def test_the_command_reads_degrees_and_writes_a_run_that_reads_back(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(format_rig(crane(seed=3, arm={"link_d_mm": [0.0, 0.2, 0.0]})))
    wanted = poses((0.1, 0.2, 0.3), (0.4, 0.2, 0.1), (-0.4, 0.3, 0.1))
    degrees = np.degrees(wanted).set_axis(["q1_cmd_deg", "q2_cmd_deg", "q3_cmd_deg"], axis=1)
    degrees.to_csv(tmp_path / "targets.csv", index=False)
    told = ["simulate", "rig.toml", "targets.csv", "--out", "run.csv", "--no-noise", "--truth", "truth.csv"]
    result = CliRunner().invoke(app, [str(tmp_path / one) if "." in one else one for one in told])
    assert result.exit_code == 0, result.output
    run, truth = pd.read_csv(tmp_path / "run.csv"), pd.read_csv(tmp_path / "truth.csv")
    np.testing.assert_allclose(run[NAMES], wanted, atol=1e-12)
    np.testing.assert_allclose(truth[["q1_true", "q2_true", "q3_true"]], wanted, atol=1e-12)
    side = np.stack([np.sin(run["q1_cmd_rad"]), -np.cos(run["q1_cmd_rad"]), 0.0 * run["q1_cmd_rad"]], axis=1)
    np.testing.assert_allclose(run[MEASURED], chain(crane().serial, wanted.to_numpy()) + 0.2 * side, atol=1e-9)
    predicted = pd.DataFrame(wanted.to_numpy() + 0.01, columns=["q1", "q2", "q3"])
    sent = drive(tmp_path / "rig.toml", tmp_path / "targets.csv", sliders=predicted, noise=False)
    np.testing.assert_allclose(sent.to_frame()[NAMES], predicted, atol=1e-12)


def test_a_rig_of_an_arm_reads_back_and_noise_follows_the_seed() -> None:
    rig = crane(seed=5, arm={"backlash_mrad": [0.5, 0.0, 0.0], "mass_kg": [5.0, 2.0, 1.0]}, tracker={"white_mm": 0.01})
    again = parse_rig(format_rig(rig))
    assert again == rig
    targets = poses(*np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3)))
    one, same, other = (simulate(one, targets, seed=s).frame[MEASURED] for one, s in ((rig, 1), (again, 1), (rig, 2)))
    assert one.equals(same)
    assert np.std(one.to_numpy() - other.to_numpy()) == pytest.approx(0.01 * np.sqrt(2.0), rel=0.1)


def test_coordinates_turn_against_their_frame() -> None:
    matrix = rigid(np.array([0.0, 0.0, 0.5 * np.pi]), np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(matrix @ [0.0, 5.0, 0.0, 1.0], [6.0, 2.0, 3.0, 1.0], atol=1e-12)
    turn = np.array([0.3, -0.8, 0.4])
    np.testing.assert_allclose(rigid(turn, np.zeros(3))[:3, :3], Rotation.from_rotvec(-turn).as_matrix(), atol=1e-12)


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"drive": {"backlash_mm": 0.1}}, r"key drive.*\[arm\]"),
        ({"arm": {"backlash_mrad": [1.0]}}, r"arm.backlash_mrad.*1 values for an arm of 3 joints"),
        ({"arm": {"backlash_mrad": [-1.0, 0.0, 0.0]}}, "arm.backlash_mrad"),
        ({"arm": {"backlash_mad": [1.0, 0.0, 0.0]}}, "did you mean 'backlash_mrad'"),
        ({"arm": {"com_mm": [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}}, "arm.com_mm"),
        ({"tracker": {"datum_every": 3}}, "datum_every"),
        ({"conditions": {"moving": True}}, "conditions.moving"),
        ({"conditions": {"report_force": True}}, "conditions.report_force"),
        ({"arm": {"ring_urad": [[1.0, 2.0], [1.0], [1.0]]}}, "arm.ring_urad.*as many harmonics"),
        ({"arm": {"ring_urad": [[1.0, 2.0]] * 3, "ring_phase_rad": [[1.0]] * 3}}, "arm.ring_urad.*as many harmonics"),
        ({"arm": {"ring_phase_rad": [[1.0]] * 3}}, "arm.ring_urad.*as many harmonics"),
        ({"arm": {"slip_mrad": [1.0, 0.0, 0.0]}}, "slip_mrad without a moment.*give slip_row"),
    ],
)
def test_rigs_that_make_no_sense_are_refused_by_key(sections, words: str) -> None:
    with pytest.raises(InputError) as caught:
        crane(**sections)
    assert re.search(words, str(caught.value), re.DOTALL), str(caught.value)


def test_a_slider_machine_has_no_arm_and_an_arm_needs_its_posture() -> None:
    with pytest.raises(InputError, match="three-ptt"):
        parse_rig({"machine": str(DATA / "machine.toml"), "arm": {"backlash_mrad": [1.0, 1.0, 1.0]}})
    with pytest.raises(WorkspaceError, match="posture"):
        simulate(crane(), pd.DataFrame([[700.0, 0.0, 500.0]], columns=["x_cmd", "y_cmd", "z_cmd"]))
    with pytest.raises(WorkspaceError, match=r"row 2 .*limits"):
        simulate(crane(), poses((0.0, 0.0, 0.0), (0.0, 1.7, 0.0)))
    with pytest.raises(TableError, match="q3_cmd_rad is missing"):
        simulate(crane(), poses((0.0, 0.0, 0.0)).drop(columns="q3_cmd_rad"))
