"""What controllers make of exported files, by their own published arithmetic; nothing here is taken from the library.

Klipper: klippy/kinematics/delta.py. RepRapFirmware: LinearDeltaKinematics.cpp. Marlin: delta.cpp, M666.cpp, G28.
LinuxCNC: lineardeltakins-common.h, motion/control.c, usrmotintf.cc. SINUMERIK: function manual K3. URDF: its joint
element.
Each takes tool positions (n, 3) mm in the order of travel and gives slider heights (n, 3) mm above the drawing's
zero, homed at the upper ends of travel.
"""

import configparser
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ptt.rig.nominal import ideal_machine, nominal_sliders


def klipper(path: Path, ends, p: np.ndarray) -> np.ndarray:
    config = configparser.ConfigParser(inline_comment_prefixes=("#", ";"))
    config.read_string(path.read_text())
    radius = float(config["printer"]["delta_radius"])
    assert config["printer"]["kinematics"] == "delta"
    columns = []
    for letter, end in zip("abc", ends, strict=True):
        section = config[f"stepper_{letter}"]
        arm, angle = float(section["arm_length"]), math.radians(float(section["angle"]))
        assert arm > radius > 0.0  # the firmware refuses others
        stop = float(section["position_endstop"]) + math.sqrt(arm**2 - radius**2)
        dx, dy = radius * math.cos(angle) - p[:, 0], radius * math.sin(angle) - p[:, 1]
        columns.append(end - (stop - (np.sqrt(arm**2 - dx**2 - dy**2) + p[:, 2])))
    return np.column_stack(columns)


def words(path: Path, code: str) -> dict[str, str]:
    line = next(line for line in path.read_text().splitlines() if line.startswith(code + " "))
    return {word[0]: word[1:] for word in line.split(";")[0].split()[1:]}


def reprapfirmware(path: Path, ends, p: np.ndarray) -> np.ndarray:
    m665, m666 = words(path, "M665"), words(path, "M666")
    rods = [float(rod) for rod in m665["L"].split(":")]
    radius, homed = float(m665["R"]), float(m665["H"])
    x, y, z = (float(m665[letter]) for letter in "XYZ")
    c, s = (lambda deg: math.cos(math.radians(deg))), (lambda deg: math.sin(math.radians(deg)))
    towers = [
        (-radius * c(30 + x), -radius * s(30 + x)),
        (radius * c(30 - y), -radius * s(30 - y)),
        (-radius * s(z), radius * c(z)),
    ]
    tilt = 0.01 * float(m666["A"]) * p[:, 0] + 0.01 * float(m666["B"]) * p[:, 1]
    columns = []
    for rod, (tx, ty), letter, end in zip(rods, towers, "XYZ", ends, strict=True):
        stop = homed + math.sqrt(rod**2 - radius**2) + float(m666[letter])
        at = np.sqrt(rod**2 - (p[:, 0] - tx) ** 2 - (p[:, 1] - ty) ** 2) + p[:, 2] + tilt
        columns.append(end - (stop - at))
    return np.column_stack(columns)


def marlin(path: Path, ends, p: np.ndarray) -> np.ndarray:
    m665, m666 = words(path, "M665"), words(path, "M666")
    radius, height = float(m665["R"]), float(m665["H"])
    columns = []
    for letter, trim, base, end in zip("XYZ", "ABC", (210, 330, 90), ends, strict=True):
        adjust = float(m666[letter])
        assert adjust <= 0.0  # the firmware refuses others
        square = (float(m665["L"]) + float(m665[trim])) ** 2
        angle = math.radians(base + float(m665[letter]))
        dx, dy = radius * math.cos(angle) - p[:, 0], radius * math.sin(angle) - p[:, 1]
        homed = height + math.sqrt(square - radius**2)  # where the carriage is once it has backed off by -adjust
        columns.append(end + adjust - (homed - (np.sqrt(square - dx**2 - dy**2) + p[:, 2])))
    return np.column_stack(columns)


