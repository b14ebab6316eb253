"""Search on all rows of a long run, by sums, starting from what was found on a sample."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ptt.diagnosis.evidence.ansatz import Ansatz, LongRun, Trials
from ptt.diagnosis.evidence.atoms import Atom, atoms_of_blocks
from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.noise_level import starting_noise
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.summed import sum_up
from ptt.diagnosis.evidence.summed_system import SummedSystem
from ptt.diagnosis.search.found import Found, moved, settled
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.moments import find_moments, place_moments
from ptt.effects import Library
from ptt.effects.screw import OncePerRev
from ptt.fitting.chunks import numbers
from ptt.fitting.layout import lay_out
from ptt.fitting.linear import Shape
from ptt.fitting.moment import at_rows
from ptt.fitting.result import FitResult
from ptt.fitting.stated import with_fitted_terms
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem

WHOLE_TURNS = 3  # turns of fitting and searching on all rows
MANY_SHAPES = 4  # shapes from which only the sample's best one is tried on all rows
# Share of the noise's variance that an effect which the sample does not show has to explain: 10,000 rows show as much.
LEAST_VARIANCE_SHARE = 5e-4


@dataclass(frozen=True)
class WholeSearch:
    """What stays fixed while all rows are searched.

    Attributes:
        run: the long run.
        sample: stretches of it.
        model: as given.
        known: effects by name.
        steps: how many effects may be added.
        tell: callback for progress.
        seen: harmonics of a turn that the sample showed.
    """

    run: LongRun
    sample: Problem
    model: Model
    known: Library
    steps: int
    tell: Tell
    seen: tuple[OncePerRev, ...] = ()


def find_everywhere(told: Found, task: WholeSearch) -> Found:
    """Find the best explanation of all rows, from that of a sample.

    Each turn refits the model by one step on sums over all rows, then linearises there with candidates and searches.
    Effects that only all rows show are added with values from all rows.

    Args:
        told: what was found on the sample.
        task: the run.

    Returns:
        The explanation; its system keeps only sums.
    """
    known_to_sample = {told.system.atoms[key].name for key in told.state.keys}
    shapes, task = _best_shapes(told), replace(task, seen=told.seen)
    freedom = starting_noise(task.run.problem)[1]
    found, gross = told, np.zeros(task.run.problem.table.rows, dtype=bool)
    for turn in range(WHOLE_TURNS):
        fitted = found.fitted if settled(found.state, found.system) else _opened(found, task)
        at = place_moments(task.run, _ansatz(fitted, told, freedom), _carried(found))
        task.tell(f"fit all rows {turn + 1}")
        at, gross, carried = _settle(at, task, gross, shapes, sift=turn == 0)
        candidates, _ = present_candidates(at.fitted, task.sample, task.known, task.seen)
        trials = _trials(at.fitted, task, shapes | find_moments(task.run, at, candidates, carried))
        task.tell(f"search all rows {turn + 1}")
        system, _ = sum_up(task.run, at, trials, task.sample, task.run.problem.used & ~gross)
        start = _start(found, at, system)
        scorer = Scorer(system, task.model.keys, task.steps)
        state = scorer.score(start, at.memory)
        if turn < WHOLE_TURNS - 1:
            scorer, state = _search(scorer, state, known_to_sample)
        found = replace(told, fitted=at.fitted, scorer=scorer, state=state, gross=gross)
        if settled(state, system):
            break
    sample = task.sample.masked(gross[numbers(task.sample)])
    return replace(found, fitted=at_rows(found.fitted, sample), sample=sample)


def _ansatz(fitted: FitResult, told: Found, freedom: float) -> Ansatz:
    """The point at which all chunks are linearised, with all blocks that the sample found."""
    blocks = dict[str, Atom]()
    for atom in told.system.atoms.values():
        if atom.block is not None and atom.key in told.state.keys:
            blocks |= atoms_of_blocks([atom.block], 0, atom.odds)  # in all of its columns
    return Ansatz(fitted, tuple(blocks.values()), told.periods, told.noise, freedom, told.state.memory)


def _settle(
    at: Ansatz, task: WholeSearch, gross: np.ndarray, shapes: dict[str, Shape], *, sift: bool
) -> tuple[Ansatz, np.ndarray, dict[str, np.ndarray]]:
    """One step of the fit on all rows, without candidates, and the values of blocks; with `sift` gross errors too."""
    trials = _trials(at.fitted, task, shapes) if sift else {}
    system, far = sum_up(task.run, at, trials, task.sample, task.run.problem.used & ~gross, sift=sift)
    state = Scorer(system, task.model.keys).score(tuple(system.atoms), at.memory)
    blocks = {atom.key: state.posterior.values[state.of(atom.key)] for atom in at.blocks}
    return replace(at, fitted=_refit(at.fitted, system, state)), gross | far, blocks


def _carried(found: Found) -> dict[str, np.ndarray]:
    """Values of the blocks of an explanation."""
    state, atoms, scale = found.state, found.system.atoms, found.system.scale
    blocks = [key for key in state.keys if atoms[key].block is not None]
    return {key: atoms[key].amplitudes(state.posterior.values[state.of(key)], scale) for key in blocks}


def _refit(fitted: FitResult, system: SummedSystem, state: State) -> FitResult:
    """The model at a set's values: those of effects are absolute, those of mounts and frames are increments.

    The system counts some values in units of its own (`straight_sizes`), the fit's unknowns in usual sizes.
    """
    layout, unknowns = fitted.layout, fitted.unknowns.copy()
    frame = state.owner < 0
    unknowns[state.columns[frame]] += state.posterior.values[frame]
    own = ~frame & (state.columns < len(unknowns))
    columns = state.columns[own]
    unknowns[columns] = state.posterior.values[own] * system.scale[columns] / layout.scale[columns]
    unknowns = np.clip(unknowns, layout.lower, layout.upper)
    return with_fitted_terms(replace(fitted, unknowns=unknowns, noise=system.noise))


def _opened(found: Found, task: WholeSearch) -> FitResult:
    """The fit moved to the effects and values that were found, frames unchanged; without covariance."""
    model = moved(found, task.model, task.sample, refine=False)
    layout = lay_out(model, task.sample, model.terms)
    unknowns, frames = layout.start(), len(found.system.frame)
    if frames:
        unknowns[-frames:] = found.fitted.unknowns[-frames:]
    covariance = np.zeros((len(unknowns), len(unknowns)))
    return replace(
        found.fitted, model=model, layout=layout, unknowns=unknowns, covariance=covariance, information=covariance,
        unseen=np.zeros((len(unknowns), 0)),
    )  # fmt: skip


def _best_shapes(told: Found) -> dict[str, Shape]:
    """Name of each candidate -> its best shape beside the sample's explanation."""
    gains = told.scorer.screen(told.state, lambda atom: atom.shape is not None)
    atoms = [told.system.atoms[gain.key] for gain in gains]
    return {atom.name: atom.shape for atom in atoms if atom.shape is not None}


