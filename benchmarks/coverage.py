"""Recovery: is the truth where the fit says it is? Every effect alone on the virtual machine, many random draws.

Run it as `python benchmarks/coverage.py [DRAWS] [EFFECT...]`. It prints, for each effect, how often the true parameters
lie within one and within three reported standard errors, after truth and estimate are projected onto what the fit calls
measured, and how often the combinations that cannot be seen were reported.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ptt.challenge.hide import FAULTS, hide_faults
from ptt.effects import library
from ptt.effects.layout import linear_size
from ptt.fitting.linear import usual_sizes
from ptt.fitting.observability import unobservable
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, load_machine
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.nominal import ideal_machine
from ptt.rig.rig import Rig
from ptt.rig.simulate import RunResult, simulate
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table

WHITE = 0.004  # mm, of one coordinate: white noise, as the standard errors assume
ROWS = 300
SEEN_AT_ALL = 0.02  # variance, in usual sizes, below which a projected parameter has nothing left to compare


@dataclass(frozen=True)
class Draw:
    """One rig, its run and what was hidden in it."""

    rig: Rig
    run: RunResult
    truth: dict[str, Any]


@dataclass(frozen=True)
class Score:
    """One fit against the truth: distances in standard errors, and whether unseen combinations were told."""

    distances: np.ndarray
    unseen: int
    told: int


def machine() -> MachineFile:
    """The bench with a fitted frame and nothing known of the noise beforehand."""
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    spec = file.machine.model_copy(update={"reflector_mm": (20.0, -10.0, -40.0)})
    tracker = file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": WHITE, "base_point": ()})
    return replace(file, machine=spec, tracker=tracker)


def draw(name: str, seed: int, file: MachineFile) -> Draw:
    """Hide one effect in a rig and run it with white noise."""
    protocols = FAULTS[name].protocols
    drawn = hide_faults(draw_rig(seed, file, protocols[seed % len(protocols)], rows=ROWS), [name], seed)
    quiet = drawn.rig.tracker.model_copy(update={"white_mm": WHITE, "wander_um": 0.0, "outlier_share": 0.0})
    rig = replace(drawn.rig, tracker=quiet)
    return Draw(rig, simulate(rig, drawn.targets), drawn.truth[name])


def score(name: str, seed: int, file: MachineFile, folder: Path) -> Score:
    """Draw, fit, compare."""
    hidden = draw(name, seed, file)
    path = folder / f"{name}.csv"
    hidden.run.frame.to_csv(path, index=False)
    problem = build_problem(file, read_table(path))
    fitted = fit(Model(file) + library()[name](), problem)
    effect = fitted.model.terms[0].effect
    count = linear_size(effect, 3)
    truth = TRUTH[name](hidden, problem, fitted) / usual_sizes(effect, problem)
    own = np.arange(count)
    unseen = fitted.unseen[own]
    onto = onto_measured(unseen)
    sizes = fitted.sizes[own]
    error = onto @ ((fitted.unknowns[own] - truth) / sizes)
    scale = fitted.layout.scale * fitted.sizes
    scaled = fitted.covariance / np.outer(scale, scale)
    variance = np.diag(onto @ scaled[np.ix_(own, own)] @ onto)
    chosen = (np.diag(onto) > SEEN_AT_ALL) & ~fitted.layout.held[own]
    return Score(error[chosen] / np.sqrt(variance[chosen]), fitted.unseen.shape[1], len(unobservable(fitted)))


def onto_measured(unseen: np.ndarray) -> np.ndarray:
    """Projection of an effect's own parameters off what the fit does not see of them."""
    left, strength, _ = np.linalg.svd(unseen, full_matrices=True)
    gauge = left[:, : len(strength)][:, strength > 0.05]
    return np.eye(len(unseen)) - gauge @ gauge.T


def _values(truth: dict[str, Any], *keys: str, factor: float = 1.0) -> np.ndarray:
    return factor * np.concatenate([np.atleast_1d(truth[key]) for key in keys])


def _once(hidden: Draw, problem: Problem, fitted: FitResult) -> np.ndarray:
    size, phase = 1e-3 * np.asarray(hidden.truth["turn_um"]), np.asarray(hidden.truth["turn_phase_rad"])
    return np.concatenate([size * np.cos(phase), size * np.sin(phase)])


def _growth(hidden: Draw, problem: Problem, fitted: FitResult) -> np.ndarray:
    growth = 1e-6 * np.asarray(hidden.truth["growth_um_per_m_k"])
    home = problem.view.home.numpy()
    return np.concatenate([growth, growth * (home - np.asarray(hidden.truth["fixed_end_mm"]))])


def _bend(hidden: Draw, problem: Problem, fitted: FitResult) -> np.ndarray:
    sway = 1e-3 * np.asarray(hidden.truth["column_bend_um_per_kg"])
    return np.concatenate([sway, 2.0 * sway / hidden.rig.structure.column_height_mm])


def _drift(hidden: Draw, problem: Problem, fitted: FitResult) -> np.ndarray:
    hours = float(problem.view.time.max()) / 3600.0
    return 1e-3 * np.asarray(hidden.truth["drift_um_per_h"]) * hours