def linuxcnc(ini: Path, height: float, p: np.ndarray, *, start=(1, 1, 1)) -> np.ndarray:
    """`height` is that of a slider whose joint is at zero; `start` the ways before the first move."""
    config = configparser.ConfigParser(comment_prefixes=("#",), strict=False)
    config.optionxform = str
    config.read_string(ini.read_text())
    hal = (ini.parent / config["HAL"]["HALFILE"]).read_text()
    radius, rod = (float(re.search(rf"setp lineardeltakins\.{name} (\S+)", hal)[1]) for name in "RL")
    turned = re.search(r"G10 L2 P1 R(\S+)", ini.read_text())
    angle = math.radians(float(turned[1])) if turned else 0.0
    x, y = p[:, 0] * math.cos(angle) - p[:, 1] * math.sin(angle), p[:, 0] * math.sin(angle) + p[:, 1] * math.cos(angle)
    joints = lineardelta(radius, rod, np.column_stack([x, y, p[:, 2]]))
    columns = []
    for joint, place in enumerate(joints.T):
        section = config[f"JOINT_{joint}"]
        assert section["COMP_FILE_TYPE"] == "0"
        trims = triplets(ini.parent / section["COMP_FILE"])
        columns.append(place + screw(trims, place, start[joint]) + height)
    return np.column_stack(columns)


def lineardelta(radius: float, rod: float, p: np.ndarray) -> np.ndarray:
    """Joints of LinuxCNC's lineardeltakins, (n, 3) mm."""
    towers = [(0.0, radius), (-math.sqrt(3) / 2 * radius, -radius / 2), (math.sqrt(3) / 2 * radius, -radius / 2)]
    return np.column_stack([p[:, 2] + np.sqrt(rod**2 - (tx - p[:, 0]) ** 2 - (ty - p[:, 1]) ** 2) for tx, ty in towers])


def triplets(path: Path) -> np.ndarray:
    """Lines up to the first that is no triplet, as nominal and the two trims."""
    rows = []
    for line in path.read_text().splitlines():
        try:
            nominal, forward, reverse = (float(each) for each in line.split()[:3])
        except ValueError:
            break
        assert not rows or nominal > rows[-1][0]  # 'compensation values must increase'
        rows.append((nominal, nominal - forward, nominal - reverse))
    assert 0 < len(rows) <= 256
    return np.array(rows)


def screw(trims: np.ndarray, place: np.ndarray, way: float) -> np.ndarray:
    added = np.empty(len(place))
    for row, value in enumerate(place):
        if row and value != place[row - 1]:
            way = math.copysign(1.0, value - place[row - 1])
        added[row] = np.interp(value, trims[:, 0], trims[:, 1 if way > 0 else 2])
    return added


def siemens(path: Path, spec, p: np.ndarray) -> np.ndarray:
    """The controller's own kinematics are the drawing's."""
    place = nominal_sliders(ideal_machine(spec), p)
    return np.column_stack([siemens_axis(path, axis, place[:, axis]) for axis in range(3)])


def siemens_axis(path: Path, axis: int, place: np.ndarray) -> np.ndarray:
    text, name = path.read_text(), f"AX{axis + 1}"
    values = dict(re.findall(rf"\$AA_ENC_COMP\[0,(\d+),{name}\]=(\S+)", text))
    low, high, step = (
        float(re.search(rf"\$AA_ENC_COMP_{key}\[0,{name}\]=(\S+)", text)[1]) for key in ("MIN", "MAX", "STEP")
    )
    assert f"$AA_ENC_COMP_IS_MODULO[0,{name}]=0" in text
    assert len(values) == round((high - low) / step) + 1
    table = np.array([float(values[str(n)]) for n in range(len(values))])
    return place - np.interp((place - low) / step, np.arange(len(table)), table)


def urdf(path: Path, q: np.ndarray) -> np.ndarray:
    """Tool positions, (n, 3) mm."""
    root = ET.parse(path).getroot()
    by_parent = {joint.find("parent").get("link"): joint for joint in root.findall("joint")}
    link, rotation, place, number = "base_link", Rotation.identity(len(q)), np.zeros((len(q), 3)), 0
    while link in by_parent:
        joint = by_parent[link]
        origin = joint.find("origin")
        place = place + rotation.apply([float(each) for each in origin.get("xyz").split()])
        rotation = rotation * Rotation.from_euler("xyz", [float(each) for each in origin.get("rpy").split()])
        if joint.get("type") != "fixed":
            axis = np.array([float(each) for each in joint.find("axis").get("xyz").split()])
            rotation = rotation * Rotation.from_rotvec(q[:, number, None] * axis)
            number += 1
        link = joint.find("child").get("link")
    assert number == q.shape[1] and link == "tool"
    return 1e3 * place