def _trials(fitted: FitResult, task: WholeSearch, best: dict[str, Shape]) -> Trials:
    """Candidates beside a model: all shapes where they are few, else the sample's best."""
    trials = {}
    for effect in present_candidates(fitted, task.sample, task.known, task.seen)[0]:
        shapes = tuple(effect.search(task.sample.view))
        if len(shapes) >= MANY_SHAPES:
            shapes = (best[effect.key],) if effect.key in best else ()
        if shapes:
            trials[effect.key] = (effect, shapes)
    return trials


def _start(found: Found, at: Ansatz, system: SummedSystem) -> tuple[str, ...]:
    """The model's effects and the blocks that were found."""
    blocks = [key for key in found.state.keys if found.system.atoms[key].block is not None]
    return tuple(key for key in (*at.fitted.model.keys, *blocks) if key in system.atoms)


def _search(scorer: Scorer, state: State, known: set[str]) -> tuple[Scorer, State]:
    """Improve the set, repeatedly leaving out new effects that explain too little.

    So many rows show every small error of the equations as if it were an effect.
    """
    small: set[str] = set()
    while True:
        found = improve(scorer, state, partial(_is_other, frozenset(small)))
        atoms = scorer.system.atoms
        new = [key for key in found.keys if atoms[key].name not in known and key not in scorer.given]
        less = {key: scorer.less(found, key).total for key in new}
        little = {
            atoms[key].name for key in new if found.total - less[key] < 0.5 * LEAST_VARIANCE_SHARE * scorer.system.count
        }
        if little <= small:  # none is left to leave out
            return scorer, found
        small |= little
        scorer = Scorer(scorer.system, scorer.given, scorer.steps)


def _is_other(names: frozenset[str], atom: Atom) -> bool:
    return atom.name not in names
