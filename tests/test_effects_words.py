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

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.telling.words import sentence, sentences
from ptt.effects import Curve, library
from ptt.effects.phrases import compose
from ptt.fitting.gauge import GaugedTerm, sparsest
from ptt.fitting.solve import fit
from ptt.machine import format_machine, load_machine
from ptt.mechanisms.serial import Serial
from ptt.model.model import Model, Term
from ptt.rig.draw_arm import unweighed
from ptt.rig.rig_file import parse_rig
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
        words = sentence(GaugedTerm(Term(KNOWN["tower-tilt"](), theta, std=std)), view)
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
     rf"Link 2 is {N} um too short", rf"Link 2 is {N} um too long", 800.0),  # drawn with a = -612 mm
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


@pytest.mark.parametrize("drawn", [120.0, 0.0, -120.0])
def test_too_much_and_too_little_go_by_the_side_that_the_drawing_has(drawn):
    joints = [
        joint.model_copy(update={"a_mm": drawn, "d_mm": drawn, "alpha_deg": drawn}) for joint in ARM.machine.joint
    ]
    view = SimpleNamespace(
        mechanism=Serial.from_spec(ARM.machine.model_copy(update={"joint": joints})), joints=6, lead=None
    )
    theta = torch.full((30,), 1e-3, dtype=torch.float64)
    said = " ".join(part.text for part in KNOWN["dh-offsets"]().say(theta, theta, view))
    assert all(said.count(word) == 6 * (drawn >= 0.0) for word in ("too long", "too far", "too much"))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_way_an_arm_sags_is_said(sign):
    mass = np.zeros((6, 4))
    mass[1] = [12.0, -300.0, 0.0, 0.0]
    compliance = only(2, 1.5e-8 * sign)
    problem = hide_in_arm(compliance=compliance, mass=mass)
    (words,) = say(problem, "self-weight")
    rig = ArmRig(unweighed(ARM.machine), replace(ArmFaults.none(6), mass=mass), np.zeros(3), np.eye(4), 0.0)
    true = compliance[1] * rig.torques(problem.view.q.numpy(), 0.0)[:, 1]
    worst = true[np.abs(true).argmax()]
    said = sized(words, rf"Joint 2 sags up to {N} mrad toward \{'+' if worst > 0 else '-'}q")
    assert said == pytest.approx(1e3 * abs(worst), rel=0.05)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_where_a_joint_runs_ahead_is_said(sign):
    wobble = np.zeros((6, 1, 2))
    wobble[2, 0, 0] = 4e-4 * sign
    (words,) = say(hide_in_arm(wobble=wobble), "joint-error-map")
    way = "ahead" if sign > 0 else "behind"
    assert sized(words, rf"oint 3 [^,]*up to {N} urad {way} at q = ") == pytest.approx(400.0, rel=0.25)
    assert abs(sized(words, rf"oint 3 [^,]* urad {way} at q = (-?\d+) deg")) < 25.0


def test_every_effect_is_said_somewhere_here():
    told = {case[0] for case in (*BOTH, *ARMS)}
    assert set(KNOWN) == told | {"tracker-frame", "windup", "joint-clearance", "self-weight", "joint-error-map"}


def test_values_that_are_chance_are_said_to_be_no_more():
    """One sentence for values whose sum is sure and for values that are nothing: no word says that they are."""
    arm = hide_in_arm().view
    theta = torch.tensor([1e-6, -2e-6] + [0.0] * (arm.joints - 2), dtype=torch.float64)
    words = compose(KNOWN["lead-scale"]().say(theta, torch.full_like(theta, 3e-6), arm), "joint")
    assert "urad/rad not far enough" in words and "none of these alone is beyond chance" in words


class Drift(Curve):
    """What of slider 2 follows its height: an effect whose values have no words."""

    name = "height-drift"
    mechanisms = ("three-ptt",)
    on, shape = "b2", "smooth"
    between = (200.0, 350.0)


def test_sizes_of_which_no_value_is_sure_are_named_in_one_line(tmp_path):
    """But what was asked for by name has its own sentence, and so has a size with a value beyond its error."""
    problem = hide(tmp_path, fault("drive", "homing_mm", 2, 0.25))
    terms = fit(
        Model(problem.file) + KNOWN["homing-offset"]() + KNOWN["tower-tilt"]() + KNOWN["link-length"](),
        problem,
        noise=NOISE,
    ).model.terms
    sizes = {term.effect.key for term in terms}
    homing, last = sentences(terms, problem, NOISE, 20.0, brief=sizes)
    assert homing.startswith("Slider 2 stands")
    assert last == "Fitted as well, with no single value beyond its error: link-length and tower-tilt."
    assert len(sentences(terms, problem, NOISE, 20.0, brief=sizes - {"link-length"})) == 3


def test_an_effect_without_words_is_told_by_its_size_at_the_tool(tmp_path):
    problem = hide(tmp_path, fault("drive", "scale_um_per_m", 2, 400.0))
    terms = fit(Model(problem.file) + Drift(), problem, noise=NOISE).model.terms
    (words,) = sentences(terms, problem, NOISE)
    assert sized(words, rf"Height-drift moves the tool by {N} um rms in this run") > 1.0