def _stretch(hidden: Draw, problem: Problem, fitted: FitResult) -> np.ndarray:
    """About where the tracker stands."""
    scale = 1e-6 * float(hidden.truth["scale_ppm"])
    return np.concatenate([[scale], -scale * np.asarray(hidden.rig.tracker.station_mm)])


def _curve(hidden: Draw, problem: Problem, fitted: FitResult) -> np.ndarray:
    """The rig's own curve, in the shapes of the effect; its homing, lead and turns are other effects' truth."""
    from ptt.rig.drive import screw_error

    q = problem.view.q.numpy()
    rig, none = hidden.rig, (0.0, 0.0, 0.0)
    curve = rig.drive.model_copy(update=dict.fromkeys(("homing_mm", "scale_um_per_m", "turn_um", "turn2_um"), none))
    shift = screw_error(curve, q, q, ideal_machine(rig.spec).home, rig.drive.curve_span_mm, rig.spec.screw_lead_mm)
    return _in_shapes(fitted, problem, shift)


def _guide(hidden: Draw, problem: Problem, fitted: FitResult) -> np.ndarray:
    from ptt.effects.geometry import horizontal_axes
    from ptt.rig.legs import guide_wander

    q = problem.view.q.numpy()
    wander = guide_wander(hidden.rig.spec, hidden.rig.geometry, q)
    radial, tangential = (axis.numpy() for axis in horizontal_axes(problem.view))
    place = wander[..., :1] * radial + wander[..., 1:] * tangential  # shape: (n, leg, xyz)
    slots = np.zeros((len(q), 15))
    for leg in range(3):
        slots[:, 4 * leg : 4 * leg + 3] = place[:, leg]
    return _in_shapes(fitted, problem, slots)


def _in_shapes(fitted: FitResult, problem: Problem, shift: np.ndarray) -> np.ndarray:
    """Least squares of a known shift (n, out) in the basis of the fitted effect."""
    from ptt.effects.layout import shape_of

    term = fitted.model.terms[0]
    basis = term.effect.basis(problem.view, shape_of(term.effect, term.theta, 3)).numpy()
    flat = basis.reshape(-1, basis.shape[-1])
    return np.linalg.lstsq(flat, shift.ravel(), rcond=None)[0]


Truth = Callable[[Draw, Problem, FitResult], np.ndarray]


def _plain(*keys: str, factor: float = 1.0) -> Truth:
    return lambda hidden, problem, fitted: _values(hidden.truth, *keys, factor=factor)


TRUTH: dict[str, Truth] = {
    "homing-offset": _plain("homing_mm"),
    "lead-scale": _plain("scale_um_per_m", factor=1e-6),
    "screw-error-map": _curve,
    "once-per-rev": _once,
    "backlash": _plain("backlash_mm"),
    "windup": _plain("windup_um", factor=1e-3),
    "following-error": _plain("following_s"),
    "screw-growth": _growth,
    "axis-compliance": _plain("compliance_um_per_n", factor=1e-3),
    "tower-position": _plain("tower_radial_mm", "tower_tangential_mm"),
    "tower-tilt": _plain("lean_radial_mrad", "lean_tangential_mrad", factor=1e-3),
    "link-length": _plain("link_mm"),
    "guide-straightness": _guide,
    "joint-offset": _plain("joint_offset_rail_mm", "joint_offset_slider_mm"),
    "joint-clearance": _plain("clearance_um", factor=1e-3),
    "platform-twist": _plain("platform_axis_radial_mrad", "platform_axis_vertical_mrad", factor=1e-3),
    "column-bend": _bend,
    "frame-growth": _plain("frame_um_per_m_k", "link_um_per_m_k", factor=1e-6),
    "tracker-scale": _stretch,
    "tracker-drift": _drift,
    "setup-jump": lambda hidden, problem, fitted: np.concatenate(
        [_values(hidden.truth, "knock_um", factor=1e-3), _values(hidden.truth, "knock_mrad", factor=1e-3)]
    ),
}


def cover(names: Sequence[str], draws: int, folder: Path) -> dict[str, list[Score]]:
    """Score many draws of each effect."""
    file = machine()
    return {name: [score(name, seed, file, folder) for seed in range(draws)] for name in names}


def shares(scores: Sequence[Score]) -> tuple[float, float, float]:
    """Share of parameters within one and within three standard errors, and of draws whose gauges were all told."""
    distances = np.abs(np.concatenate([item.distances for item in scores]))
    told = np.mean([item.told == item.unseen for item in scores])
    return float(np.mean(distances <= 1.0)), float(np.mean(distances <= 3.0)), float(told)


def main() -> None:
    """Print the table."""
    import tempfile

    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    names = sys.argv[2:] or list(TRUTH)
    print(f"{'effect':<20}{'parameters':>11}{'within 1 SE':>13}{'within 3 SE':>13}{'worst':>8}{'unseen told':>13}")
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            scores = cover([name], draws, Path(folder))[name]
            one, three, told = shares(scores)
            alike = len({len(item.distances) for item in scores}) == 1
            worst = f"{np.mean([np.abs(s.distances) <= 3 for s in scores], axis=0).min():.0%}" if alike else ""
            count = len(scores[0].distances)
            print(f"{name:<20}{count:>11}{one:>13.0%}{three:>13.0%}{worst:>8}{told:>13.0%}", flush=True)


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
