"""Formats of controllers and corrected programs, measured again on the virtual machine.

Run it as `python benchmarks/firmware.py [PROGRAM.ngc ...]`. A machine is measured (2 um of noise, trusted frame), its
effects fitted by name and exported; the virtual machine is then driven through each format's own arithmetic
(tests/controllers.py) at 400 other places all over its workspace. Programs are run by an own interpreter
(tests/gcode.py) on the drawing's kinematics; the figures are distances of the tool's path from the program's.
"""

import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(HERE / "tests"))

import controllers  # noqa: E402
import gcode  # noqa: E402

from ptt.commands.main import run  # noqa: E402
from ptt.correct.compensate import compensate  # noqa: E402
from ptt.correct.exports.format import Options  # noqa: E402
from ptt.correct.exports.registry import find_format, writer  # noqa: E402
from ptt.correct.program.program import correct_program  # noqa: E402
from ptt.correct.training.compensator import Compensator, load_compensator  # noqa: E402
from ptt.errors import PttError  # noqa: E402
from ptt.machine import format_machine, parse_machine  # noqa: E402
from ptt.mechanisms import build_mechanism  # noqa: E402
from ptt.plan.space import build_space, draw_poses  # noqa: E402
from ptt.rig import parse_rig, simulate, write_run  # noqa: E402
from ptt.rig.nominal import ideal_machine, nominal_sliders  # noqa: E402
from ptt.rig.rig import Rig  # noqa: E402
from ptt.run.table import make_table  # noqa: E402

FORMATS = ("klipper", "reprapfirmware", "marlin", "linuxcnc", "siemens")
MACHINE = """
[machine]
kind = "three-ptt"
name = "bench"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0
[tracker]
frame = "trusted"
sigma_mm = 0.002
"""
GEOMETRY = {"link_mm": (0.11, -0.08, 0.15), "tower_tangential_mm": (0.1, -0.12, 0.05)}
ZEROS = {"homing_mm": (0.21, -0.12, 0.05)}
PLAY = {"backlash_mm": (0.041, 0.052, 0.037), "scale_um_per_m": (100.0, -60.0, 30.0)}
SETS = {
    "zeros, links, towers turned": (ZEROS, GEOMETRY),
    "and towers moved out": (ZEROS, GEOMETRY | {"tower_radial_mm": (0.21, -0.12, 0.05)}),
    "and play, leads": (ZEROS | PLAY, GEOMETRY | {"tower_radial_mm": (0.21, -0.12, 0.05)}),
    "zeros, play, screw waves": (ZEROS | PLAY | {"turn_um": (8.0, 10.0, 6.0), "turn_phase_rad": 0.7}, {}),
}
EFFECTS = {
    "zeros, links, towers turned": ("homing-offset", "link-length", "tower-position"),
    "and towers moved out": ("homing-offset", "link-length", "tower-position"),
    "and play, leads": ("homing-offset", "link-length", "tower-position", "backlash", "lead-scale"),
    "zeros, play, screw waves": ("homing-offset", "backlash", "lead-scale", "once-per-rev"),
}


def build_rig(name: str) -> Rig:
    """The machine with a set of faults."""
    drive, geometry = SETS[name]
    file = parse_machine(MACHINE)
    spec = {key: value for key, value in file.machine.model_dump(mode="json").items() if value is not None}
    rig = parse_rig({"machine": spec, "drive": drive, "geometry": geometry, "tracker": {"white_mm": 0.002}})
    return replace(rig, machine=file)


def solve(name: str, rig: Rig, folder: Path) -> Compensator:
    """Measure the machine and fit the model."""
    file = rig.machine
    place = build_mechanism(file.machine).forward(draw_poses(build_space(file), 500, np.random.default_rng(1))).numpy()
    write_run(simulate(rig, _frame(place)).frame, folder / "run.csv")
    (folder / "m.toml").write_text(format_machine(file))
    given = [str(folder / "run.csv"), *EFFECTS[name], "--model", str(folder / "m.toml")]
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        assert run(["add", *given, "--out", str(folder / "solved.toml"), "--json"]) == 0
    return load_compensator(folder / "solved.toml")


