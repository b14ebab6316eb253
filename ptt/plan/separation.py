"""What to measure next: poses that best discriminate between effects that a run could not tell apart."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch

from ptt.effects import Library, library
from ptt.fitting.result import FitResult
from ptt.plan.contest import GOAL, Contest
from ptt.plan.design import DesignColumns
from ptt.plan.planned import planned_rows
from ptt.plan.pool import Conditions, conditions_for, make_pool, with_base
from ptt.plan.rivals import Duel, find_duels, instrument
from ptt.plan.space import Space, build_space
from ptt.plan.visits import Visit, as_counted, in_driving_order, table_of
from ptt.plan.words import say_ambiguity, say_separation
from ptt.record import Record
from ptt.run.problem import Problem
from ptt.run.table import Table
from ptt.run.target_frame import kept_frame, stated_frame

MOST_ROWS = 80  # without base reflectors
LEAST_ROWS = 24  # so that neither one bad reading nor a corner of the volume decides
RESERVE = 1.1  # factor on the goal in the choice of poses, because their driving order changes the separation a little
FLAT = 1.0  # least increase of separation by all candidates together, sigma (in quadrature); else no pose can help
BASE = 'reflectors fixed to the base, and frame = "measured" in the machine file'


@dataclass(frozen=True)
class Pair(Record):
    """Two effects that the run could not tell apart.

    Attributes:
        pick: key of the effect that was picked.
        rival: key of the other.
        before: separation on the run, sigma.
        after: with the chosen rows, sigma.
        ceiling: with all candidate poses, sigma.
        exact: whether no pose can tell them apart.
        instrument: what could, by the effects' cards; '' where poses can.
    """

    keys: ClassVar[str] = (
        "effect: pick, rival, separation_sigma.before: before, separation_sigma.after: after, "
        "separation_sigma.ceiling: ceiling, exact, instrument, words"
    )

    pick: str
    rival: str
    before: float
    after: float
    ceiling: float
    exact: bool
    instrument: str

    @property
    def words(self) -> str:
        """A sentence where no pose can tell them apart; else ''."""
        return say_ambiguity(self.pick, self.rival, self.instrument) if self.exact else ""


@dataclass(frozen=True)
class Separation(Record):
    """What to measure next.

    Attributes:
        targets: rows to drive in this order, in the frame that the run states its targets in; None where no pose helps.
        pairs: the confused pairs of effects.
        before: least separation of the pairs that poses can tell apart, on the run, sigma; NaN without any.
        after: least separation of these with the targets, sigma; NaN likewise.
        reached: whether it reaches the goal.
        words: for a machinist.
    """

    keys: ClassVar[str] = "rows, separation_sigma.before: before, separation_sigma.after: after, reached, pairs, words"

    targets: Table | None
    pairs: tuple[Pair, ...]
    before: float
    after: float
    reached: bool
    words: str

    @property
    def rows(self) -> int:
        """Rows to drive."""
        return 0 if self.targets is None else self.targets.rows

    @property
    def lines(self) -> tuple[str, ...]:
        """The words, one sentence each."""
        return tuple(self.words.split("\n"))


def plan_separation(
    fitted: FitResult,
    problem: Problem,
    confused: Sequence[Sequence[str]],
    known: Library | None = None,
) -> Separation | None:
    """Choose poses that tell apart what a run could not.

    Either effect is taken to be the truth in turn, with its fitted size; the other is fitted to its signature on old
    and new rows together, with everything else of the model and the tracker's frame. Visits are added one by one where
    the misfit that remains grows most (T-optimal between rivals), until its root reaches `GOAL`.

    Args:
        fitted: the model with all picks in it.
        problem: the rows it was fitted on.
        confused: for each step the pick's key and those of effects that fit as well; steps without others are skipped.
        known: effects by name; None for the library.

    Returns:
        The choice; None where nothing is confused.
    """
    known = library() if known is None else known
    if not any(len(step) > 1 for step in confused):
        return None
    design, duels = find_duels(fitted, problem, confused, known)
    space = build_space(problem.file)
    conditions = conditions_for(problem, known, confused)
    pool = make_pool(design, space, conditions, np.random.default_rng([0, 31]))
    groups = planned_rows(design, pool, space, still=True)
    everything = groups.reshape(-1, groups.shape[-1])
    ceilings = {id(contest): contest.add(everything).separation for contest in _contests(duels)}
    open_ = [_still_open(duel, ceilings) for duel in duels]
    hopeful = any(duel.named and duel.forward for duel in open_)
    chosen = _choose(_contests(open_), groups) if hopeful else []
    visits = in_driving_order([pool[index] for index in chosen], space) if chosen else []
    visits = [visit.named(f"m{number + 1}") for number, visit in enumerate(visits)]
    rows = planned_rows(design, visits, space).reshape(-1, design.width) if visits else np.zeros((0, design.width))
    pairs = tuple(
        _judge(duel, live, design, (rows, everything), ceilings, known)
        for duel, live in zip(duels, open_, strict=True)
        if duel.named
    )
    return _report(pairs, visits, space, problem, conditions)


def _contests(duels: Sequence[Duel]) -> list[Contest]:
    return [contest for duel in duels for contest in (*duel.forward, *duel.backward)]


def _still_open(duel: Duel, ceilings: dict[int, float]) -> Duel:
    """The duel with only the contests that poses can decide: a rival that contains the effect fits any of its data."""

    def alive(contest: Contest) -> bool:
        return ceilings[id(contest)] ** 2 > contest.misfit + FLAT**2

    if not all(alive(contest) for contest in duel.forward):
        return replace(duel, forward=(), backward=())
    return replace(duel, backward=tuple(contest for contest in duel.backward if alive(contest)))


def _choose(contests: list[Contest], groups: np.ndarray) -> list[int]:
    """Choose groups of rows greedily, by the growth of log(1 + lambda) over the contests that are not decided yet."""
    chosen: list[int] = []
    free, goal = np.ones(len(groups), dtype=bool), GOAL * RESERVE
    rows = groups.shape[1] // 3
    while contests and (len(chosen) + 1) * rows <= MOST_ROWS and free.any():
        waiting = [contest for contest in contests if contest.separation < goal]
        if not waiting and len(chosen) * rows >= LEAST_ROWS:
            break
        most = goal**2 if waiting else np.inf
        worth = sum(
            np.log1p(np.minimum(contest.misfit + contest.gains(groups), most)) - np.log1p(contest.misfit)
            for contest in waiting or contests
        )
        best = int(np.argmax(np.where(free, worth, -np.inf)))
        chosen.append(best)
        free[best] = False
        contests = [contest.add(groups[best]) for contest in contests]
    return chosen


def _judge(
    duel: Duel,
    live: Duel,
    design: DesignColumns,
    rows: tuple[np.ndarray, np.ndarray],
    ceilings: dict[int, float],
    known: Library,
) -> Pair:
    """Separation of a pair before and after, the least over the rival's shapes and over which of the two is true."""
    new, everything = rows
    exact = not live.forward
    contests = list(duel.forward) if exact else _contests([live])
    before = min(contest.separation for contest in contests)
    after = min((contest.add(new) if len(new) else contest).separation for contest in contests)
    ceiling = min(ceilings[id(contest)] for contest in contests)
    held = exact and all(_grows(contest.without(design.frames), everything) for contest in duel.forward)
    tool = BASE if held else instrument(duel.pick, duel.rival, known)
    return Pair(duel.pick, duel.rival, before, after, ceiling, exact, tool if exact else "")


