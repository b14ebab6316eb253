"""Words against the virtual machine: hide a fault of either sign there, fit its effect, read the sentence."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch
from typer.testing import CliRunner

from ptt.challenge.challenge import bench as bench_machine
from ptt.commands.main import app
from ptt.diagnosis.evidence.at_tool import at_tool_um
from ptt.diagnosis.noise.slow import Slow
from ptt.diagnosis.noise.wander import Wander
from ptt.diagnosis.telling.verdict_words import explain_verdict
from ptt.diagnosis.telling.words import explain_step, sentence, sentences
from ptt.effects import library
from ptt.effects.layout import family
from ptt.effects.phrases import compose, figure, listed, scaled
from ptt.fitting import gauge
from ptt.fitting.gauge import Told, sparsest
from ptt.fitting.solve import fit, residual_of
from ptt.machine import format_machine, load_machine
from ptt.model.model import Model, Term
from ptt.rig.draw_arm import unweighed
from ptt.rig.rig import parse_rig
from ptt.rig.serial_arm import ArmFaults, ArmRig
from ptt.rig.simulate import simulate, write_run
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

MACHINE = bench_machine()
KNOWN = library()
ROWS = 110
SIGMA = 2e-4  # mm: the rounding of words, not the noise, is what is left
NOISE = Noise(np.eye(3) * SIGMA**2, "machine file")
CONDITIONS = {
    "cycles": 2,
    "payload_per_cycle_kg": [0.0, 4.0],
    "feed_per_cycle_mm_s": [15.0, 45.0],
    "room": {"rise_k": 8.0, "time_constant_s": 1500.0},
}


def hide(folder, faults, *, frame="fitted", machine=MACHINE, conditions=None, spread=(70.0, 70.0, 45.0)):
    """Run the virtual machine with some faults, and bring the readings into a problem."""
    file = replace(machine, tracker=machine.tracker.model_copy(update={"frame": frame}))
    tracker = {"white_mm": SIGMA, **faults.get("tracker", {})}
    drawing = tomllib.loads(format_machine(file))
    rig = parse_rig(
        {"seed": 5, "machine": drawing, "conditions": conditions or CONDITIONS, **faults, "tracker": tracker}
    )
    random = np.random.default_rng(11)
    targets = pd.DataFrame(random.uniform(-1, 1, (ROWS, 3)) * spread, columns=["x_cmd", "y_cmd", "z_cmd"])
    path = folder / "run.csv"
    write_run(simulate(rig, targets).frame, path)
    return build_problem(file, read_table(path)).with_noise(NOISE)


def say(problem, *names):
    model = Model(problem.file)
    for name in names:
        model = model + KNOWN[name]()
    fitted = fit(model, problem, noise=NOISE)
    return sentences(fitted.model.terms, problem, NOISE)


def sized(words, pattern):
    found = re.search(pattern, words)
    assert found, f"'{pattern}' is not in: {words}"
    return float(found[1].replace(",", ""))


def fault(section, key, leg, size, **more):
    values = [0.0, 0.0, 0.0]
    values[leg - 1] = size
    return {section: {key: values, **more}}


def hilly(heights, leg, sign):
    """A curve with neither level nor slope about the middle of the travel, highest there where the sign is plus."""
    rows = [[0.0] * len(heights)] * 3
    rows[leg - 1] = (20.0 * sign * np.cos(2.0 * np.pi * (heights - 283.0) / 80.0)).tolist()
    return rows


HEIGHTS = np.linspace(150.0, 420.0, 55)
N = r"([\d.]+)"
# effect, the rig's fault for a sign, what is said of it above and below zero, and the number.
BOTH = [
    ("homing-offset", lambda s: fault("drive", "homing_mm", 2, 0.25 * s),
     rf"Slider 2 stands {N} um higher than b", rf"Slider 2 stands {N} um lower than b", 250.0),
    ("homing-slip", lambda s: fault("drive", "slip_mm", 3, 0.06 * s, slip_row=90),
     rf"Slider 3 slips up by {N} um", rf"Slider 3 slips down by {N} um", 60.0),
    ("lead-scale", lambda s: fault("drive", "scale_um_per_m", 1, 200.0 * s),
     rf"Slider 1 travels {N} um/m too far", rf"Slider 1 travels {N} um/m not far enough", 200.0),
    ("backlash", lambda s: fault("drive", "backlash_mm", 2, 0.05) if s > 0
     else fault("controller", "backlash_mm", 2, 0.05),
     rf"Slider 2 loses {N} um on reversal: backlash", rf"Slider 2 compensates {N} um too much on reversal", 50.0),
    ("following-error", lambda s: {"conditions": {**CONDITIONS, "moving": True},
                                   **fault("drive", "following_s", 1, 0.02 * s)},
     rf"Slider 1 comes {N} ms late while moving", rf"Slider 1 comes {N} ms early while moving", 20.0),
    ("screw-growth", lambda s: {"thermal": {"growth_um_per_m_k": [0.0, 12.0 * s, 0.0], "fixed_end_mm": 282.84}},
     rf"Slider 2 grows {N} um/m/K with warmth", rf"Slider 2 shrinks {N} um/m/K with warmth", 12.0),
    ("axis-compliance", lambda s: fault("drive", "compliance_um_per_n", 3, 0.8 * s),
     rf"Slider 3 gives way by {N} um/N", rf"Slider 3 moves against the load by {N} um/N", 0.8),
    ("link-compliance", lambda s: fault("geometry", "link_compliance_um_per_n", 1, 0.6 * s),
     rf"Link 1 stretches {N} um/N of pull", rf"Link 1 shortens {N} um/N of pull", 0.6),
    ("tower-position", lambda s: fault("geometry", "tower_radial_mm", 1, 0.3 * s),
     rf"Tower 1 stands {N} um too far outward", rf"Tower 1 stands {N} um too far inward", 300.0),
    ("tower-position", lambda s: fault("geometry", "tower_tangential_mm", 2, 0.3 * s),
     rf"Tower 2 stands {N} um too far counter-clockwise", rf"Tower 2 stands {N} um too far clockwise", 300.0),
    ("tower-tilt", lambda s: fault("geometry", "lean_radial_mrad", 2, 1.5 * s),
     rf"Tower 2 leans outward by {N} mrad", rf"Tower 2 leans inward by {N} mrad", 1.5),
    ("tower-tilt", lambda s: fault("geometry", "lean_tangential_mrad", 3, 1.5 * s),
     rf"Tower 3 leans counter-clockwise \(seen from above\) by {N} mrad",
     rf"Tower 3 leans clockwise \(seen from above\) by {N} mrad", 1.5),
    ("link-length", lambda s: fault("geometry", "link_mm", 3, 0.2 * s),
     rf"Link 3 is {N} um too long", rf"Link 3 is {N} um too short", 200.0),
    ("platform-twist", lambda s: fault("geometry", "platform_axis_radial_mrad", 1, 2.0 * s),
     rf"Leg 1 has the platform's joint axis {N} mrad outward", rf"Leg 1 has the platform's joint axis {N} mrad inward",
     2.0),
    ("platform-twist", lambda s: fault("geometry", "platform_axis_vertical_mrad", 2, 2.0 * s),
     rf"Leg 2 has the platform's joint axis {N} mrad upward",
     rf"Leg 2 has the platform's joint axis {N} mrad downward", 2.0),
    ("column-bend", lambda s: {"structure": {"column_bend_um_per_kg": (8.0 * s, 0.0)}},
     rf"The column bends toward \+x by {N} um/kg of payload", rf"The column bends toward -x by {N} um/kg of payload",
     8.0),
    ("tracker-scale", lambda s: {"tracker": {"scale_ppm": 80.0 * s}},
     rf"The tracker reads lengths {N} um/m too long", rf"The tracker reads lengths {N} um/m too short", 80.0),
    ("tracker-drift", lambda s: {"tracker": {"drift_um_per_h": (0.0, 90.0 * s, 0.0)}},
     rf"drift {N} um toward \+y over the run: tracker drift, at an even pace", rf"drift {N} um toward -y over the run",
     None),
    ("setup-jump", lambda s: {"tracker": {"knock_row": 80, "knock_um": (0.0, 0.0, 70.0 * s)}},
     rf"jump {N} um toward \+z: knock of the tracker after \d+ s", rf"jump {N} um toward -z: knock", 70.0),
    ("screw-error-map", lambda s: {"drive": {"map_height_mm": HEIGHTS.tolist(), "map_um": hilly(HEIGHTS, 2, s)}},
     rf"[Ss]lider 2 .*up to {N} um high near b = 28\d mm", rf"[Ss]lider 2 .*up to {N} um low near b = 28\d mm", 20.0),
    ("guide-straightness", lambda s: {"geometry": {
        "straightness_height_mm": HEIGHTS.tolist(), "straightness_radial_um": hilly(HEIGHTS, 3, s)}},
     rf"[Tt]ower 3 .*up to {N} um outward near b = 28\d", rf"[Tt]ower 3 .*up to {N} um inward near b = 28\d", 20.0),
    ("guide-straightness", lambda s: {"geometry": {
        "straightness_height_mm": HEIGHTS.tolist(), "straightness_tangential_um": hilly(HEIGHTS, 1, s)}},
     rf"[Tt]ower 1 .*up to {N} um counter-clockwise \(seen from above\) near b = 28\d",
     rf"[Tt]ower 1 .*up to {N} um clockwise \(seen from above\) near b = 28\d", 20.0),
    ("once-per-rev", lambda s: fault("drive", "turn_um", 2, 6.0 * s, turn_phase_rad=[0.0, 1.0, 0.0]),
     rf"Slider 2 repeats an error of {N} um with every turn of the screw, highest 0\.\d+ mm in",
     rf"Slider 2 repeats an error of {N} um with every turn of the screw, highest 3\.3 mm in", 6.0),
    ("joint-offset", lambda s: fault("geometry", "joint_offset_rail_mm", 1, 0.1 * s),
     rf"Link 1 gets {N} um longer when turned along", rf"Link 1 gets {N} um shorter when turned along", 100.0),
    ("frame-growth", lambda s: {"thermal": {"frame_um_per_m_k": 24.0 * s}},
     rf"The base radius grows {N} um/m/K with warmth: ", rf"The base radius shrinks {N} um/m/K with warmth: ", 24.0),
    ("frame-growth", lambda s: {"thermal": {"frame_um_per_m_k": 24.4, "link_um_per_m_k": 9.0 * s}},
     rf"base radius grows 24 um/m/K with warmth, the links grow {N} um/m/K with warmth: frame",
     rf"base radius grows 24 um/m/K with warmth, the links shrink {N} um/m/K with warmth: frame", 9.0),
]  # fmt: skip


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("name", "faults", "plus", "minus", "size"), BOTH, ids=lambda v: v if isinstance(v, str) else ""
)
def test_the_side_that_was_hidden_is_said(tmp_path, name, faults, plus, minus, size, sign):
    problem = hide(tmp_path, faults(sign), conditions=faults(sign).get("conditions"))
    (words,) = say(problem, name)
    found = sized(words, plus if sign > 0 else minus)
    assert not re.search(minus if sign > 0 else plus, words)
    if size is not None:
        assert found == pytest.approx(size, rel=0.2 if "up to" in words else 0.06), words


def test_a_size_that_no_machine_has_asks_for_the_drawing(tmp_path):
    view = hide(tmp_path, {}).view
    for lean, asked in ((0.1, True), (0.01, False)):
        theta, std = torch.tensor([0.0, lean, 0.0, 0.0, 0.0, 0.0]), torch.full((6,), 1e-5)
        words = sentence(Told(Term(KNOWN["tower-tilt"](), theta, std=std)), view)
        assert ("(100 x its usual size: is the drawing right?)" in words) == asked


def test_a_knock_has_no_sliders_that_could_have_something_in_common(tmp_path):
    problem = hide(tmp_path, {})
    small = torch.tensor(
        [1e-5, 0.0, 1e-5, 0.0, 0.0, 0.0, 10.0], dtype=torch.float64
    )  # early, less than the readings tell
    (told,) = sparsest(
        [Term(KNOWN["setup-jump"](), small, std=torch.full((7,), 1e-4, dtype=torch.float64))], problem, NOISE
    )
    assert "against each other" not in sentence(told, problem.view)


@pytest.mark.parametrize(("label", "often"), [("harmonic 2", "twice every turn"), ("harmonic 3", "3 times every turn")])
def test_a_harmonic_repeats_more_than_once_a_turn(tmp_path, label, often):
    effect = replace(KNOWN["once-per-rev"](), label=label)
    theta = torch.tensor([0.0, 0.006, 0.0, 0.0, 0.0, 0.0, MACHINE.machine.screw_lead_mm / int(label[-1])])
    waves = effect.say(theta, torch.full((7,), 1e-4), hide(tmp_path, {}).view)
    assert f"{often} of the screw" in max(waves, key=lambda wave: wave.size).text


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_side_of_a_trusted_frame_is_said(tmp_path, sign):
    faults = {"tracker": {"translation_mm": (0.3 * sign, 0.0, 0.0), "rotation_mrad": (0.0, 0.0, -0.4 * sign)}}
    (words,) = say(hide(tmp_path, faults, frame="trusted"), "tracker-frame")
    side, turn = ("+", "clockwise") if sign > 0 else ("-", "counter-clockwise")
    assert sized(words, rf"are shifted {N} um toward \{side}x") == pytest.approx(300.0, rel=0.02)
    assert sized(words, rf" turned {N} urad {turn} about z") == pytest.approx(400.0, rel=0.02)


def test_what_has_one_side_only_is_said(tmp_path):
    (words,) = say(hide(tmp_path, fault("drive", "windup_um", 3, 12.0)), "windup")
    assert sized(words, rf"Slider 3 changes over gradually by {N} um after a reversal") == pytest.approx(24.0, rel=0.05)
    assert sized(words, rf"wind-up, over {N} mm of travel") == pytest.approx(1.0, abs=0.2)
    far = hide(tmp_path, fault("geometry", "clearance_um", 2, 40.0), spread=(95.0, 95.0, 30.0))
    (words,) = say(far, "joint-clearance")
    assert sized(words, rf"Link 2 has {N} um of play") == pytest.approx(40.0, rel=0.1)


ARM = load_machine(Path(__file__).resolve().parents[1] / "data" / "machines" / "ur10.toml")


def hide_in_arm(payload=None, warmth=None, **faults):
    """Read a virtual arm with some faults."""
    own = {"sigma_mm": SIGMA, "frame": "fitted", "tool": "fitted"}
    file = replace(ARM, machine=unweighed(ARM.machine), tracker=ARM.tracker.model_copy(update=own))
    rig = ArmRig(file.machine, replace(ArmFaults.none(6), **faults), np.zeros(3), np.eye(4), SIGMA)
    q = np.random.default_rng(4).uniform(-1.5, 1.5, (160, 6))
    load = np.zeros(len(q)) if payload is None else payload
    temp = np.full(len(q), 20.0) if warmth is None else warmth
    table = make_table(None, q, rig.measure(q, load, temp, 3), payload_kg=load, temp_c=temp)
    return build_problem(file, table).with_noise(NOISE)


def only(joint, value, width=None):
    values = np.zeros(6) if width is None else np.zeros((6, width))
    values[joint - 1] = value
    return values


LOADS, WARMTH = np.tile([0.0, 5.0], 80), np.linspace(15.0, 30.0, 160)
ARMS = [
    ("homing-offset", lambda s: {"link": only(3, [0, 0, 0, 2e-3 * s], 4)},
     rf"Joint 3 stands {N} mrad beyond q toward \+", rf"Joint 3 stands {N} mrad beyond q toward -", 2.0),
    ("dh-offsets", lambda s: {"link": only(2, [0.8 * s, 0, 0, 0], 4)},
     rf"Link 2 is {N} um too long", rf"Link 2 is {N} um too short", 800.0),
    ("dh-offsets", lambda s: {"link": only(4, [0, 2e-3 * s, 0, 0], 4)},
     rf"Link 4 is twisted {N} mrad too far", rf"Link 4 is twisted {N} mrad too little", 2.0),
    ("dh-offsets", lambda s: {"link": only(5, [0, 0, 0.7 * s, 0], 4)},
     rf"Link 5 has {N} um too much offset along", rf"Link 5 has {N} um too little offset along", 700.0),
    ("axis-compliance", lambda s: {"compliance": only(2, 2e-8 * s), "payload": LOADS},
     rf"Joint 2 gives way by {N} urad/N m", rf"Joint 2 moves against the load by {N} urad/N m", 20.0),
    ("frame-growth", lambda s: {"growth": 2e-5 * s, "warmth": WARMTH},
     rf"lengths along x grow {N} um/m/K", rf"lengths along x shrink {N} um/m/K", 20.0),
]  # fmt: skip


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("name", "faults", "plus", "minus", "size"), ARMS, ids=lambda v: v if isinstance(v, str) else ""
)
def test_the_side_that_was_hidden_in_an_arm_is_said(name, faults, plus, minus, size, sign):
    (words,) = say(hide_in_arm(**faults(sign)), name)
    assert sized(words, plus if sign > 0 else minus) == pytest.approx(size, rel=0.06), words
    assert not re.search(minus if sign > 0 else plus, words)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_way_an_arm_sags_is_said(sign):
    mass = np.zeros((6, 4))
    mass[1] = [12.0, -300.0, 0.0, 0.0]
    compliance = only(2, 1.5e-8 * sign)
    problem = hide_in_arm(compliance=compliance, mass=mass)
    (words,) = say(problem, "self-weight")
    rig = ArmRig(unweighed(ARM.machine), replace(ArmFaults.none(6), mass=mass), np.zeros(3), np.eye(4), 0.0)
    true = np.array([compliance[1] * rig._torque(row, 1, 0.0, 1.0) for row in problem.view.q.numpy()])
    worst = true[np.abs(true).argmax()]
    said = sized(words, rf"Joint 2 sags up to {N} mrad toward \{'+' if worst > 0 else '-'}")
    assert said == pytest.approx(1e3 * abs(worst), rel=0.05)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_where_a_joint_runs_ahead_is_said(sign):
    wobble = np.zeros((6, 1, 2))
    wobble[2, 0, 0] = 4e-4 * sign
    (words,) = say(hide_in_arm(wobble=wobble), "joint-error-map")
    way = "ahead" if sign > 0 else "behind"
    assert sized(words, rf"oint 3 [^,]*up to {N} urad {way} at q = ") == pytest.approx(400.0, rel=0.25)
    assert abs(sized(words, rf"oint 3 [^,]* urad {way} at q = (-?\d+) deg")) < 25.0


# Gauges: what can be turned, and what it cannot be told from.


def test_one_slider_is_one_slider_whatever_the_frame(tmp_path):
    faults = fault("drive", "homing_mm", 2, -0.25)
    (fitted,) = say(hide(tmp_path, faults), "homing-offset")
    assert re.match(
        r"Slider 2 stands 250 um lower than b says: homing \(sliders against each other; .*tracker's z\)", fitted
    )
    (trusted,) = say(hide(tmp_path, faults, frame="trusted"), "homing-offset")
    mended = "To set right: raise slider 2 by 250 um (18 deg of its screw)."
    assert trusted == f"Slider 2 stands 250 um lower than b says: homing. {mended}"
    assert fitted.endswith(mended)


@pytest.mark.parametrize(("section", "key", "name"), [
    ("drive", "homing_mm", "homing-offset"), ("geometry", "link_mm", "link-length"),
    ("geometry", "tower_radial_mm", "tower-position"), ("geometry", "tower_tangential_mm", "tower-position"),
    ("geometry", "lean_radial_mrad", "tower-tilt"), ("geometry", "lean_tangential_mrad", "tower-tilt"),
])  # fmt: skip
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_turned_as_told_is_right(tmp_path, section, key, name, sign):
    """The rig is mended by the side and the number that were said, and is then as good as drawn."""
    size = (1.5 if "mrad" in key else 0.3) * sign
    (words,) = say(hide(tmp_path, fault(section, key, 2, size)), name)
    told = re.search(rf"To set right: (.*?) (?:slider|link|tower) 2 ?(.*?) by {N} (um|mrad)", words)
    assert told, words
    less = {
        "lower",
        "shorten",
        "move inward",
        "move clockwise",
        "shim the head of inward",
        "shim the head of clockwise",
    }
    turned = float(told[3]) * (1e-3 if told[4] == "um" else 1.0)
    left = size - turned if f"{told[1]} {told[2]}".strip() in less else size + turned
    assert abs(left) < 0.02 * abs(size)


def test_two_towers_are_two_towers(tmp_path):
    faults = {"geometry": {"tower_tangential_mm": [0.2, 0.0, 0.0], "tower_radial_mm": [0.0, -0.3, 0.0]}}
    (words,) = say(hide(tmp_path, faults), "tower-position")
    assert sized(words, rf"tower 1 stands {N} um too far counter-clockwise") == pytest.approx(200.0, rel=0.02)
    assert sized(words, rf"Tower 2 stands {N} um too far inward") == pytest.approx(300.0, rel=0.02)
    assert "tower 3" not in words and "the tracker's x and y and its rotation about z" in words


def test_a_lean_is_not_spread_over_zeros_and_towers(tmp_path):
    problem = hide(tmp_path, fault("geometry", "lean_radial_mrad", 1, 1.5))
    homing, lean = say(problem, "homing-offset", "tower-tilt")
    assert re.search(r"Tower 1 leans outward by 1\.5 mrad: ", lean)
    assert "no more than chance" in homing or sized(homing, rf"{N} um") < 5.0
    assert "rotation about x and y" in lean


def test_a_gauge_moves_no_reading(tmp_path):
    problem = hide(tmp_path, {"drive": {"homing_mm": [0.1, -0.25, 0.0]}, "geometry": {"tower_radial_mm": [0, 0.2, 0]}})
    model = Model(problem.file) + KNOWN["homing-offset"]() + KNOWN["tower-position"]()
    fitted = fit(model, problem, noise=NOISE)
    told = sparsest(fitted.model.terms, problem, NOISE)
    moved = replace(fitted.model, terms=tuple(one.term for one in told))
    held = residual_of(moved, problem, NOISE)
    assert np.abs(held.residual - fitted.residual).max() < SIGMA
    assert told[0].alike == ("tracker z",)
    assert told[1].alike == ("tracker x", "tracker y", "tracker rotation about z")
    assert sum(float((one.term.theta.abs() > 10.0 * SIGMA).sum()) for one in told) == 3.0


def test_the_error_of_a_value_counts_what_the_readings_have_to_tell_it_from(tmp_path):
    """Of towers that stand off, and may lean as well."""
    problem = hide(tmp_path, fault("geometry", "tower_radial_mm", 2, 0.2))
    model = Model(problem.file) + KNOWN["tower-position"]() + KNOWN["tower-tilt"]()
    place, lean = fit(model, problem, noise=NOISE).model.terms
    (alone,), (beside,) = sparsest([place], problem, NOISE), sparsest([place], problem, NOISE, beside=[lean])
    assert torch.allclose(alone.term.theta, beside.term.theta) and alone.alike == beside.alike
    off = alone.term.std > 0.0
    (loose,) = sparsest([place], problem, NOISE, loose=lambda names: 0.01 * np.eye(len(names)))
    assert (loose.term.std[off] > 5.0 * alone.term.std[off]).all() and (loose.term.std[~off] == 0.0).all()
    assert off.any() and (beside.term.std[off] > 1.2 * alone.term.std[off]).all()


def test_what_cannot_be_told_does_not_hang_on_the_directions_that_stand_for_it(tmp_path, monkeypatch):
    """Where noise hides all of a tower's shifts, those that the tracker makes good for are among them all."""
    problem, small = hide(tmp_path, {}), torch.full((6,), 1e-3, dtype=torch.float64)
    term = Term(KNOWN["tower-position"](), small, std=small)
    mixed, untold = np.linalg.qr(np.random.default_rng(3).normal(size=(6, 6)))[0], gauge._untold
    monkeypatch.setattr(gauge, "_untold", lambda *given: untold(*given) @ mixed)
    (told,) = sparsest([term], problem, Noise(np.eye(3), "wide"))
    assert told.alike == ("tracker x", "tracker y", "tracker rotation about z")


