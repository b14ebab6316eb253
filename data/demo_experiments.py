"""The five experiments of the demo: train, predict, send the commands to the rig, measure again."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from demo_pictures import plot_path, plot_reductions

from nets import GaussianRbf
from ptt.correct.compensate import compensate
from ptt.correct.training.physics import fit_physics
from ptt.correct.training.protocols import PROTOCOLS
from ptt.correct.training.rest import correction_of, learn_rest
from ptt.effects.registry import library, make_effect
from ptt.fitting.result import sound_rows
from ptt.judge.evaluate import evaluate_pair
from ptt.judge.evaluation import Evaluation, compare_errors
from ptt.judge.run_errors import errors_of
from ptt.machine import load_machine
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.rig import Rig, load_rig, simulate, write_run
from ptt.run.axes import AXES
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.table import Table, make_table
from ptt.show.plots.common import save
from ptt.show.plots.compensation import draw_error_curves

HERE = Path(__file__).parent
GEOMETRY = (
    "homing-offset", "lead-scale", "once-per-rev", "tower-position", "tower-tilt", "link-length", "windup",
    "joint-clearance",  # without a load nobody knows the links' forces, and the fit leaves it out
)  # fmt: skip
LABELS = {
    1: "1: backlash not\ncompensated",
    2: "2: compensated\nby the controller",
    3: "3: as 2, 1 kg",
    4: "4: as 2, 3 kg",
    5: "5: as 2, 5 kg",
}
MODELS = ("network alone", "physics and network")
RANDOM, BLOCKS = "160/20 random poses", "whole parts of the path"
BACK, UNSEEN = "same path, other way", "another path"
AFTER_SEED = 1000  # the second measurement has noise of its own

Results = dict[tuple[int, str, str], Evaluation]


@dataclass(frozen=True)
class Bench:
    """One experiment, seen with one model.

    Attributes:
        stem: of the files of its runs.
        rig: the reality behind it.
        run: what was measured without compensation.
        problem: the same seen through the drawing.
        model: with the effects to fit.
        out: folder for runs.
    """

    stem: str
    rig: Rig
    run: Table
    problem: Problem
    model: Model
    out: Path


@dataclass(frozen=True)
class Measured:
    """An experiment measured again with corrected commands.

    Attributes:
        run: without compensation.
        after: the same path, all poses trained on, compensated.
        problem: the first seen through the drawing.
        results: protocol -> error before and after.
    """

    run: Table
    after: Table
    problem: Problem
    results: dict[str, Evaluation]


def measure_experiment(number: int, model: str, out: Path) -> Measured:
    """Every protocol of one experiment, measured on the rig with the commands of one model.

    Args:
        number: 1 to 5.
        model: of `MODELS`.
        out: folder for runs.

    Returns:
        What was measured.
    """
    bench = open_bench(number, model, out)
    results = {RANDOM: measure_hidden(bench, "random"), BLOCKS: measure_hidden(bench, "blocks")}
    whole = train_without(bench, np.zeros(bench.run.rows, dtype=bool), PROTOCOLS["blocks"](bench.problem).groups)
    for targets, title in (("targets_reversed", BACK), ("targets_unseen", UNSEEN)):
        before = run_rig(bench, targets, None)
        results[title] = evaluate_pair(before, compensated(bench, whole, targets), bench.problem.file)
    return Measured(bench.run, compensated(bench, whole, "targets"), bench.problem, results)


def open_bench(number: int, model: str, out: Path) -> Bench:
    """Read an experiment and its machine."""
    file = load_machine(HERE / ("machine.toml" if number == 1 else "machine_compensated.toml"))
    run = read_table(HERE / f"experiment{number}.csv")
    chosen, known = read_model(file), library()
    for name in () if model == MODELS[0] else GEOMETRY:
        chosen = chosen + make_effect(known, name)
    if model != MODELS[0] and not file.controller.compensates:
        chosen = chosen + make_effect(known, "backlash")
    rig = load_rig(HERE / "rigs" / f"experiment{number}.toml")
    stem = f"experiment{number}_{model.replace(' ', '_')}"
    return Bench(stem, rig, run, build_problem(file, run).anchored(), chosen, out)


def measure_hidden(bench: Bench, name: str) -> Evaluation:
    """Hide each fold in turn, train on the rest, and measure the hidden poses on the rig."""
    protocol = PROTOCOLS[name](bench.problem)
    parts = []
    for hidden in protocol.folds:
        after = compensated(bench, train_without(bench, hidden, protocol.groups), "targets")
        parts.append(evaluate_pair(bench.run, after, bench.problem.file, rows=hidden))
    return join(parts, protocol.text)


def train_without(bench: Bench, hidden: np.ndarray, groups: np.ndarray) -> tuple[Model, GaussianRbf]:
    """Physics and network that have not seen the hidden rows."""
    shown = bench.problem.masked(hidden)
    fitted = fit_physics(bench.model, shown, lean=True)
    return fitted.model, learn_rest(shown, fitted, sound_rows(shown, fitted), groups).network


def compensated(bench: Bench, trained: tuple[Model, GaussianRbf], targets: str) -> Table:
    """Correct the commands of all cycles, send them to the rig, and measure."""
    model, network = trained
    wanted = read_table(HERE / f"{targets}.csv", purpose="targets")
    # All cycles in travel order: the way back to the first target reverses sliders too.
    cycles = bench.rig.conditions.cycles
    every = make_table(np.tile(wanted.target, (cycles, 1)), name=np.tile(wanted.name, cycles), source=wanted.source)
    commands = compensate(
        model, every, correction=correction_of(network), inside=lambda place, _: network.inside(place)
    )
    return run_rig(bench, targets, commands.q)


def run_rig(bench: Bench, targets: str, sliders: np.ndarray | None) -> Table:
    """Measure on the rig, and read the run back from its file like any other."""
    wanted = read_table(HERE / f"{targets}.csv", purpose="targets")
    frame = pd.DataFrame(wanted.target, columns=[f"{axis}_cmd" for axis in AXES]).assign(name=wanted.name)
    sent = None if sliders is None else pd.DataFrame(sliders, columns=["b1", "b2", "b3"])
    result = simulate(bench.rig, frame, sliders=sent, seed=bench.rig.seed + AFTER_SEED + (sent is None))
    path = bench.out / f"{bench.stem}_{targets}_{'before' if sent is None else 'after'}.csv"
    write_run(result.frame, path)
    return read_table(path)


def join(parts: list[Evaluation], text: str) -> Evaluation:
    """Several folds as one evaluation."""
    before, after = (np.concatenate([getattr(part, side) for part in parts]) for side in ("before", "after"))
    protocol = parts[0].protocol | {"rows": len(before), "held_out": text}
    return Evaluation(before, after, protocol, None, parts[0].noise)


def describe(number: int, results: Results) -> str:
    """The table of one experiment, protocols side by side."""
    mine = {key[1:]: value for key, value in results.items() if key[0] == number}
    noise = next(iter(mine.values())).noise
    floor = "" if noise is None else "; noise floor " + ", ".join(
        f"{axis} {1e3 * sigma:.1f}" for axis, sigma in zip(AXES, noise.sigma, strict=True)
    )  # fmt: skip
    head = f"{'':<46}" + "".join(f"{axis + ': before  after  less %':>27}" for axis in AXES)
    lines = [f"\nexperiment {LABELS[number].replace(chr(10), ' ')}, mean |error| in um, measured again{floor}", head]
    for (model, protocol), value in mine.items():
        figures = compare_errors(value.before, value.after)["axes"]
        cells = (f"{f['before_um']:15.0f} {f['after_um']:6.1f} {_percent(f):5.1f}" for f in figures.values())
        met = all(f["goal_met"] for f in figures.values())
        lines.append(f"{model:<21}{protocol:<25}" + "".join(cells) + ("" if met else "  below 90, 90, 80"))
    return "\n".join(lines)


def draw(results: Results, first: Measured, out: Path) -> None:
    """The pictures of the first experiment, and all reductions."""
    chosen = {}
    for model, protocol in dict.fromkeys(key[1:] for key in results):
        if model == MODELS[1] or protocol in (RANDOM, BLOCKS):
            values = [results[number, model, protocol] for number in LABELS]
            percent = [[_percent(f) for f in compare_errors(v.before, v.after)["axes"].values()] for v in values]
            chosen[f"{model}: {protocol}"] = percent
    title = "Error taken away, measured on the rig with corrected commands"
    plot_reductions(chosen, list(LABELS.values()), out / "reductions.png", title=title)
    before, after = (_curve(table, first.problem) for table in (first.run, first.after))
    target = first.run.target[np.unique(pose_groups(first.run), return_index=True)[1]][1:]
    errors = errors_of(first.after, first.problem.file)
    noise, repeats = errors.noise, round(np.isfinite(errors.aligned).all(axis=1).sum() / len(after))
    floor = None if noise is None else {a: 1e3 * s / repeats**0.5 for a, s in zip(AXES, noise.sigma, strict=True)}
    title = f"Experiment 1, mean over {repeats} repeats of each pose"
    save(draw_error_curves(before, after, title=title, noise_um=floor, repeats=repeats), out / "errors.png")
    plot_path(target, before, after, out / "path.png", title="Experiment 1: the path")


def _curve(table: Table, problem: Problem) -> np.ndarray:
    """Mean error of each pose over its repeats, (m, 3) mm."""
    errors = errors_of(table, problem.file).aligned
    rows = np.isfinite(errors).all(axis=1)
    _, pose = np.unique(pose_groups(table)[rows], return_inverse=True)
    return np.column_stack([np.bincount(pose, column) for column in errors[rows].T]) / np.bincount(pose)[:, None]


def _percent(figures: dict[str, float]) -> float:
    return figures["reduction_percent"]
