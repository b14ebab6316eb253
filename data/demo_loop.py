"""The loop of the demo on a sealed machine: compare, diagnose, add, learn the rest, predict, measure again, reveal."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptt.challenge.challenge import Sealed, open_challenge
from ptt.challenge.score import Score, score
from ptt.challenge.truth import find_truth
from ptt.correct.compensate import compensate
from ptt.correct.training.rest import correction_of
from ptt.correct.training.train import Training, train
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.floor import noise_floor
from ptt.effects.registry import library, make_effect, parse_key
from ptt.judge.compare.comparison import Comparison, compare_run
from ptt.judge.ladder.climb import climb
from ptt.judge.ladder.ladder import Ladder
from ptt.judge.run_errors import errors_of
from ptt.machine import MachineFile, load_machine, save_machine
from ptt.model.entries import read_model, write_model
from ptt.rig import simulate, write_run
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import Table
from ptt.show.plots.common import save
from ptt.show.plots.compare import plot_comparison
from ptt.show.plots.ladder import draw_ladder

HERE = Path(__file__).parent
SEALED = ("sealed_one", "sealed_three")
AFTER_SEED = 1000  # the second measurement has noise of its own
BEFORE, AFTER, NOISE = "#d1495b", "#00798c", "#6b705c"
DPI = 110


@dataclass(frozen=True)
class Walk:
    """Everything that came out on the way.

    Attributes:
        compared: the run against the drawing.
        found: what is missing.
        ladder: what adding it did.
        trained: the network for the rest.
        error_um: (n, 3) each, measured error before and after, in um, rows of the run.
        score: the seal opened.
    """

    compared: Comparison
    found: Diagnosis
    ladder: Ladder
    trained: Training
    error_um: tuple[np.ndarray, np.ndarray]
    score: Score


def walk_loop(name: str, out: Path) -> str:
    """Solve a sealed machine; the seal is opened only at the end.

    Args:
        name: folder of the challenge in data/.
        out: folder for the model, the run with corrected commands, and pictures.

    Returns:
        What happened, in words.
    """
    file, run, known = load_machine(HERE / name / "machine.toml"), read_table(HERE / name / "run.csv"), library()
    model, problem = read_model(file), build_problem(file, run)
    compared = compare_run(model, problem, noise=noise_floor(model, problem, known))
    plot_comparison(compared, problem, out)
    found = diagnose(model, problem, known)
    effects = [make_effect(known, *parse_key(step[0])) for step in found.suggested]
    ladder = climb(model, problem.with_noise(found.noise), effects)
    save(draw_ladder(ladder), out / "ladder.png")
    save_machine(write_model(ladder.model), out / "model.toml")
    trained = train(ladder.model, problem)
    sealed = open_challenge(HERE / name)
    after = measure_again(sealed, trained, read_table(HERE / name / "targets.csv", purpose="targets"), out)
    errors = error_um(run, file), error_um(after, file)
    truth = find_truth(sealed.drawn, known)
    scored = score(trained.physics.model, truth, correction_of(trained.rbf.network))
    walk = Walk(compared, found, ladder, trained, errors, scored)
    draw_walk(walk, run, out / "loop.png")
    return describe(walk, name)


def measure_again(sealed: Sealed, trained: Training, wanted: Table, out: Path) -> Table:
    """Send corrected commands for the run's own targets to the opened rig."""
    network = trained.rbf.network
    commands = compensate(
        trained.physics.model, wanted, correction=correction_of(network), inside=lambda place, _: network.inside(place)
    )
    sent = pd.DataFrame(commands.q, columns=["b1", "b2", "b3"])
    rig = sealed.drawn.rig
    result = simulate(rig, sealed.drawn.targets, sliders=sent, seed=rig.seed + AFTER_SEED)
    write_run(result.frame, out / "after.csv")
    return read_table(out / "after.csv")


def error_um(run: Table, file: MachineFile) -> np.ndarray:
    """Measured less target after the best rigid motion, (n, 3) um; NaN where there is no pose."""
    return 1e3 * errors_of(run, file).aligned


