"""A real UR10 under a laser tracker: how far each step of the physics takes the held-out error, beside learners.

Run it as `python benchmarks/ur10.py [ABCD] [--seeds 3] [--stride 1] [--no-peers] [--transfer] [--out FIGURES.json]`.
Base frame and reflector mount are fitted with every model; a held-out row never touches any of them. Random: 30 % of
the rows, several draws. Blocks: contiguous parts of the run held out in turn, all visits of a pose together. Figures
are um, RMS of the distance. Peers learn what a model leaves, from sines, cosines and values of the joint angles; the
Gaussian process from at most 1000 of the rows. Series C turns joint 1 through angles that A and B never visit, so the
transfer extrapolates there. `benchmarks/ur10_picture.py` draws the figures.
"""

import argparse
import json
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, WhiteKernel

from nets import RbfSettings, train_rbf
from ptt.effects.registry import library, make_effect
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit, residual_of
from ptt.machine import MachineFile, load_machine
from ptt.model.model import Model
from ptt.run.holdout import blocks
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.table import Table, concat_tables, take_rows

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data" / "ur10_ipa"
MACHINE = ROOT / "data" / "machines" / "ur10.toml"
FILES = {
    "A": "Series_A/measurements_grid.csv",
    "B": "Series_B/measurements_joint_configurations.csv",
    "C": "Series_C/measurements_random_poses.csv",
    "D": "Series_D/measurements_iso_cubes.csv",
}
REFERENCE = {"A": (838.0, 436.0), "B": (1085.0, 422.0), "C": (987.0, 509.0), "D": (772.0, 396.0)}  # nominal, full DH
STEPS = ("dh-offsets", "axis-compliance", "joint-error-map", "frame-growth")
SHARE, PARTS = 0.3, 5
HELPS = 0.005  # share of the error of held-out blocks that a step has to take
SIGMA = 0.05  # mm: visits of one pose scatter by 0.03; the rest is what no model here explains
GP_ROWS = 1000  # a Gaussian process takes the cube of the rows
NETWORK = RbfSettings(centre_counts=(128,), spreads=(2.0, 4.0), ridges=(1e-6, 1e-4, 1e-2), affine=(False,), restarts=1)

Row = dict[str, Any]
Learn = Callable[[np.ndarray, np.ndarray, np.ndarray], Callable[[np.ndarray], np.ndarray]]


def read_series(name: str, stride: int = 1) -> Table:
    """Read one series.

    Args:
        name: A, B, C or D.
        stride: every how many rows one is taken.

    Returns:
        The table.
    """
    order = {"order": "time"} if name == "A" else None  # its last rows are poses that were measured again
    table = read_table(DATA / FILES[name], 6, joint_prefix="q", purpose="run", set_values=order)
    return table if stride == 1 else take_rows(table, np.arange(0, table.rows, stride))


def open_series(table: Table, *, per_run: bool = False) -> Problem:
    """See a series through the drawing, frame and mount fitted, at one noise floor for all series."""
    file = load_machine(MACHINE)
    if per_run:
        own = {"frame": "fitted-per-run", "tool": "fitted-per-run"}
        file = replace(file, tracker=file.tracker.model_copy(update=own))
    return build_problem(file, table).with_noise(Noise(np.eye(3) * SIGMA**2, "machine file"))


def build_model(file: MachineFile, names: Sequence[str]) -> Model:
    """The drawing with effects."""
    model = Model(file)
    for name in names:
        model = model + make_effect(library(), name)
    return model


def total(residual: np.ndarray, rows: np.ndarray) -> float:
    """RMS of the distance, um."""
    return float(np.sqrt(np.square(residual[rows]).sum(axis=1).mean()) * 1e3)


def draws(problem: Problem, seeds: int) -> list[np.ndarray]:
    """Random held-out rows, (n,) bool for each seed."""
    return [np.random.default_rng(seed).random(problem.table.rows) < SHARE for seed in range(seeds)]


def reference_split(problem: Problem) -> np.ndarray:
    """The draw behind the reference figures: the last 30 % of one permutation, (n,) bool.

    Other draws scatter by 1 % (A, C) to 3 % (B, D) about their mean.
    """
    rows = problem.table.rows
    hidden = np.zeros(rows, dtype=bool)
    hidden[np.random.default_rng(0).permutation(rows)[int((1.0 - SHARE) * rows) :]] = True
    return hidden