def _grows(contest: Contest, rows: np.ndarray) -> bool:
    """Whether rows can decide a contest."""
    return contest.add(rows).misfit > contest.misfit + FLAT**2


def _report(
    pairs: tuple[Pair, ...], visits: list[Visit], space: Space, problem: Problem, conditions: Conditions
) -> Separation:
    solvable = [pair for pair in pairs if not pair.exact]
    before = min((pair.before for pair in solvable), default=float("nan"))
    after = min((pair.after for pair in solvable), default=float("nan"))
    straight = problem.file.machine.moves == "straight"
    frame = stated_frame(kept_frame(problem.file.targets, problem.stated_in))
    rows = with_base(visits, problem.file)
    targets = as_counted(table_of(rows, space, straight=straight), frame) if visits else None
    reached = bool(solvable) and after >= GOAL
    words = "\n".join(_sentences(pairs, visits, space, problem, conditions))
    return Separation(targets, pairs, before, after, reached, words)


def _sentences(
    pairs: tuple[Pair, ...], visits: list[Visit], space: Space, problem: Problem, conditions: Conditions
) -> Iterator[str]:
    if visits:
        places = space.mechanism.forward(torch.cat([visit.q for visit in visits])).numpy()
        solvable = [pair for pair in pairs if not pair.exact]
        parted = [(pair.pick, pair.rival, pair.before, pair.after) for pair in solvable]
        yield from say_separation(places, problem, parted, conditions)
    for pair in pairs:
        if pair.exact:
            yield say_ambiguity(pair.pick, pair.rival, pair.instrument)