def test_add_prints_what_to_turn_and_no_digit_that_chance_would_make(tmp_path):
    faults = fault("drive", "homing_mm", 2, -0.25) | {"controller": {"backlash_mm": [0.0, 0.0, 0.02]}}
    problem = hide(tmp_path, faults)
    machine = tmp_path / "machine.toml"
    machine.write_text(format_machine(problem.file))
    known = ["add", str(tmp_path / "run.csv"), "homing-offset", "--model", str(machine)]
    outcome = CliRunner().invoke(app, [*known, "--out", str(tmp_path / "m.toml")])
    assert outcome.exit_code == 0, outcome.output
    (homing,) = (line for line in outcome.stdout.splitlines() if ": homing" in line)
    assert re.search(r"To set right: raise slider 2 by 2[45]\d um \(1\d deg of its screw\)", homing)
    assert "slider 1" not in homing  # what 20 um of over-compensation leave is far beyond the tracker's noise


# Steps and verdicts.


def candidate(**values):
    return SimpleNamespace(**{"effect": "a", "words": "A.", "sum_of": (), **values})


def diagnosis(verdict, *, steps=0, ties=(), depends=0, reasons=("the readings scatter",), wander=None, after=0.3,
              probability=0.9, terms=(), **on):  # fmt: skip
    found = {"residual": "slider 2", "on": "b2", "share": 0.4, "period_mm": 3.1, "shape": "smooth", "place": None}
    found = SimpleNamespace(**{**found, "with_": None, "acts_on": None, "unit": "mm", "words": "It is large.", **on})
    return SimpleNamespace(
        verdict=verdict,
        verdict_probability={verdict: probability},
        suggested=[(term.effect.key,) for term in terms] or [(f"effect-{number}", *ties) for number in range(steps)],
        model=SimpleNamespace(terms=terms),
        candidates=[candidate(words=f"Words of {number}.") for number in range(steps + 9)],
        depends_on=[found] * depends,
        rest=SimpleNamespace(reasons=reasons),
        noise=NOISE,
        rms_um={"before": {"total": 90.0}, "after": {"total": after}},
        rows=110,
        wander=wander,
        elsewhere=None,
    )