def missed(rig: Rig, place: np.ndarray, sliders: np.ndarray) -> float:
    """What the tool misses by, root mean square, um."""
    sent = pd.DataFrame(sliders, columns=["b1", "b2", "b3"])
    truth = simulate(rig, _frame(place), sliders=sent, noise=False).truth
    return 1e3 * float(np.sqrt(((truth - place) ** 2).sum(axis=1).mean()))


def sent_by(name: str, path: Path, rig: Rig, place: np.ndarray) -> np.ndarray:
    """Sliders that a controller with the exported file sends, by its own arithmetic."""
    ends = [high for _, high in rig.spec.travel_ends]
    if name == "linuxcnc":
        return controllers.linuxcnc(path, rig.spec.joint_height_mm, place)
    if name == "siemens":
        return controllers.siemens(path, rig.spec, place)
    return getattr(controllers, name)(path, ends, place)


def formats(name: str, rig: Rig, comp: Compensator, folder: Path) -> list[str]:
    """Rows of the table of formats."""
    file = rig.machine
    place = build_mechanism(file.machine).forward(draw_poses(build_space(file), 400, np.random.default_rng(9))).numpy()
    before = missed(rig, place, nominal_sliders(ideal_machine(rig.spec), place))
    whole = missed(rig, place, compensate(comp.model, make_table(place)).q)
    rows = [f"| {name} | drawing | | {before:.1f} | |", f"| | whole model (`ptt predict`) | | {whole:.1f} | |"]
    for each in FORMATS:
        out = folder / f"{each}.ini"
        result = writer(find_format(each), "three-ptt")(comp, out, Options())
        found = missed(rig, place, sent_by(each, out, rig, place))
        cannot = ", ".join(item.effect for item in result.cannot_hold) or "-"
        rows.append(f"| | {each} | {result.error_um.format:.1f} | {found:.1f} | {cannot} |")
    return rows


def programs(rig: Rig, comp: Compensator, paths: list[Path]) -> list[str]:
    """Rows of the table of programs."""
    rows = []
    for path in paths:
        text = path.read_text(errors="replace")
        started = time.perf_counter()
        try:
            result = correct_program(comp, text, path.name)
        except PttError as error:
            rows.append(f"| {path.name} | refused: {error} | | | | |")
            continue
        took = time.perf_counter() - started
        wanted = gcode.whole_path(gcode.execute(text))
        off = []
        for each in (text, result.text):
            # A program's first moves may come from a place that it has not stated; these nobody can correct.
            way = gcode.execute(each)
            head = next(number for number, move in enumerate(way) if len(move["path"]) and all(move["known"]))
            driven = gcode.dense(gcode.whole_path(way[head + 1 :]), 0.5)
            heights = pd.DataFrame(nominal_sliders(ideal_machine(rig.spec), driven), columns=["b1", "b2", "b3"])
            truth = simulate(rig, _frame(driven), sliders=heights, noise=False).truth
            off.append(1e3 * gcode.beside(truth[5 :: max(len(truth) // 1500, 1)], wanted))
        figures = f"{_rms(off[0]):.0f} | {_rms(off[1]):.1f} | {off[1].max():.1f}"
        rows.append(f"| {path.name} | {result.moves} | {result.pieces} | {figures} | {took:.1f} |")
    return rows


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _frame(place: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(place, columns=["x_cmd", "y_cmd", "z_cmd"])


def main() -> None:
    """Print both tables."""
    paths = [HERE / "data" / "programs" / "bracket.ngc", *(Path(each) for each in sys.argv[1:])]
    table, rows = [], []
    for name in SETS:
        with tempfile.TemporaryDirectory() as folder:
            rig = build_rig(name)
            comp = solve(name, rig, Path(folder))
            table += formats(name, rig, comp, Path(folder))
            if name == "and play, leads":
                rows = programs(rig, comp, paths)
    print("\n| faults | driven by | stated um | measured um | cannot hold |\n| --- | --- | ---: | ---: | --- |")
    print("\n".join(table))
    print("\n| program | moves | pieces | before um | after um | largest um | s |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    print("\n".join(rows))


if __name__ == "__main__":
    main()
