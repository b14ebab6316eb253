"""Rivals of an effect: those that the diagnosis names, and others that imitate it closely."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.effects import Effect, Library
from ptt.effects.cards import card_of
from ptt.effects.metrology import TrackerFrame
from ptt.effects.registry import make_effect, parse_key
from ptt.fitting.result import FitResult
from ptt.plan.contest import GOAL, Contest, open_contest, triangle
from ptt.plan.design import DesignColumns, Rival, build_design, known_rows
from ptt.run.problem import Problem

MOST_SHAPES = 4  # sets of searched parameters of a rival that are kept, those that imitate best
FEW_SHAPES = 12  # such sets up to which an effect that the diagnosis does not name is tried as a rival
WATCHED = 5  # rivals beside the named ones, at most, for each effect
# Words on effect cards that name a measuring instrument.
TESTERS = ("linear scale", "coordinate measuring machine", "scale bar", "base reflectors", "height gauge",
           "on the bench", "reflector")  # fmt: skip


@dataclass(frozen=True)
class Duel:
    """One effect of the model against one rival.

    Attributes:
        pick: key of the effect.
        rival: key of the rival.
        named: whether the diagnosis cannot tell the two apart; else the rival must only not become one.
        forward: the effect supposed true, one contest for each shape of the rival.
        backward: the rival supposed true, with its fitted amplitudes; empty where not named.
    """

    pick: str
    rival: str
    named: bool
    forward: tuple[Contest, ...]
    backward: tuple[Contest, ...]


def find_duels(
    fitted: FitResult, problem: Problem, confused: Sequence[Sequence[str]], known: Library
) -> tuple[DesignColumns, list[Duel]]:
    """Set up the duels between the effects that have to be told apart.

    Args:
        fitted: the model with all picks in it.
        problem: the rows it was fitted on.
        confused: for each step the pick's key and those of effects that fit as well.
        known: effects by name.

    Returns:
        The columns, and the duels.
    """
    steps = [step for step in confused if len(step) > 1]
    named = [key for step in steps for key in step[1:]]
    others = _testable(fitted, problem, known, named)
    rivals = tuple(
        Rival(effect, shape)
        for effect in [*(make_effect(known, *parse_key(key)) for key in dict.fromkeys(named)), *others]
        for shape in effect.search(problem.view)
    )
    wide = build_design(fitted, problem, rivals)
    rows = known_rows(wide)
    chosen = {step[0]: _leading(wide, rows, step) for step in steps}
    used = sorted({index for found in chosen.values() for *_, places in found for index in places})
    design = build_design(fitted, problem, tuple(rivals[index] for index in used))
    kept = np.concatenate([np.arange(wide.width - sum(map(len, wide.index))), *(wide.index[i] for i in used)])
    rows = triangle(rows[:, kept.astype(int)])
    place = {index: number for number, index in enumerate(used)}
    duels = [
        _duel(design, rows, pick, key, [place[i] for i in places], is_named)
        for pick, found in chosen.items()
        for key, is_named, places in found
    ]
    return design, duels


def instrument(pick: str, rival: str, known: Library) -> str:
    """What can tell two effects apart, by their cards; an instrument where one is named.

    Args:
        pick: key of one.
        rival: key of the other.
        known: effects by name.

    Returns:
        A few words.
    """
    first, second = pick.partition("[")[0], rival.partition("[")[0]
    told = [
        what
        for one, other in ((first, second), (second, first))
        if one in known
        for thing, what in card_of(known[one]).confused_with
        if thing == other
    ]
    best = next((what for what in told if any(tester in what for tester in TESTERS)), told[0] if told else "")
    return best or _by_stage({known[name].stage for name in (first, second) if name in known})


def _by_stage(stages: set[str]) -> str:
    if "metrology" in stages:
        return "a calibrated scale bar, or reflectors fixed to the base"
    if "drive" in stages and len(stages) > 1:
        return "a linear scale on the axis, which sees the slider without the links"
    return "a coordinate measuring machine on the parts themselves"


def _testable(fitted: FitResult, problem: Problem, known: Library, named: Sequence[str]) -> list[Effect]:
    """Further effects that the run can test and that have few sets of searched parameters."""
    kind, found = problem.file.machine.kind, []
    for name, cls in known.items():
        if kind not in cls.mechanisms or name in named or name in fitted.model.keys or cls is TrackerFrame:
            continue
        effect = cls()
        if any(parameter.stem == "from" for parameter in effect.parameters):  # its range would bind all poses
            continue
        if effect.needs(problem.view) is None and len(effect.search(problem.view)) <= FEW_SHAPES:
            found.append(effect)
    return found


def _leading(design: DesignColumns, rows: np.ndarray, step: Sequence[str]) -> list[tuple[str, bool, list[int]]]:
    """Rivals of one pick, with the shapes that imitate it best: the named ones, and others within the goal."""
    pick, *named = step
    base, amplitudes = design.base(pick), design.amplitudes(pick)
    apart: dict[str, list[tuple[float, int]]] = {}
    for index, rival in enumerate(design.rivals):
        contest = open_contest(rows, np.concatenate([base, design.index[index]]), amplitudes)
        apart.setdefault(rival.effect.key, []).append((contest.separation, index))
    best = {key: [index for _, index in sorted(found)[:MOST_SHAPES]] for key, found in apart.items()}
    watched = sorted((min(found)[0], key) for key, found in apart.items() if key not in named)
    near = [key for distance, key in watched if distance < GOAL][:WATCHED]
    return [(key, True, best[key]) for key in named if key in best] + [(key, False, best[key][:1]) for key in near]


def _duel(design: DesignColumns, rows: np.ndarray, pick: str, key: str, places: list[int], named: bool) -> Duel:
    base, own = design.base(pick), design.of(pick)
    forward, backward = [], []
    for place in places:
        rival = design.index[place]
        contest = open_contest(rows, np.concatenate([base, rival]), design.amplitudes(pick))
        forward.append(contest)
        if not named:
            continue
        truth = np.zeros(design.width)
        truth[rival] = contest.solution[len(base) :]
        backward.append(open_contest(rows, np.concatenate([base, own]), truth))
    return Duel(pick, key, named, tuple(forward), tuple(backward))