def test_a_tie_comes_first_and_nothing_else_does_not_stand_beside_it(tmp_path):
    problem = hide(tmp_path, fault("drive", "backlash_mm", 2, 0.05))
    term = fit(Model(problem.file) + KNOWN["backlash"](), problem, noise=NOISE).model.terms[0]
    tied = explain_step(term, ("windup", "joint-clearance"), (), (62.0, 9.0), NOISE, problem)
    assert tied.startswith(
        "Either backlash, windup or joint-clearance: this data cannot tell them apart. As backlash: s"
    )
    assert "Nothing else" not in tied
    summed = explain_step(term, (), ("lead-scale", "link-length"), (62.0, 9.0), NOISE, problem)
    assert summed.startswith("Either backlash, or lead-scale and link-length together would do the same: this data")
    assert "Nothing else" not in summed
    alone = explain_step(term, (), (), (62.0, 9.0), NOISE, problem, after=("windup",))
    assert "Nothing else explains it as well; the held-out error after windup falls from 62.0 to 9.0 um" in alone


def test_values_beyond_the_error_come_with_what_they_do_at_the_tool(tmp_path):
    """A length is no error of the tool; where effects cancel one another, that is said."""
    problem = hide(tmp_path, fault("drive", "backlash_mm", 2, 0.05))
    term = fit(Model(problem.file) + KNOWN["backlash"](), problem, noise=NOISE).model.terms[0]
    makes = at_tool_um(term, problem)
    assert 10.0 < makes < 50.0
    assert "at the tool" not in explain_step(term, (), (), (62.0, 9.0), NOISE, problem)
    told = explain_step(term, (), (), (40.0, 9.0), NOISE, problem)
    assert f"; at the tool it makes {makes:.0f} um rms." in told
    part, most = (explain_step(term, (), (), (makes / far, 0.0), NOISE, problem) for far in (2.0, 9.0))
    assert "um rms, a part of which the other effects take back" in part
    assert "um rms, most of which the other effects take back" in most


