"""The whole loop on the five experiments: train, predict, send the commands to the rig, measure again.

Usage: python data/demo.py [FOLDER]; pictures and runs go to FOLDER, `out` by default.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from ptt.commands.common import plain, progress
from ptt.compensate import compensate
from ptt.effects.registry import library, make_effect
from ptt.evaluate import AXES, Evaluation, compare_errors, errors_of, evaluate_pair
from ptt.files import write_text
from ptt.holdout import pose_groups
from ptt.machine import load_machine
from ptt.model import Model, read_model
from ptt.plots.compensation import mean_by_pose, plot_error_curves, plot_path, plot_reductions
from ptt.problem import Problem, build_problem
from ptt.rig import Rig, load_rig, simulate, write_run
from ptt.table import Table, make_table, read_table
from ptt.training.train import PROTOCOLS, Protocol, correction_of, fit_physics, learn_rest, sound

HERE = Path(__file__).parent
GEOMETRY = ("homing-offset", "lead-scale", "once-per-rev", "tower-position", "tower-tilt", "link-length", "windup")
LABELS = {
    1: "1: backlash not\ncompensated",
    2: "2: compensated\nby the controller",
    3: "3: as 2, 1 kg",
    4: "4: as 2, 3 kg",
    5: "5: as 2, 5 kg",
}
MODELS = ("network alone", "physics and network")
AFTER_SEED = 1000  # the second measurement has noise of its own


@dataclass(frozen=True)
class Bench:
    """One experiment.

    Attributes:
        number: 1 to 5.
        rig: the reality behind it.
        run: what was measured without compensation.
        problem: the same seen through the drawing.
        models: effects to fit, by name.
        out: folder for runs.
    """

    number: int
    rig: Rig
    run: Table
    problem: Problem
    models: dict[str, Model]
    out: Path


def main(out: Path) -> None:
    """Train, compensate and measure again, for all experiments, models and protocols."""
    results: dict[tuple[int, str, str], Evaluation] = {}
    with progress() as tell:
        total = 5 * len(MODELS) * 4
        for number in LABELS:
            bench = open_bench(number, out / "runs")
            for model in MODELS:
                for name, result in measure_protocols(bench, model):
                    results[number, model, name] = result
                    tell(f"experiment {number}, {model}", len(results), total)
    for number in LABELS:
        print(describe(number, results))
    draw(results, out)
    data = {f"experiment {key[0]}, {key[1]}, {key[2]}": value.to_dict() for key, value in results.items()}
    write_text(out / "experiments.json", json.dumps(plain(data), indent=1) + "\n")
    print(f"pictures, runs and figures in {out}/")


def open_bench(number: int, out: Path) -> Bench:
    """Read an experiment and its machine."""
    file = load_machine(HERE / ("machine.toml" if number == 1 else "machine_compensated.toml"))
    run = read_table(HERE / f"experiment{number}.csv")
    bare, known = read_model(file), library()
    physics = bare
    for name in (*GEOMETRY, *(() if file.controller.compensates else ("backlash",))):
        physics = physics + make_effect(known, name)
    rig = load_rig(HERE / "rigs" / f"experiment{number}.toml")
    problem = build_problem(file, run).anchored()
    return Bench(number, rig, run, problem, dict(zip(MODELS, (bare, physics), strict=True)), out)


def measure_protocols(bench: Bench, model: str) -> Iterator[tuple[str, Evaluation]]:
    """Every protocol, measured on the rig with corrected commands."""
    for name, title in (("random", "160/20 random poses"), ("blocks", "whole parts of the path")):
        protocol = PROTOCOLS[name](bench.problem)
        parts = []
        for hidden in protocol.folds:
            after = compensate_and_measure(bench, model, protocol, hidden, "targets")
            parts.append(evaluate_pair(bench.run, after, bench.problem.file, rows=hidden))
        yield title, join(parts, protocol.text)
    nothing = np.zeros(bench.run.rows, dtype=bool)
    for targets, title in (("targets_reversed", "same path, other way"), ("targets_unseen", "another path")):
        before = run_rig(bench, read_table(HERE / f"{targets}.csv", purpose="targets"), None)
        after = compensate_and_measure(bench, model, PROTOCOLS["blocks"](bench.problem), nothing, targets)
        yield title, evaluate_pair(before, after, bench.problem.file)


def compensate_and_measure(bench: Bench, name: str, protocol: Protocol, hidden: np.ndarray, targets: str) -> Table:
    """Train without the hidden rows, correct the commands, send them to the rig."""
    wanted = read_table(HERE / f"{targets}.csv", purpose="targets")
    cycles = cycle_targets(wanted, bench.rig.conditions.cycles)
    shown = bench.problem.masked(hidden)
    fitted = fit_physics(bench.models[name], shown)
    network = learn_rest(shown, fitted, sound(shown, fitted), protocol.groups).network
    commands = compensate(fitted.model, cycles, correction=correction_of(network), inside=network.inside)
    return run_rig(bench, wanted, commands.q)


def cycle_targets(wanted: Table, cycles: int) -> Table:
    """The targets of all cycles in travel order: the way back to the first one reverses sliders too."""
    return make_table(np.tile(wanted.target, (cycles, 1)), name=np.tile(wanted.name, cycles), source=wanted.source)


def run_rig(bench: Bench, wanted: Table, sliders: np.ndarray | None) -> Table:
    """Measure on the rig, and read the run back from its file like any other."""
    frame = pd.DataFrame(wanted.target, columns=[f"{axis}_cmd" for axis in AXES]).assign(name=wanted.name)
    sent = None if sliders is None else pd.DataFrame(sliders, columns=["b1", "b2", "b3"])
    result = simulate(bench.rig, frame, sliders=sent, seed=bench.rig.seed + AFTER_SEED + (sent is None))
    path = bench.out / f"experiment{bench.number}_{'before' if sent is None else 'after'}.csv"
    write_run(result.frame, path)
    return read_table(path)


def join(parts: list[Evaluation], text: str) -> Evaluation:
    """Several folds as one evaluation."""
    before, after = (np.concatenate([getattr(part, side) for part in parts]) for side in ("before", "after"))
    protocol = parts[0].protocol | {"rows": len(before), "held_out": text}
    return Evaluation(before, after, protocol, None, parts[0].noise)


def describe(number: int, results: dict[tuple[int, str, str], Evaluation]) -> str:
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


def draw(results: dict[tuple[int, str, str], Evaluation], out: Path) -> None:
    """The pictures of the first experiment, and all reductions."""
    chosen = {}
    for model, protocol in dict.fromkeys(key[1:] for key in results):
        if model == MODELS[1] or protocol in ("160/20 random poses", "same path, other way"):
            values = [results[number, model, protocol] for number in LABELS]
            percent = [[_percent(f) for f in compare_errors(v.before, v.after)["axes"].values()] for v in values]
            chosen[f"{model}: {protocol}"] = percent
    title = "Error taken away, measured on the rig with corrected commands"
    plot_reductions(chosen, list(LABELS.values()), out / "reductions.png", title=title)
    bench = open_bench(1, out / "runs")
    nothing = np.zeros(bench.run.rows, dtype=bool)
    after = compensate_and_measure(bench, MODELS[1], PROTOCOLS["blocks"](bench.problem), nothing, "targets")
    curves = [_curve(table, bench) for table in (bench.run, after)]
    target = bench.run.target[np.unique(pose_groups(bench.run), return_index=True)[1]][1:]
    noise = errors_of(after, bench.problem.file).noise
    floor = None if noise is None else {axis: 1e3 * s for axis, s in zip(AXES, noise.sigma, strict=True)}
    title = "Experiment 1, mean over 7 repeats of each pose"
    plot_error_curves(*curves, out / "errors.png", title=title, noise_um=floor)
    plot_path(target, *curves, out / "path.png", title="Experiment 1: the path")


def _curve(table: Table, bench: Bench) -> np.ndarray:
    errors = errors_of(table, bench.problem.file).aligned
    rows = np.isfinite(errors).all(axis=1)
    return mean_by_pose(errors[rows], pose_groups(table)[rows])


def _percent(figures: dict[str, float]) -> float:
    return figures["reduction_percent"]


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out"))
