"""Tracker readings of two industrial arms that others published, as tables and machines.

    git clone https://github.com/icelinker/Robot-Calibration-LaserTracker    ABB IRB 120: three reflectors, 1,000 poses
    git clone https://github.com/ZhangTeng-Hust/ASTL                         Staubli TX2-90L: four paths, and 40 poses

The files are never part of the project. What they hold no word of is said here: the drawings are the makers' nominal
lengths, and that the second arm is this one, its readings say: of all lengths fitted without a drawing, 50, 500, 50 and
550 mm come out to 0.5 mm.
"""

import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd

from ptt.machine import MachineFile, parse_machine
from ptt.run.table import Table, make_table

IRB120, TX2 = "Robot-Calibration-LaserTracker", "ASTL"
PATHS = ("Calibration", "POINTS", "LINE", "CURVE")  # SURFACE holds 2,500 poses of one night: minutes a diagnosis
SHEET = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
JOINTS = {  # a, alpha, d, theta offset of each link, mm and deg
    IRB120: [(0, -90, 290, 0), (270, 0, 0, -90), (70, -90, 0, 0), (0, 90, 302, 0), (0, -90, 0, 0), (0, 0, 72, 180)],
    TX2: [(50, -90, 478, 0), (500, 0, 50, -90), (0, 90, 0, 90), (0, -90, 550, 0), (0, 90, 0, 0), (0, 0, 100, 0)],
}


def irb120(folder: Path, reflector: int = 1) -> tuple[MachineFile, Table]:
    """Readings of one of three reflectors on the flange.

    Args:
        folder: of the clones.
        reflector: 1 to 3.
    """
    read = folder / IRB120 / "3-Full Measurement" / "Output" / "Backup"
    joints, measured = (np.loadtxt(read / f"measured_{name}.txt") for name in ("joints", f"SMR_{reflector}"))
    return _opened(IRB120, joints, measured)


def tx2(folder: Path, path: str) -> tuple[MachineFile, Table]:
    """Readings along one path, with their times.

    Args:
        folder: of the clones.
        path: one of `PATHS`, or SURFACE.
    """
    read = folder / TX2 / "Data" / path
    leica, joints = pd.read_csv(read / "Leica.csv", encoding="latin1"), _sheet(read / "theta.xlsx")
    stamp = pd.to_datetime(leica["Time Stamp"].str.strip("'"), format="%d.%m.%Y %H:%M:%S.%f")
    seconds = (stamp - stamp.iloc[0]).dt.total_seconds().to_numpy()
    return _opened(TX2, joints, leica.iloc[:, :3].to_numpy(float), seconds)


def _opened(
    name: str, degrees: np.ndarray, measured: np.ndarray, seconds: np.ndarray | None = None
) -> tuple[MachineFile, Table]:
    links = ", ".join(
        f"{{ a_mm = {a}, alpha_deg = {alpha}, d_mm = {d}, theta_offset_deg = {theta} }}"
        for a, alpha, d, theta in JOINTS[name]
    )
    machine = parse_machine(
        f'[machine]\nkind = "serial"\nname = "{name}"\nconvention = "standard"\ngravity = [0, 0, -1]\n'
        f'joint = [{links}]\n[tracker]\nframe = "fitted"\ntool = "fitted"\n',
        name,
    )
    return machine, make_table(None, np.radians(degrees), measured=measured, time_s=seconds)


def _sheet(file: Path) -> np.ndarray:
    """Numbers of the first sheet of a workbook, its titles j1..j6 in any order, (n, 6)."""
    with zipfile.ZipFile(file) as book:
        words = [item.findtext(f"{SHEET}t") for item in ElementTree.fromstring(book.read("xl/sharedStrings.xml"))]
        rows = ElementTree.fromstring(book.read("xl/worksheets/sheet1.xml")).iter(f"{SHEET}row")
        cells = [[cell.findtext(f"{SHEET}v") or "" for cell in row] for row in rows]
    titles = [words[int(number)] or "" for number in cells[0][:6]]
    assert all(re.fullmatch("j[1-6]", title) for title in titles)
    numbers = np.array([row[:6] for row in cells[1:] if row[0]], dtype=float)
    return numbers[:, np.argsort(titles)]