def test_what_changes_readings_alone_is_not_said_of_the_tool(tmp_path):
    problem = hide(tmp_path, {"tracker": {"scale_ppm": 300.0}})
    term = fit(Model(problem.file) + KNOWN["tracker-scale"](), problem, noise=NOISE).model.terms[0]
    told = explain_step(term, (), (), (4.0, 0.5), NOISE, problem)
    assert "; in the readings it makes " in told and "at the tool" not in told


def test_an_error_that_rises_or_stays_is_not_said_to_fall(tmp_path):
    problem = hide(tmp_path, fault("drive", "backlash_mm", 2, 0.05))
    term = fit(Model(problem.file) + KNOWN["backlash"](), problem, noise=NOISE).model.terms[0]
    rises, stays = (explain_step(term, (), (), errors, NOISE, problem) for errors in ((62.0, 63.0), (61.96, 62.04)))
    assert "rises from 62.0 to 63.0 um" in rises and "stays at 62.0 um" in stays
    assert "Nothing else explains it" not in rises + stays


def test_an_exact_ambiguity_is_not_called_unrivalled(tmp_path):
    problem = hide(tmp_path, fault("drive", "homing_mm", 2, -0.25))
    term = fit(Model(problem.file) + KNOWN["homing-offset"](), problem, noise=NOISE).model.terms[0]
    words = explain_step(term, (), (), (62.0, 9.0), NOISE, problem)
    assert "cannot be told from the tracker's z" in words and "Nothing else" not in words


