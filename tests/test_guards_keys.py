"""Values of keys, of steps and of notes: taken or refused by their key in few words."""

import json
import re
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given
from small_files import BARE, QUICK

from ptt.correct.training.notes import check_notes
from ptt.documents import parse_toml
from ptt.errors import InputError, MachineError
from ptt.judge.history import read_entries
from ptt.machine import ThreePttSpec, format_machine, parse_machine
from ptt.model.entries import read_model

ROOT = Path(__file__).resolve().parents[1]


KEYS = [*ThreePttSpec.model_fields, "colour"]
VALUES = st.recursive(
    st.one_of(
        st.booleans(), st.integers(), st.floats(), st.text(max_size=80), st.sampled_from([1e308, 1e-308, 10**400])
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.sampled_from(["a", "b"]), inner, max_size=2)
    ),
    max_leaves=6,
)


def toml_of(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(toml_of, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml_of(item)}" for key, item in value.items()) + "}"
    return json.dumps(value) if isinstance(value, str) else repr(value)


@QUICK
@given(key=st.sampled_from(KEYS), value=VALUES)
def test_any_value_of_any_key_is_taken_or_refused_by_its_key(key, value):
    kept = [line for line in BARE.splitlines() if not line.startswith(f"{key} =")]
    try:
        machine = parse_machine("\n".join([*kept, f"{key} = {toml_of(value)}"]) + "\n").machine
    except MachineError as error:
        assert len(str(error)) < 700 and str(error).isprintable()
    else:
        assert np.isfinite(getattr(machine, "link_length_mm"))  # noqa: B009


FIGURES = {"x": 1.0, "y": 2.0, "z": 3.0, "total": 4.0}
STEP = {
    "date": "2026-03-15T10:00:00+00:00", "command": "add", "kind": "added", "added": ["backlash"], "rows": 80,
    "helped": True, "files": [{"file": "a.csv", "sha256": "00"}], "ranges": {"temp_c": [20.0, 22.0]},
    "error_before_um": FIGURES, "error_after_um": FIGURES, "heldout_before_um": FIGURES, "heldout_after_um": FIGURES,
    "noise_um": {**FIGURES, "source": "repeats"}, "parameters_before": {"backlash": {"gap_mm": [0.1, 0.2, 0.3]}},
}  # fmt: skip


@QUICK
@given(key=st.sampled_from(sorted(STEP)), inner=st.integers(0, 3), value=VALUES)
@example(key="ranges", inner=1, value=[False, "0"])
def test_any_value_in_a_step_of_the_history_is_taken_or_refused_by_the_file(key, inner, value):
    """What is taken can be used: a total that is a list was found out by the verb that needed it, as an accident."""
    held = STEP[key]
    if inner and isinstance(held, dict):
        value = {**held, sorted(held)[inner % len(held)]: value}
    elif inner and isinstance(held, list):
        value = [*held[:-1], value]
    text = "[[history]]\n" + "".join(f"{name} = {toml_of(item)}\n" for name, item in {**STEP, key: value}.items())
    try:
        file = parse_machine(BARE + text)
        (step,) = read_entries(file) or (None,)
    except MachineError as error:
        assert len(str(error)) < 700 and str(error).isprintable()
        return
    if step is not None:
        assert all(isinstance(figures["total"], float) for figures in (step.heldout_after_um, step.noise_um))
        assert all(low <= 1e12 and high <= 1e12 for low, high in file.history[0]["ranges"].values())
    assert "[[history]]" in format_machine(file)


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 5000 + "]" * 5000, "a." * 3000 + "b = 1", "a = " + "9" * 5000, "a = 1e400"]
)
def test_deep_and_endless_toml_is_refused(text):
    with pytest.raises(InputError) as caught:
        parse_toml(text, "m.toml")
    assert str(caught.value).startswith("m.toml") and len(str(caught.value)) < 300


NOTES = {
    "format": 1,
    "sha256": {"model.toml": "a", "rbf.safetensors": "b"},
    "trained_on": [{"file": "run.csv", "sha256": "c"}],
    "heldout_rms_um": {"physics": {"x": 1.0, "y": 1.0, "z": 1.0, "total": 1.7}},
    "protocol": "blocks",
    "rbf": {"centres": 8, "spread": 1.0, "learned": [True, True, False], "share": 0.5, "inputs": "tool"},
}  # fmt: skip


PATHS = ["format", "sha256", "trained_on", "heldout_rms_um", "heldout_rms_um.physics", "heldout_rms_um.physics.total"]
USED = ("rbf", "rbf.centres", "rbf.learned", "rbf.share", "protocol", "trained_on", "heldout_rms_um")  # by the report


@pytest.mark.parametrize("path", USED)
@pytest.mark.parametrize("gone", [True, False])
def test_what_a_report_reads_of_a_compensator_is_there(path, gone):
    notes = json.loads(json.dumps(NOTES))
    *above, last = path.split(".")
    holder = notes[above[0]] if above else notes
    if gone:
        del holder[last]
    else:
        holder[last] = None
    with pytest.raises(InputError, match=re.escape(f"compensator.json, {path}")):
        check_notes(notes, "comp")


