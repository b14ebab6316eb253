"""Drawings that are off by 5 to 20 mm: radius and links wrong together, fitted, compensated and measured again.

Run it as `python benchmarks/drawings.py [DRAWS]`. The machine is built right; its drawing has another base radius and
other links, so the controller sends wrong commands. One run is fitted with the effects `tower-position` and
`link-length`, at noise of 3 to 10 um, half of the runs short; then the corrected commands are sent for poses between
those that were measured. The table shows what the tool is off by, before and after, beside the noise of one reading,
and how far the fit is from the truth in its own standard errors, along what it calls measured.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from ptt.challenge.truth import table_of
from ptt.correct.compensate import compensate
from ptt.effects import library
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, load_machine
from ptt.model.model import Model
from ptt.rig.nominal import ideal_machine
from ptt.rig.rig import Rig
from ptt.rig.rig_file import parse_rig
from ptt.rig.simulate import simulate
from ptt.rig.targets import make_volume
from ptt.run.frames import align
from ptt.run.problem import build_problem
from ptt.run.table import make_table

OFF = (5.0, 20.0)  # mm
ROWS = (40, 300)
SIGMA = (0.003, 0.010)  # mm
EFFECTS = ("tower-position", "link-length")


@dataclass(frozen=True)
class Score:
    """One drawing.

    Attributes:
        radius: how far the base radius is off, mm.
        links: (3,) how far the links are off, mm.
        rows: readings.
        sigma: noise of one coordinate, um.
        before: error of the tool where nobody measured, without its best frame, RMS of the distance, um.
        after: the same with the corrected commands.
        noise: of one reading, RMS of the distance, um.
        worst: distance of the fit from the truth in standard errors, along what is measured.
        said: largest standard error of a measured parameter, um.
        status: of the fit.
    """

    radius: float
    links: np.ndarray
    rows: int
    sigma: float
    before: float
    after: float
    noise: float
    worst: float
    said: float
    status: str

    @property
    def good(self) -> bool:
        """The tool is where it should be, as far as one reading can tell."""
        return self.after <= self.noise and self.status == "converged"


def machine() -> MachineFile:
    """The bench, its frame fitted."""
    return load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")


def build(seed: int) -> tuple[Rig, dict[str, np.ndarray], float]:
    """A rig whose drawing is wrong, by how much, by effect, and the noise of its tracker."""
    random = np.random.default_rng([seed, 93])
    file = machine()
    sigma = float(random.uniform(*SIGMA))
    radius = float(random.choice([-1, 1]) * random.uniform(*OFF))
    common = float(random.choice([-1, 1]) * random.uniform(*OFF))
    links = common + random.uniform(-1.0, 1.0, 3)
    spec = {key: value for key, value in file.machine.model_dump(mode="json").items() if value is not None}
    content = {
        "machine": {**spec, "kind": "three-ptt"},
        "seed": seed,
        "geometry": {"tower_radial_mm": [radius] * 3, "link_mm": links.tolist()},
        "tracker": {"white_mm": sigma, "translation_mm": [0.3, -0.2, 0.1], "rotation_mrad": [0.4, 0.2, -0.3]},
    }
    tracker = file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": sigma, "base_point": ()})
    rig = replace(parse_rig(content), machine=replace(file, tracker=tracker))
    return rig, {"tower-position": np.array([radius] * 3 + [0.0] * 3), "link-length": links}, sigma


def run(seed: int) -> Score:
    """Build, fit, compensate, measure again."""
    rig, truth, sigma = build(seed)
    rows = ROWS[seed % 2]
    drawing = ideal_machine(rig.spec)
    measured = simulate(rig, make_volume(drawing, rows, seed))
    problem = build_problem(rig.machine, table_of(measured.frame))
    model = Model(rig.machine)
    for name in EFFECTS:
        model = model + library()[name]()
    fitted = fit(model, problem)
    fresh = make_volume(drawing, 150, seed + 1000)
    places = fresh[["x_cmd", "y_cmd", "z_cmd"]].to_numpy(float).copy()
    commands = compensate(fitted.model, make_table(places), limit=np.inf).q
    before, after = simulate(rig, fresh, noise=False), _again(rig, fresh, commands)
    worst, said = pulls(fitted, truth)
    return Score(
        float(truth["tower-position"][0]), truth["link-length"], rows, sigma * 1e3, _off(before.truth, places),
        _off(after, places), sigma * np.sqrt(3.0) * 1e3, worst, said * 1e3, fitted.status,
    )  # fmt: skip


def _again(rig: Rig, targets: pd.DataFrame, commands: np.ndarray) -> np.ndarray:
    return simulate(rig, targets, sliders=pd.DataFrame(commands, columns=["b1", "b2", "b3"]), noise=False).truth


def _off(truth: np.ndarray, places: np.ndarray) -> float:
    """What the tool is off by, its best frame taken off, um."""
    turn, shift = align(places, truth)
    return float(np.sqrt(np.square((truth - shift) @ turn - places).sum(axis=1).mean()) * 1e3)


def pulls(fitted: FitResult, truth: dict[str, np.ndarray]) -> tuple[float, float]:
    """Largest distance in standard errors along measured directions, and largest standard error, mm."""
    values = np.concatenate([truth[term.effect.key] for term in fitted.model.terms])
    own = np.arange(len(values))
    scale = (fitted.layout.scale * fitted.sizes)[own]
    left, strength, _ = np.linalg.svd(fitted.unseen[own], full_matrices=True)
    gauge = left[:, : len(strength)][:, strength > 0.05]
    onto = np.eye(len(own)) - gauge @ gauge.T
    error = onto @ ((fitted.values[own] - values) / scale)
    widened = fitted.covariance[np.ix_(own, own)] / np.outer(scale, scale)
    std = np.sqrt(np.diag(onto @ widened @ onto))
    seen = np.diag(onto) > 0.02
    return float(np.abs(error[seen] / std[seen]).max()), float((std * scale)[seen].max())


def main() -> None:
    """Print the table."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    heads = (("radius", 8), ("links mm", 24), ("rows", 6), ("before um", 11), ("after um", 10), ("noise um", 10))
    print("".join(f"{name:>{width}}" for name, width in (*heads, ("worst z", 9), ("std um", 8))))
    scores = [run(seed) for seed in range(draws)]
    for item in scores:
        links = "  ".join(f"{value:6.2f}" for value in item.links)
        print(
            f"{item.radius:8.2f}{links:>24}{item.rows:6d}{item.before:11.0f}{item.after:10.2f}{item.noise:10.1f}"
            f"{item.worst:9.1f}{item.said:8.0f}  {'' if item.good else 'FAILS ' + item.status}"
        )
    print(f"{sum(item.good for item in scores)} of {len(scores)}")


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