@pytest.mark.parametrize("steps", [0, 1, 2, 3, 9])
@pytest.mark.parametrize("depends", [0, 1, 7])
def test_an_unknown_takes_five_lines_at_the_most(steps, depends):
    words = explain_verdict(diagnosis("unknown", steps=steps, depends=depends)).splitlines()
    assert len(words) <= 5 and len(set(words)) == len(words)
    assert words[0].startswith("Something is missing that no known effect describes")
    assert any("follows b2" in line for line in words) == (depends > 0)
    assert (f"effect-{steps - 1}" in " ".join(words) or f"Words of {steps - 1}." in " ".join(words)) or steps == 0


def test_a_verdict_that_tests_of_the_rest_gave_says_which():
    words = explain_verdict(diagnosis("unknown", depends=1, probability=0.5))
    assert words.startswith("Something is missing that no known effect describes: the readings scatter.")
    assert "the readings scatter" not in explain_verdict(diagnosis("unknown", depends=1))


def test_a_law_that_follows_what_the_unknown_follows_may_be_bent():
    soft, zero = (SimpleNamespace(effect=KNOWN[name]()) for name in ("axis-compliance", "homing-offset"))
    words = explain_verdict(diagnosis("unknown", depends=1, terms=(soft, zero), on="payload"))
    assert "As axis-compliance follows payload too, its law may be bent rather than another cause missing" in words
    assert "bent" not in explain_verdict(diagnosis("unknown", depends=1, terms=(soft, zero), on="temperature"))
    assert "bent" not in explain_verdict(diagnosis("unknown", depends=1, terms=(zero,), on="payload"))


