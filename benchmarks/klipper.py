"""Real linear deltas: geometry fitted with priors to one height per point, beside what the firmware saved.

Run it as `python benchmarks/klipper.py`. Seven points, one known height each; x and y are not measured, so most of the
geometry stays where its usual size holds it. Printed are the height error of each point predicted from the six others,
and how far the parameters of one printer drift between calibrations.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from ptt.effects import library
from ptt.machine import MachineFile, parse_machine
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.chain import linearise
from ptt.model.model import Term, start_term
from ptt.run.table import make_table
from ptt.run.view import View
from ptt.run.viewing import build_view

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "klipper_delta" / "probes_flat.csv"
EFFECTS = ("homing-offset", "tower-position", "link-length")
PROBE = 0.01  # mm, repeatability of a nozzle probe
PRIOR = {"homing-offset": 0.5, "tower-position": 0.2, "link-length": 0.1}  # mm, the effects' usual sizes
AZIMUTH = (210.0, 330.0, 90.0)


@dataclass(frozen=True)
class Calibration:
    """One calibration of a printer.

    Attributes:
        name: printer and date.
        printer: who it belongs to.
        height: (m,) mm, known height of the nozzle at each point.
        view: the points through the drawing.
        saved: (m,) mm, height error that the firmware's saved geometry leaves on the points it was made from.
        saved_geometry: arms, radius and end stops as saved, (7,) mm.
    """

    name: str
    printer: str
    height: np.ndarray
    view: View
    saved: np.ndarray
    saved_geometry: np.ndarray


def load(path: Path = DATA) -> list[Calibration]:
    """Read all calibrations."""
    frame = pd.read_csv(path)
    return [_calibration(part) for _, part in frame.groupby(["printer", "date", "height_mm"], sort=False)]


def _calibration(part: pd.DataFrame) -> Calibration:
    first = part.iloc[0]
    travel = part[["travel_a_mm", "travel_b_mm", "travel_c_mm"]].to_numpy()
    height = part["height_mm"].to_numpy()
    arm = float(np.round(np.mean([first.arm_a, first.arm_b, first.arm_c])))  # the drawing: whole millimetres
    radius = float(np.round(first.delta_radius))
    drawing = _drawing(arm, radius)
    # Where the end stops are is no part of a drawing: the point over the middle tells it, the same for all towers.
    start = height[0] + np.sqrt(arm**2 - radius**2) + travel[0].mean()
    view = build_view(drawing, make_table(None, start - travel))
    name = f"{first.printer.split('+')[0]} {first.date[:10]} at {height[0]:g} mm"
    arms, stops = first[["arm_a", "arm_b", "arm_c"]].to_numpy(float), first[["endstop_a", "endstop_b", "endstop_c"]]
    geometry = np.array([*arms, first.delta_radius, *stops.to_numpy(float)])
    return Calibration(name, first.printer, height, view, _saved_heights(first, travel) - height, geometry)


def _drawing(arm: float, radius: float) -> MachineFile:
    return parse_machine(
        f'[machine]\nkind = "three-ptt"\nbase_radius_mm = {radius + 50}\nplatform_radius_mm = 50\n'
        f"link_length_mm = {arm}\n"
        f"slider_azimuth_deg = {list(AZIMUTH)}\nslider_travel_mm = [0, 1000]\n"
    )


def _saved_heights(row: pd.Series, travel: np.ndarray) -> np.ndarray:
    """Nozzle heights by the saved geometry: an end stop is stated as the nozzle's height over the middle."""
    arms = row[["arm_a", "arm_b", "arm_c"]].to_numpy(float)
    stops = row[["endstop_a", "endstop_b", "endstop_c"]].to_numpy(float)
    spec = _drawing(float(arms.mean()), float(row.delta_radius)).machine
    assert spec.kind == "three-ptt"
    turned = spec.model_copy(update={"slider_azimuth_deg": tuple(row[["angle_a", "angle_b", "angle_c"]].astype(float))})
    mechanism = ThreePtt.from_spec(turned)
    slider = stops + np.sqrt(arms**2 - row.delta_radius**2) - travel
    shift = torch.zeros(1, len(mechanism.slots), dtype=torch.float64)
    for leg in range(3):
        shift[0, 4 * leg + 3] = arms[leg] - arms.mean()
    return mechanism.forward(torch.as_tensor(slider), shift)[:, 2].numpy()


