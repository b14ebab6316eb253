"""Harmonics of a turn: lines at integer fractions of a screw's lead or a gear's period in a residual's spectrum."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_bent
from ptt.diagnosis.evidence.effect_atoms import effect_atom, odds_of_effect
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.improve import HOPEFUL_NATS, SLOW_BELOW, climb, improve
from ptt.diagnosis.search.moves import droppable
from ptt.diagnosis.search.periods import SPECTRUM_ROWS
from ptt.diagnosis.search.plainest import PLAIN_NATS, plainest
from ptt.diagnosis.search.shapes import shape_key
from ptt.diagnosis.search.spectrum import LINE_HALF_WIDTH, JointWave, left_along
from ptt.effects.screw import OncePerRev
from ptt.fitting.linear import tried_sizes
from ptt.run.problem import Problem

MOST_HARMONIC = 50  # highest harmonic of a turn that is looked for: the 50 teeth of a stepping motor's rotor
# Of a turn that an arm's joint has to go through, and the highest harmonic that may lie beside its line on so little
LEAST_TURN, SHORT_TRAVEL_HARMONIC = 0.5, 4
# Share of its peak that a line may lose where the harmonic lies: other lines move it by a third of its half width
OFF_PEAK = 0.3
OFF_PEAK_MERGED = 0.01  # the same where lines run into each other: lost by one 0.06 of a wave over the range aside
# Turns over the range by which a line's peak may lie beside the harmonic
PEAK_OFFSETS = np.linspace(-LINE_HALF_WIDTH, LINE_HALF_WIDTH, 41)


def with_harmonics(
    scorer: Scorer, state: State, problem: Problem, offered: Sequence[OncePerRev] = ()
) -> tuple[Scorer, State, tuple[OncePerRev, ...]]:
    """Add harmonics of a turn to an explanation, beside all of it or in the place of its unknowns and curves.

    Args:
        scorer: of the system.
        state: the best set so far.
        problem: n rows.
        offered: harmonics that were among the candidates already.

    Returns:
        A scorer that keeps what was scored before, the explanation, and the harmonics added to it.
    """
    plain = without_curves(scorer, state)
    for start in (state, plain) if plain is not state else (state,):
        waves = find_harmonics(scorer, start, problem, offered)
        if not waves:
            continue
        wider = _with_waves(scorer, waves, problem)
        atoms = [atom for key, atom in wider.system.atoms.items() if key not in scorer.system.atoms]
        every = wider.score((*start.keys, *(atom.key for atom in atoms)), start.memory, start.variances)
        if (
            every.total + sum(atom.odds for atom in atoms) < state.total - HOPEFUL_NATS
        ):  # even if useless ones cost nothing
            continue
        other = climb(wider, start)
        if other.total > state.total - SLOW_BELOW:
            other = improve(wider, other)
        best = plainest(wider, max(state, other, key=lambda each: each.total))
        said = {wider.system.atoms[key].name for key in best.keys}
        waves = tuple(wave for wave in waves if wave.key in said)
        if waves:
            return wider, best, waves
    return scorer, state, ()


def _with_waves(scorer: Scorer, waves: Sequence[OncePerRev], problem: Problem) -> Scorer:
    """A scorer with atoms of further harmonics."""
    system = rows_of(scorer.system)
    names = {atom.effect.name for atom in system.atoms.values() if atom.effect is not None}
    atoms, columns, scale = dict[str, Atom](), list[np.ndarray](), list[np.ndarray]()
    for wave in waves:
        (shape,), sizes, key = wave.search(problem.view), tried_sizes(wave, problem), shape_key(wave.key, {})
        odds = odds_of_effect(wave, len(names), 1)
        atoms[key] = effect_atom(key, np.arange(len(sizes)), wave, problem, odds, shape)
        columns.append(system.at.columns(wave, shape)[system.rows])
        scale.append(sizes)
    return scorer.widened(system.widened(atoms, np.concatenate(columns, axis=2), np.concatenate(scale)))


def find_harmonics(
    scorer: Scorer, state: State, problem: Problem, offered: Sequence[OncePerRev] = ()
) -> tuple[OncePerRev, ...]:
    """Harmonics of a turn that are worth their prior odds in the residual's spectrum, for a search to judge.

    Args:
        scorer: of the system.
        state: the best set so far.
        problem: n rows.
        offered: those that were among the candidates already.

    Returns:
        New ones, the strongest first.
    """
    lead = problem.view.lead
    if lead is None or len(scorer.system.rows) < SPECTRUM_ROWS:
        return ()
    every = left_along(scorer, state, problem, detail=False)
    # On a shorter travel one line covers two harmonics, and any period is nearly one of them.
    joints = [each for each in every if each.span > 2.0 * LINE_HALF_WIDTH * lead]
    off = np.full(MOST_HARMONIC - 1, OFF_PEAK)
    if not joints and problem.file.machine.kind == "serial":  # whose joints err alike at every turn, or part of one
        joints = [each for each in every if each.span > LEAST_TURN * lead]
        off[SHORT_TRAVEL_HARMONIC - 1 :] = OFF_PEAK_MERGED
    if not joints:
        return ()
    explained = np.array([_explained(along, lead) for along in joints])
    effects = [OncePerRev(f"harmonic {m}") for m in range(2, MOST_HARMONIC + 1)]
    names = {atom.effect.name for atom in scorer.system.atoms.values() if atom.effect is not None}
    odds = [odds_of_effect(effect, len(names), 1) for effect in effects]
    nats = _nats(explained / state.posterior.phi) - odds
    there = {scorer.system.atoms[key].name for key in state.keys} | scorer.barred | {effect.key for effect in offered}
    strong = [index for index in np.argsort(-nats) if nats[index] > 0.0 and effects[index].key not in there]
    if not strong:
        return ()
    placed = _placed(joints, explained, lead, off, 2.0 * PLAIN_NATS * state.posterior.phi)
    apart = np.where(off == OFF_PEAK, 0.0, 2.0 * LINE_HALF_WIDTH * lead / max(along.span for along in joints))
    told = [index for index, effect in enumerate(effects) if effect.key in there]
    return tuple(
        effects[index]
        for place, index in enumerate(strong)
        # A line that is placed slightly off leaves two residual lines, one to either side.
        if placed[index] and (np.abs(np.array([*told, *strong[:place]]) - index) > apart[index]).all()
        and effects[index].needs(problem.view) is None
    )  # fmt: skip


def without_curves(scorer: Scorer, state: State) -> State:
    """The set without its unknowns and curves, which may have absorbed a few waves entirely.

    Args:
        scorer: of the system.
        state: the set.

    Returns:
        The rest under white noise; the set itself where it has neither.
    """
    bends = [key for key in droppable(scorer, state) if is_bent(scorer.system.atoms[key])]
    return scorer.score(without(state, *bends), WHITE, state.variances) if bends else state


def _placed(
    joints: Sequence[JointWave], explained: np.ndarray, lead: float, off: np.ndarray, least: float
) -> np.ndarray:
    """Whether each harmonic lies near enough to the peak of its line, (h,) bool.

    The line's frequency is judged at the joint that shows most of it; others see it with leakage.

    Args:
        joints: k residuals along joints.
        explained: sum of squares that each harmonic explains of each, (k, h).
        lead: mm or rad of a turn.
        off: share of its peak that a line may lose there, (h,).
        least: sum of squares that it may lose anyhow.
    """
    peak = np.max([[_explained(along, lead, turns) for along in joints] for turns in PEAK_OFFSETS], axis=0)
    shown = explained.argmax(axis=0), np.arange(explained.shape[1])
    return np.asarray(peak[shown] - explained[shown] <= np.maximum(off * peak[shown], least))


def _explained(along: JointWave, lead: float, off: float = 0.0) -> np.ndarray:
    """Sums of squares explained by harmonics 2 .. `MOST_HARMONIC`, or waves `off` turns over the range beside, (f,)."""
    turns = along.span / lead
    return along.over(2.0 * turns + off, turns, MOST_HARMONIC - 1)


def _nats(gain: np.ndarray) -> np.ndarray:
    """Log evidence of waves with one learned variance at the best number of joints, from squares (joints, f); (f,)."""
    some = np.arange(1, len(gain) + 1)[:, None]
    mean = np.maximum(np.sort(gain, axis=0)[::-1].cumsum(axis=0) / (2.0 * some), 1.0)
    return np.asarray((some * (mean - 1.0 - np.log(mean))).max(axis=0))