def parts(problem: Problem) -> list[np.ndarray]:
    """Contiguous parts held out in turn, (n,) bool each."""
    block = blocks(problem.table)
    return [np.isin(block, (index, index + PARTS)) for index in range(PARTS)]


def held_out(model: Model, problem: Problem, masks: Sequence[np.ndarray]) -> float:
    """Held-out error of a model, quadratic mean over the masks, um."""
    errors = [total(fit(model, problem.masked(mask), lean=True).residual, mask & problem.used) for mask in masks]
    return float(np.sqrt(np.mean(np.square(errors))))


def ladder(name: str, problem: Problem, seeds: int, found: list[Row]) -> FitResult:
    """Print the held-out error after each step; a step that does not help held-out blocks is named and left out.

    Args:
        name: of the series.
        problem: the series.
        seeds: random draws.
        found: takes one entry for each step.

    Returns:
        The fit of the last model to all rows.
    """
    chosen: list[str] = []
    best = np.inf
    print(f"series {name}: {int(problem.used.sum())} readings {'':<12}{'all':>8}{'random':>9}{'blocks':>9}{'s':>7}")
    for step in (None, *STEPS):
        names = [*chosen, step] if step else []
        model = build_model(problem.file, names)
        if step and make_effect(library(), step).needs(problem.view):
            print(f"  + {step:<32} not testable")
            continue
        started = time.perf_counter()
        whole = fit(model, problem)
        one = time.perf_counter() - started
        random, block = (held_out(model, problem, masks) for masks in (draws(problem, seeds), parts(problem)))
        kept = block < (1.0 - HELPS) * best
        print(
            f"  {'+ ' + step if step else 'drawing, frame and mount':<34}{total(whole.residual, problem.used):8.1f}"
            f"{random:9.1f}{block:9.1f}{one:7.1f}{'' if kept else '   left out'}",
            flush=True,
        )
        found.append(
            {"series": name, "model": " + ".join(names) or "drawing", "step": step or "drawing", "kept": kept,
             "all": total(whole.residual, problem.used), "random": random, "blocks": block}
        )  # fmt: skip
        if kept:
            best, chosen = block, names
    plain = held_out(build_model(problem.file, STEPS[:1]), problem, [reference_split(problem)])
    print(
        f"  reference figures: drawing {REFERENCE[name][0]:.0f}, full DH fit on a random 30 % {REFERENCE[name][1]:.0f};"
        f" dh-offsets on that draw {plain:.1f}"
    )
    found.append({"series": name, "model": "dh-offsets", "step": "reference draw", "reference draw": plain})
    return fit(build_model(problem.file, chosen), problem)


def peers(name: str, problem: Problem, physics: Sequence[str], learners: dict[str, Learn], found: list[Row]) -> None:
    """Print what general learners make of what physics leaves, on the same splits; the first random draw only."""
    model = build_model(problem.file, physics)
    for label, learn in learners.items():
        figures = []
        for masks in (draws(problem, 1), parts(problem)):
            errors = [_after(learn, fit(model, problem.masked(mask), lean=True), problem, mask) for mask in masks]
            figures.append(float(np.sqrt(np.mean(np.square(errors)))))
        text = f"{' + '.join(physics)} + {label}"
        print(f"  {text:<90}{figures[0]:9.1f}{figures[1]:9.1f}", flush=True)
        found.append({"series": name, "model": text, "step": label, "random": figures[0], "blocks": figures[1]})


def _after(learn: Learn, fitted: FitResult, problem: Problem, mask: np.ndarray) -> float:
    near = np.linalg.norm(np.nan_to_num(fitted.residual), axis=1) < 1.5
    shown, hidden = problem.used & ~mask & near, problem.used & mask
    inputs = np.hstack([problem.view.p.numpy(), problem.view.q.numpy()])
    told = learn(inputs[shown], fitted.residual[shown], blocks(problem.table)[shown])(inputs[hidden])
    return total(fitted.residual[hidden] - told, np.ones(len(told), dtype=bool))


def _angles(inputs: np.ndarray) -> np.ndarray:
    q = inputs[:, 3:]
    return np.hstack([np.cos(q), np.sin(q), q])