def fit_heights(case: Calibration, used: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit the geometry to the heights of some points.

    Args:
        case: the calibration.
        used: (m,) bool.

    Returns:
        Parameters (12,) mm, their standard errors, and the height errors of all points, (m,) mm.
    """
    terms: list[Term] = [start_term(library()[name](), case.view) for name in EFFECTS]
    prior = np.concatenate([np.full(len(term.theta), PRIOR[term.effect.name]) for term in terms])
    ends = np.cumsum([len(term.theta) for term in terms])[:-1]
    values = np.zeros(len(prior))
    for _ in range(6):
        parts = [torch.as_tensor(part) for part in np.split(values, ends)]
        at = linearise([(term.effect, part) for term, part in zip(terms, parts, strict=True)], case.view)
        left = case.height - at.prediction.reading[:, 2].numpy()
        slope = at.jacobian[:, 2].numpy()
        normal = slope[used].T @ slope[used] / PROBE**2 + np.diag(1.0 / prior**2)
        values = values + np.linalg.solve(normal, slope[used].T @ left[used] / PROBE**2 - values / prior**2)
    return values, np.sqrt(np.diag(np.linalg.inv(normal))), left


def leave_one_out(case: Calibration) -> np.ndarray:
    """Height error of each point when the geometry is fitted to the others, (m,) mm."""
    points = np.arange(len(case.height))
    return np.array([fit_heights(case, points != point)[2][point] for point in points])


def drawn(case: Calibration) -> np.ndarray:
    """Height errors by the drawing, common height taken out, (m,) mm."""
    left = case.height - case.view.p[:, 2].numpy()
    return left - left.mean()


def main() -> None:
    """Print both tables."""
    cases = load()
    print(f"{'height error, RMS in um':<42}{'drawing':>9}{'left out':>9}{'fitted':>9}{'saved':>9}")
    for case in cases:
        everything = np.ones(len(case.height), dtype=bool)
        errors = drawn(case), leave_one_out(case), fit_heights(case, everything)[2], case.saved
        print(f"{case.name:<42}" + "".join(f"{1e3 * np.sqrt(np.mean(item**2)):9.1f}" for item in errors))
    print("\ndrift between calibrations of one printer, standard deviation in mm")
    for printer in dict.fromkeys(case.printer for case in cases):
        own = [case for case in cases if case.printer == printer and _same_hardware(case, cases)]
        if len(own) > 1:
            fitted = np.array([fit_heights(case, np.ones(len(case.height), dtype=bool))[0] for case in own])
            saved = np.array([case.saved_geometry for case in own])
            mine, theirs = fitted.std(axis=0, ddof=1), saved.std(axis=0, ddof=1)
            stops = (saved[:, 4:] - saved[:, 4:].mean(axis=1, keepdims=True)).std(axis=0, ddof=1)
            print(f"{printer.split('+')[0]}, {len(own)} calibrations")
            print(f"    arms         here {_row(mine[9:])}   saved {_row(theirs[:3])}")
            print(f"    radius       here {_row(fitted[:, 3:6].mean(axis=1).std(ddof=1, keepdims=True))}"
                  f"                 saved {_row(theirs[3:4])}")  # fmt: skip
            print(f"    end stops    here {_row(mine[:3])}   saved {_row(stops)}  (less their mean)")


def _same_hardware(case: Calibration, cases: list[Calibration]) -> bool:
    """The same drawing as the printer's last calibration: not rebuilt in between."""
    last = [other for other in cases if other.printer == case.printer][-1]
    return bool(np.abs(last.saved_geometry[:3].mean() - case.saved_geometry[:3].mean()) < 5.0)


def _row(values: np.ndarray) -> str:
    return " ".join(f"{value:7.3f}" for value in values)


if __name__ == "__main__":
    main()