def test_a_jump_is_said_by_its_place_and_a_slow_rest_by_its_wander():
    """A range 'between 16 and 16' tells nobody anything; that noise is understated is no news where it wanders."""
    jump = explain_verdict(diagnosis("unknown", depends=1, period_mm=None, shape="step", place=(15.98, 16.02)))
    assert "What is left of slider 2 jumps where b2 passes 16.00 mm (40% of its variance). It is large." in jump
    bump = explain_verdict(diagnosis("unknown", depends=1, period_mm=None, shape="local", place=(41.0, 62.0)))
    assert "follows b2 near 52 mm (40%" in bump
    floor = NOISE.total * 1e3
    for span, unit, lasts in ((900.0, "s", "about 320 s"), (40.0, "readings", "longer than the run")):
        wander, r = Slow(Wander(4.0, 317.0), span, unit), 317.0 / span
        within = 2.0 * np.sqrt(1.0 - 2.0 * r + 2.0 * r**2 * (1.0 - np.exp(-1.0 / r)))  # about its mean in the run
        slow = explain_verdict(diagnosis("nothing-missing", after=3.0 * floor, wander=wander))
        assert f"the readings wander by {within * floor:.1f} um, over {lasts}." in slow and "understate" not in slow
    assert wander.to_dict() == {"share": 4.0, "constant_s": None, "constant_rows": 317.0}
    assert "understate" in explain_verdict(diagnosis("nothing-missing", after=3.0 * floor))


