"""Pulls: how far fits are from the truth in their own standard errors, on rigs drawn by seed.

Run it as `python benchmarks/pulls.py [DRAWS] [FAMILY...]`. Families: `single` and `several` faults on the bench,
`foreign` for one to three faults on machines of other geometry, travel and path. Exactly the hidden effects are fitted.
Truth and estimate are projected onto what the fit calls measured; the noise is white, as standard errors assume, and
its size is stated. Of many such pulls, 95.4 % should lie within two and none beyond five. Below the table stand the
single effects, and each pull beyond four.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parent))

from coverage import SEEN_AT_ALL, TRUTH, WHITE, Draw, machine, onto_measured

from ptt.challenge.cases import AMBIGUOUS
from ptt.challenge.hide import FAULTS, hide_faults
from ptt.challenge.truth import table_of
from ptt.effects import library
from ptt.effects.layout import linear_size
from ptt.fitting.linear import usual_sizes
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.rig.draw import PROTOCOLS, DrawnRig, draw_rig
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.rig import Rig
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem

COUNTS = {"single": (1, 2), "several": (2, 5), "foreign": (1, 4)}  # least number of faults, and one more than the most
ROWS = 240
PLAIN = TRUTH.keys() - AMBIGUOUS
# Their law in the rig is another one than the effect's: sums of waves against curves of few shapes (and their straight
# part is a lead), temperatures of screws against the room's, play taken up along the path against its chords, and a
# rail that leans on the drawing already is turned by a fault, not shifted level.
RICHER = ("screw-error-map", "guide-straightness", "screw-growth", "windup", "following-error")


@dataclass(frozen=True)
class Pull:
    """One parameter of one fit."""

    family: str
    seed: int
    effects: tuple[str, ...]
    name: str
    value: float

    @property
    def effect(self) -> str:
        """The effect that it belongs to."""
        return self.name.split(" ")[0]


def hide(family: str, seed: int) -> DrawnRig:
    """Draw a rig with faults."""
    random = np.random.default_rng([seed, 41])
    protocol = PROTOCOLS[int(random.integers(len(PROTOCOLS)))]
    if family == "foreign":
        drawn = draw_foreign(seed, protocol, noise="white", rows=int(random.integers(80, 300)))
    else:
        drawn = draw_rig(seed, machine(), protocol, rows=ROWS)
    names = [name for name, fault in FAULTS.items() if name in PLAIN and protocol in fault.protocols]
    if drawn.rig.machine.tracker.frame == "fitted-per-run":  # a knock about the change of runs is the next run's frame
        names = [name for name in names if name != "setup-jump"]
    chosen = random.permutation(names)[: int(random.integers(*COUNTS[family]))].tolist()
    return hide_faults(drawn, chosen, seed)


def quiet(rig: Rig) -> Rig:
    """The rig with a white tracker of a stated sigma."""
    plain = {"white_mm": WHITE, "wander_um": 0.0, "outlier_share": 0.0, "axis_um": (0.0, 0.0, 0.0), "quantum_um": 0.0}
    known = {key: value for key, value in plain.items() if key in type(rig.tracker).model_fields}
    tracker = rig.machine.tracker.model_copy(update={"sigma_mm": WHITE})
    return replace(rig, tracker=rig.tracker.model_copy(update=known), machine=replace(rig.machine, tracker=tracker))


def pulls_of(family: str, seed: int) -> list[Pull]:
    """Draw, fit exactly what is hidden, compare."""
    drawn = hide(family, seed)
    drawn = replace(drawn, rig=quiet(drawn.rig))
    run = simulate(drawn.rig, drawn.targets)
    problem = build_problem(drawn.rig.machine, table_of(run.frame))
    model = Model(drawn.rig.machine)
    for name in drawn.truth:
        if name not in TRUTH or library()[name]().needs(problem.view):
            return []
        model = model + library()[name]()
    fitted = fit(model, problem)
    truth, chosen = np.zeros(len(fitted.unknowns)), np.zeros(len(fitted.unknowns), dtype=bool)
    for index, term in enumerate(fitted.model.terms):
        alone = replace(fitted, model=replace(fitted.model, terms=(term,)))
        own = np.flatnonzero(fitted.layout.owner == index)[: linear_size(term.effect, 3)]
        values = TRUTH[term.effect.name](Draw(drawn.rig, run, drawn.truth[term.effect.name]), problem, alone)
        truth[own], chosen[own] = values / usual_sizes(term.effect, problem), True
    return [
        Pull(family, seed, fitted.model.keys, fitted.layout.names[place], value)
        for place, value in compare(fitted, truth, chosen)
    ]


def compare(fitted: FitResult, truth: np.ndarray, chosen: np.ndarray) -> list[tuple[int, float]]:
    """Distances in standard errors of what is measured: place of the unknown, distance."""
    own = np.flatnonzero(chosen)
    scale = (fitted.layout.scale * fitted.sizes)[own]
    onto = onto_measured(fitted.unseen[own])
    error = onto @ ((fitted.unknowns - truth) / fitted.sizes)[own]
    variance = np.diag(onto @ (fitted.covariance[np.ix_(own, own)] / np.outer(scale, scale)) @ onto)
    seen = (np.diag(onto) > SEEN_AT_ALL) & ~fitted.layout.held[own]
    return [(int(own[i]), float(error[i] / np.sqrt(variance[i]))) for i in np.flatnonzero(seen)]


def plain(pull: Pull) -> bool:
    """All faults of the rig follow the effects' own laws."""
    richer = (*RICHER, "tower-tilt") if pull.family == "foreign" else RICHER
    return not set(pull.effects) & set(richer)


def line(name: str, values: Sequence[float]) -> str:
    """Shares of some pulls."""
    size = np.abs(np.asarray(values))
    if not len(size):
        return f"{name:<34}{0:>8}"
    within = [float(np.mean(size <= limit)) for limit in (1, 2, 3)]
    return (
        f"{name:<34}{len(size):>8}"
        + "".join(f"{share:>9.1%}" for share in within)
        + f"{(size > 5).sum():>10}{size.max():>9.1f}"
    )


def main() -> None:
    """Print the table."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    families = sys.argv[2:] or COUNTS
    found: list[Pull] = []
    print(f"{'family':<34}{'pulls':>8}{'within 1':>9}{'within 2':>9}{'within 3':>9}{'beyond 5':>10}{'worst':>9}")
    for family in families:
        own = [pull for seed in range(draws) for pull in pulls_of(family, seed)]
        own_law = [pull.value for pull in own if plain(pull)]
        print(line(f"{family}, the effect's own law", own_law), flush=True)
        print(line(f"{family}, all", [pull.value for pull in own]), flush=True)
        found += own
    for effect in sorted({pull.effect for pull in found}):
        print(line(f"  {effect}", [pull.value for pull in found if pull.effect == effect]))
    for pull in sorted(found, key=lambda pull: -abs(pull.value)):
        if abs(pull.value) > 4:
            print(f"{pull.family} {pull.seed} {pull.name} {pull.value:+.1f}  ({', '.join(pull.effects)})")


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
