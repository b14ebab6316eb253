"""Words against the virtual machine: hide a fault of either sign there, fit its effect, read the sentence."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.words import sentences
from ptt.effects import library
from ptt.fit.solve import fit
from ptt.machine import format_machine
from ptt.model import Model
from ptt.noise import Noise
from ptt.problem import build_problem
from ptt.rig.rig import parse_rig
from ptt.rig.simulate import simulate, write_run
from ptt.table import read_table

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
    import tomllib

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
        assert found == pytest.approx(size, rel=0.06), words