def test_a_noise_that_only_the_rest_tells_is_said_to_hide_what_is_rough():
    told = diagnosis("nothing-missing")
    told.noise = replace(NOISE, source="saturated model")
    assert "would hide in it; repeats of some poses" in explain_verdict(told)
    assert "hide" not in explain_verdict(diagnosis("nothing-missing"))


def test_other_verdicts_say_what_they_have_and_how_well():
    words = explain_verdict(diagnosis("missing", steps=2))
    assert words.startswith("Words of 0.\nWords of 1.\nWith that the error is 0.3 um, down from 90.0 um")
    late = explain_verdict(diagnosis("missing", steps=1, ties=("other",)))
    assert "Words of 0." in late
    assert explain_verdict(diagnosis("nothing-missing")).startswith("Nothing is missing that these 110 readings")


@pytest.mark.parametrize(
    ("value", "text"),
    [(250.4, "250"), (41.3, "41"), (9.96, "10.0"), (5.04, "5.0"), (0.2, "0.20"), (0.0341, "0.034"), (100.0, "100")],
)
def test_figures_have_two_digits_that_count(value, text):
    assert figure(value) == text


def test_every_effect_is_said_somewhere_here():
    told = {case[0] for case in (*BOTH, *ARMS)}
    assert set(KNOWN) == told | {"tracker-frame", "windup", "joint-clearance", "self-weight", "joint-error-map"}


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return hide(tmp_path_factory.mktemp("sound"), {})