@QUICK
@given(
    path=st.sampled_from([*PATHS, "rbf", "rbf.learned", "rbf.centres"]).map(lambda text: text.split(".")), value=VALUES
)
def test_notes_of_a_compensator_are_of_their_kind_or_refused_by_key(path, value):
    notes = json.loads(json.dumps(NOTES))
    assert check_notes(notes, "comp") == NOTES
    holder = notes
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    try:
        kept = check_notes(notes, "comp")
    except InputError as error:
        assert f"compensator.json, {'.'.join(path)}" in str(error) and len(str(error)) < 500
    else:
        assert type(kept["format"]) is int and isinstance(kept["sha256"], dict)


@pytest.mark.parametrize("sigma", ["1e-308", "1e-12", "0.0", "-1.0"])
def test_a_scatter_that_no_tracker_has_is_refused_by_its_key(sigma):
    with pytest.raises(MachineError, match=r"machine\.toml key tracker\.sigma_mm"):
        parse_machine(f"{BARE}[tracker]\nsigma_mm = {sigma}\n")


@pytest.mark.parametrize("azimuth", ["[0, 120, 0]", "[0, 120, 119.9999]", "[0, 360, 240]", "[-1e9, 120, 240]"])
def test_sliders_at_one_azimuth_are_refused_by_the_key(azimuth):
    with pytest.raises(MachineError, match=r"machine\.toml key machine\.slider_azimuth_deg: .*azimuth"):
        parse_machine(f"{BARE}slider_azimuth_deg = {azimuth}\n")
    assert parse_machine(f"{BARE}slider_azimuth_deg = [-120, 0, 120]\n").machine.kind == "three-ptt"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("slider_azimuth_deg = [true, 120, 240]", r"machine\.slider_azimuth_deg\[1\]: .*\(found True\); write it as a"),
        ('joint_height_mm = "3"', r"machine\.joint_height_mm: .*\(found '3'\); write it as a plain number"),
        ("reference_temp_c = 293", r"machine\.reference_temp_c: .*\(found 293.*\); give it in degrees C, such as 20"),
        ("[tracker]\nsigma_mm = -0.004", r"tracker\.sigma_mm: has to be above zero .found -0\.004.; write a positive"),
        ('[[effect]]\nname = "backlash"\n[effect.parameters]\ngap_mm = {value = [1, 1, 1], std = [0.1, -0.1, 0.1]}',
         r"effect\[1\]\.parameters\.gap_mm\.std\[2\]: .*\(found -0\.1\); give a standard deviation, zero or more"),
    ],
)  # fmt: skip
def test_what_is_no_number_of_its_key_is_refused_by_it(text, said):
    with pytest.raises(MachineError, match=rf"machine\.toml key {said}"):
        parse_machine(f"{BARE}{text}\n")


@pytest.mark.parametrize("limits", ["[360.0, -360.0]", "[90.0, 90.0]"])
def test_limits_of_a_joint_in_the_wrong_order_are_refused_by_the_key(limits):
    arm = '[machine]\nkind = "serial"\nconvention = "standard"\n' + "[[machine.joint]]\na_mm = 300\n" * 2
    with pytest.raises(MachineError, match=r"machine\.joint\[2\]\.limits_deg: .*the lower end must come first"):
        parse_machine(f"{arm}limits_deg = {limits}\n")
    assert parse_machine(f"{arm}limits_deg = [-360.0, 360.0]\n").machine.joints == 2


def test_a_key_is_suggested_that_this_kind_of_machine_has():
    with pytest.raises(MachineError, match=r"unknown key 'lead_mm'; did you mean 'screw_lead_mm'\? \(in machine\)"):
        parse_machine(f"{BARE}lead_mm = 5\n")
    arm = '[machine]\nkind = "serial"\nconvention = "standard"\n[[machine.joint]]\na_mm = 300\ndd_mm = 4\n'
    with pytest.raises(MachineError, match=r"unknown key 'dd_mm'; did you mean 'd_mm'\? \(in machine\.joint\[1\]\)"):
        parse_machine(arm)


def test_what_a_controller_cannot_compensate_is_named():
    file = parse_machine(f'{BARE}[controller]\ncompensates = ["backlash", "backlsh"]\n')
    with pytest.raises(InputError, match=r"key controller\.compensates: effect 'backlsh' .* did you mean 'backlash'"):
        read_model(file)
    for wrong in ("my own thing", "tracker-scale", "dh-offsets"):  # no effect, the tracker's, another mechanism's
        own = parse_machine(f'{BARE}[controller]\ncompensates = ["{wrong}"]\n')
        with pytest.raises(
            InputError, match=f"controller.compensates: '{wrong}' is no effect that .* backlash,"
        ) as told:
            read_model(own)
        assert "tracker" not in told.value.fix and "--effects FILE.py" in told.value.fix and len(str(told.value)) < 580
    two = parse_machine(f'{BARE}[controller]\ncompensates = ["once-per-rev[harmonic 2]", "screw-error-map"]\n')
    assert read_model(two).file.controller.compensates == ("once-per-rev[harmonic 2]", "screw-error-map")


def test_a_screw_finer_than_any_is_refused_by_its_key(tmp_path):
    text = (ROOT / "data" / "machine.toml").read_text()
    for old, new in (("screw_lead_mm = 5", "screw_lead_mm = 1e-9 #"), ("screw_lead_mm = 5", "screw_lead_mm = 1e9 #")):
        assert old in text
        with pytest.raises(InputError, match="screw_lead_mm"):
            parse_machine(text.replace(old, new, 1))