def describe(walk: Walk, name: str) -> str:
    """The walk in a few lines."""
    compared, found, scored = walk.compared, walk.found, walk.score
    most, noise = compared.depends_on[0], 1e3 * found.noise.total
    before, after = (rms(errors) for errors in walk.error_um)
    hidden = [f"{fault.name} {scored.judgement.faults[fault.name]}" for fault in scored.faults]
    tool = scored.tool.to_dict()
    assert tool["before"] is not None and tool["after"] is not None
    return "\n".join(
        [
            f"\nsealed machine data/{name}: {compared.rows} readings, nothing known but the drawing",
            f"  compare   {before:.1f} um rms after the frame, noise {noise:.1f} um; "
            f"most telling: {most.residual} error on {most.on}, {most.share:.0%} of its variance",
            f"  diagnose  {found.verdict}: {'; '.join(' = '.join(step) for step in found.suggested)}",
            *(f"            {line}." for line in " ".join(found.words.removesuffix(".").split()).split(". ")),
            f"  add       held-out error in um: {climbed(walk.ladder)}; noise floor {noise:.1f}",
            f"  network   {learned(walk.trained)}",
            f"  predict   corrected sliders, measured again: {before:.1f} -> {after:.1f} um rms; "
            f"the tool itself, without noise: {tool['before']['total']:.1f} -> {tool['after']['total']:.2f} um",
            f"  reveal    {', '.join(hidden)}: {'RIGHT' if scored.judgement.right else 'NOT RIGHT'}",
        ]
    )


def climbed(ladder: Ladder) -> str:
    """Held-out error after each step."""
    signs = {"added": "+ ", "removed": "- "}
    return ", ".join(f"{signs.get(s.kind, '')}{s.effect} {s.heldout_rms_um['total']:.1f}" for s in ladder.steps)


def learned(trained: Training) -> str:
    """How much of the rest the network took."""
    if not trained.rbf.learned.any():
        return "finds nothing left that it could learn: physics explains the run"
    return f"takes {trained.rbf_share:.0%} of the held-out variance that physics left"


def rms(errors: np.ndarray) -> float:
    """Root mean square length of the rows that are there."""
    return float(np.sqrt(np.nanmean(np.square(errors).sum(axis=1))))


def draw_walk(walk: Walk, run: Table, path: Path) -> None:
    """Errors seen from above before and after, at one scale, and between them the ladder."""
    figure = Figure(figsize=(12.0, 4.2), dpi=DPI, layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.0, 1.1, 1.0))
    middle.set_box_aspect(1.0 / 1.1)  # as high as the maps beside it
    scale = np.nanmax(np.abs(walk.error_um[0][:, :2])) / 20.0  # um per mm of the picture
    for panel, errors, colour, title in (
        (left, walk.error_um[0], BEFORE, "1  as it is: the tool misses by"),
        (right, walk.error_um[1], AFTER, "3  corrected, measured again:"),
    ):
        _draw_map(panel, run.target, errors / scale, colour)
        panel.set_title(f"{title}\n{rms(errors):.1f} um rms", fontsize=11)
    _draw_rungs(middle, walk.ladder)
    figure.supxlabel(f"maps: from above, arrows {1e3 / scale:.0f} times enlarged in both", fontsize=9)
    save(figure, path)


def _draw_map(panel: Axes, target: np.ndarray, arrow: np.ndarray, colour: str) -> None:
    rows = np.isfinite(arrow).all(axis=1) & np.isfinite(target).all(axis=1)
    panel.plot(*target[rows, :2].T, ".", color="0.6", markersize=4)
    panel.quiver(
        *target[rows, :2].T, *arrow[rows, :2].T, color=colour, angles="xy", scale_units="xy", scale=1.0, width=0.004
    )
    reach = np.abs(target[rows, :2]).max() + 22.0
    panel.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")


def _draw_rungs(panel: Axes, ladder: Ladder) -> None:
    values = [step.heldout_rms_um["total"] for step in ladder.steps]
    names = [f"+ {step.effect}" if step.kind == "added" else step.effect for step in ladder.steps]
    noise = ladder.noise_um["total"]
    panel.barh(range(len(values)), values, color=[BEFORE, *[AFTER] * (len(values) - 1)], height=0.55)
    panel.axvline(noise, color=NOISE, linestyle="--", label=f"noise floor {noise:.1f} um")
    for row, value in enumerate(values):
        panel.annotate(
            f"{value:.1f}", (value, row), xytext=(5, 0), textcoords="offset points", va="center",
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"},
        )  # fmt: skip
    panel.set_yticks(range(len(values)), names)
    panel.set(xlabel="held-out error [um rms]", xlim=(0.0, 1.18 * max(values)), ylim=(len(values) - 0.4, -0.6))
    panel.set_title("2  named and added:\nthe error falls to the noise", fontsize=11)
    panel.legend(loc="lower right", frameon=False, fontsize=9)
    panel.spines[["top", "right"]].set_visible(False)