NUMBER = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)(?= (?:n|u|m)?(?:m|rad|s)\b|[,\d. ]* and)")


@pytest.mark.parametrize("name", [name for name, effect in KNOWN.items() if "three-ptt" in effect.mechanisms])
@pytest.mark.parametrize("times", [2e-3, 1.0, 50.0, 3000.0])
def test_any_size_of_any_effect_is_said_with_a_prefix_and_its_side(sound, name, times):
    """Small, usual and off the scale: no row of noughts, no powers of ten, and the other sign in other words."""
    effect, view = KNOWN[name](), sound.view
    usual = [p.usual for p in (q.on(family(view)) for q in effect.parameters) for _ in range(p.size(view.joints))]
    theta = times * torch.tensor(usual, dtype=torch.float64)
    plus, minus = (compose(effect.say(s * theta, 0.01 * theta, view), effect.noun) for s in (1.0, -1.0))
    assert plus != minus and not re.search(r"\de[+-]\d|-0 ", plus + minus)
    sizes = [float(found) for found in NUMBER.findall(plus.split(" near ")[0].split(", highest")[0])]
    assert all(size < 10_000.0 for size in sizes), plus
    assert not sizes or max(sizes) >= 0.01, plus


def test_the_prefix_is_that_of_all_sizes_together():
    assert scaled([25_000.0, 10_000.0], "um") == (1e-3, "mm") and scaled([999.0, 2000.0], "um") == (1.0, "um")
    assert scaled([4e-4, 1e-4], "\N{MICRO SIGN}m/N") == (1e3, "nm/N") and scaled([60_000.0], "ms") == (1e-3, "s")
    assert scaled([3e6], "urad") == (1e-6, "rad") and scaled([5e9], "kg") == (1.0, "kg") and scaled([], "um")[1] == "um"


def test_a_list_of_nothing_is_no_error() -> None:
    lists = [listed(["a", "b", "c"][:count]) for count in range(4)]
    assert lists == ["", "a", "a and b", "a, b and c"]


def test_repeats_that_scatter_by_far_more_than_is_stated_are_said_to():
    told = diagnosis("nothing-missing")
    told.noise = replace(NOISE, source="repeats", stated=("std columns", NOISE.total / 2.5))
    words = explain_verdict(told)
    assert "(repeats, 2.5 x what the std columns state). Poses come back that badly, or something differs" in words
    told.noise = replace(told.noise, stated=("machine file", NOISE.total / 1.2))
    assert "state" not in explain_verdict(told)


def test_values_that_are_chance_are_said_to_be_no_more():
    """One sentence for values whose sum is sure and for values that are nothing: no word says that they are."""
    arm = hide_in_arm().view
    theta = torch.tensor([1e-6, -2e-6] + [0.0] * (arm.joints - 2), dtype=torch.float64)
    words = compose(KNOWN["lead-scale"]().say(theta, torch.full_like(theta, 3e-6), arm), "joint")
    assert "urad/rad not far enough" in words and "none of these is beyond chance by itself" in words