def boosting(inputs: np.ndarray, values: np.ndarray, group: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Gradient boosting, one for each coordinate."""
    trees = [
        HistGradientBoostingRegressor(max_iter=400, learning_rate=0.06).fit(_angles(inputs), column)
        for column in values.T
    ]
    return lambda at: np.column_stack([tree.predict(_angles(at)) for tree in trees])


def process(inputs: np.ndarray, values: np.ndarray, group: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """A Gaussian process, one width for each input, learned on at most GP_ROWS rows."""
    rows = np.random.default_rng(0).permutation(len(inputs))[:GP_ROWS]
    x = _angles(inputs)
    middle, scale = x.mean(axis=0), x.std(axis=0) + 1e-9
    size = values.std()
    warnings.simplefilter("ignore", ConvergenceWarning)  # a width at its bound is an input that does not matter
    kernel = RBF(np.ones(x.shape[1]), (0.05, 1e3)) + WhiteKernel(0.1, (1e-4, 1e1))
    found = GaussianProcessRegressor(kernel, normalize_y=True).fit(
        (x[rows[:300]] - middle) / scale, values[rows[:300]] / size
    )
    learned = GaussianProcessRegressor(found.kernel_, optimizer=None, normalize_y=True)
    learned.fit((x[rows] - middle) / scale, values[rows] / size)
    return lambda at: learned.predict((_angles(at) - middle) / scale) * size


def network(columns: slice) -> Learn:
    """The Gaussian RBF network over tool space (columns 0 to 3) or joint space (3 to 9)."""

    def learn(inputs: np.ndarray, values: np.ndarray, group: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        trained = train_rbf(inputs[:, columns], values, group, settings=NETWORK).network
        return lambda at: np.where(trained.inside(at[:, columns])[:, None], trained.predict(at[:, columns]), 0.0)

    return learn


NETWORKS: dict[str, Learn] = {"RBF in tool space": network(slice(0, 3)), "RBF in joint space": network(slice(3, 9))}
PEERS: dict[str, Learn] = {"gradient boosting": boosting, "Gaussian process": process}


def transfer(stride: int, figures: list[Row]) -> None:
    """Fit on A and B together and hold the model against C; every series has its own frame and mount."""
    both = open_series(concat_tables([read_series("A", stride), read_series("B")]), per_run=True)
    other = open_series(read_series("C"))
    print(f"fitted on A and B ({int(both.used.sum())} readings), tested on C ({int(other.used.sum())}):")
    for names in ((), STEPS[:1], STEPS[:2], STEPS[:3]):
        fitted = fit(build_model(both.file, names), both)
        found = residual_of(replace(fitted.model, file=other.file), other)
        text, left = " + ".join(names) or "drawing", total(found.residual, other.used)
        print(f"  {text:<80} A+B {total(fitted.residual, both.used):8.1f}   C {left:8.1f}", flush=True)
        figures.append({"series": "A+B -> C", "model": text, "step": (names or ("drawing",))[-1], "random": left})
        if len(names) in (1, 3):
            _transfer_peers(both, other, fitted, found, text, figures)


def _transfer_peers(
    both: Problem, other: Problem, fitted: FitResult, found: FitResult, text: str, figures: list[Row]
) -> None:
    near = both.used & (np.linalg.norm(np.nan_to_num(fitted.residual), axis=1) < 1.5)
    inputs = [np.hstack([problem.view.p.numpy(), problem.view.q.numpy()]) for problem in (both, other)]
    for label, learn in PEERS.items():
        told = learn(inputs[0][near], fitted.residual[near], np.zeros(int(near.sum())))(inputs[1])
        left = total(found.residual - told, other.used)
        print(f"  {text + ' + ' + label:<80} {'':>12}   C {left:8.1f}", flush=True)
        figures.append({"series": "A+B -> C", "model": f"{text} + {label}", "step": label, "random": left})


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("series", nargs="?", default="ABCD")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--stride", type=int, default=1)
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--transfer", action="store_true")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    found: list[Row] = []
    for name in asked.series:
        problem = open_series(read_series(name, asked.stride))
        best = ladder(name, problem, asked.seeds, found)
        if not asked.no_peers:
            peers(name, problem, best.model.keys, NETWORKS, found)
            peers(name, problem, STEPS[:1], PEERS, found)
    if asked.transfer:
        transfer(asked.stride, found)
    if asked.out:
        asked.out.parent.mkdir(parents=True, exist_ok=True)
        asked.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
