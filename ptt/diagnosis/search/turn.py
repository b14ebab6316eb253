"""State that one turn of linearising and searching passes to the next, with gross errors and moments of events."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.atoms import is_sudden, is_timely
from ptt.diagnosis.evidence.row_system import RowSystem, rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.gross import alone, are_exceptions, places_of, stand_out
from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.unknown.block import Period
from ptt.diagnosis.unknown.moment import best_moment
from ptt.effects import Effect
from ptt.effects.screw import OncePerRev
from ptt.effects.sudden import Sudden
from ptt.fitting.linear import Shape
from ptt.fitting.opening import untold_rows
from ptt.fitting.outliers import LOST_CHANCE, linear_residual
from ptt.fitting.result import FitResult
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem
from ptt.run.tails import chi2_isf
from ptt.run.view import View


@dataclass(frozen=True)
class Turn:
    """Where a turn of linearising and searching begins.

    Attributes:
        number: from 0.
        model: the model with all effects found so far.
        noise: the noise floor.
        gross: rows left out as gross errors, (n,) bool.
        carried: contribution of blocks to the readings, which the fit takes off, (n, 3) mm.
        opening: rows left out because they depend on how the run was entered, (n,) bool.
        kept: keys of atoms that the search starts from; None for a search from nothing.
        memory: of the noise.
        held: keys of the blocks of `carried`.
        periods: joint (None: time) and length of waves that residual spectra showed.
        barred: names that may not be added: an exact fit does without them, or no machine has their values.
        moments: shapes with moments at which something may have happened, whatever it was.
        seen: harmonics of a turn that residual spectra showed.
        before: the explanation before effects were dropped as needless; None where none were.
    """

    number: int
    model: Model
    noise: Noise
    gross: np.ndarray
    carried: np.ndarray
    opening: np.ndarray
    kept: tuple[str, ...] | None = None
    memory: Memory = WHITE
    held: tuple[str, ...] = ()
    periods: tuple[Period, ...] = ()
    barred: frozenset[str] = frozenset()
    moments: tuple[Shape, ...] = ()
    seen: tuple[OncePerRev, ...] = ()
    before: Found | None = None


def first_turn(model: Model, problem: Problem, noise: Noise) -> Turn:
    """The first turn, in which only rows that open the run are left out.

    Args:
        model: the model as given.
        problem: n rows.
        noise: the noise floor.
    """
    opening = untold_rows(model.terms, problem, noise)
    return Turn(0, model, noise, np.zeros(problem.table.rows, dtype=bool), np.zeros((problem.table.rows, 3)), opening)


def gross_beside(system: RowSystem, state: State, gross: np.ndarray, *, robust: bool = False) -> np.ndarray:
    """Isolated rows that a set does not explain, and the rows that were left out before.

    Args:
        system: linearised.
        state: the set.
        gross: rows left out so far, (n,) bool.
        robust: refit the set robustly; else a row that is far off may attract the fit, and its neighbours then look
            far off.

    Returns:
        (n,) bool; as given where so many rows are far that the set is to blame.
    """
    # The bulk of the rows gives the scale, since gross errors inflate the learned variance; and residuals are tested
    # beside innovations, since a wander follows gross errors.
    columns, values = state.columns, state.posterior.values
    left = [robustly_left(system, state) if robust else system.innovation(columns, values, state.memory)]
    if state.memory.wander is not None and not robust:
        left.append(system.residual(columns, values))
    here, problem = np.ones(len(left[0]), dtype=bool), system.at.problem
    places, found = places_of(problem)[system.rows], gross.copy()
    for white in left:
        white = white * np.sqrt(system.count / max(system.count - state.effective_parameters, 1.0))
        far = stand_out(white, here, least=0.0)
        found[system.rows[alone(far, white, here, places, int(gross.sum()))]] = True
    return found if are_exceptions(found, problem.used) else gross


def robustly_left(system: RowSystem, state: State) -> np.ndarray:
    """Residual of a robust fit of a set with its learned prior variances, (m, 3) whitened.

    Args:
        system: linearised.
        state: the set.
    """
    chosen, known = state.columns, np.append(system.base_values.ravel(), np.zeros(len(state.columns)))
    fixed = system.base_columns[..., chosen].reshape(system.base_values.size, len(chosen))
    base = np.concatenate([fixed, np.diag(state.posterior.prior_variance**-0.5)])
    return linear_residual(system.values, system.columns[..., chosen], known, base)[0]


def in_company(system: RowSystem, state: State) -> np.ndarray:
    """Rows far from a set that are not isolated but share a place, a stretch or a load, (n,) bool."""
    left = system.residual(state.columns, state.posterior.values)
    here, problem = np.ones(len(left), dtype=bool), system.at.problem
    far, found = stand_out(left, here, least=0.0), np.zeros(problem.table.rows, dtype=bool)
    found[system.rows] = far & ~alone(far, left, here, places_of(problem)[system.rows])
    return found


def still_missed(fitted: FitResult, problem: Problem, noise: Noise, gross: np.ndarray) -> np.ndarray:
    """Rows left out that a fit to the others still does not predict within their noise.

    A nonlinear effect may predict rows that its linearisations did not: those at which play is not taken up yet.

    Args:
        fitted: to the rows that were not left out.
        problem: the readings.
        noise: the noise floor.
        gross: rows that were left out, (n,) bool.

    Returns:
        (n,) bool.
    """
    left = fitted.residual @ noise.whitener.T
    read = problem.used & np.isfinite(left).all(axis=1)
    return gross & ~(read & (np.square(left).sum(axis=1) < chi2_isf(LOST_CHANCE, 3)))


def best_moments(
    scorer: Scorer, state: State, may_go: Sequence[str], candidates: Sequence[Effect]
) -> tuple[Shape, ...]:
    """Moments to the row at which sudden effects explain most beside parts of a set.

    Moments of a coarse search are so far apart that a slow curve may look better than a jump at the wrong one; and a
    block that took a jump's place along the travel or with temperature leaves nothing of it to date. So atoms that
    change with time, and unknowns, are taken out in several combinations. Each of several events is also dated beside
    the others, since with all taken out the largest one determines every moment.

    Args:
        scorer: of a linearised problem.
        state: the set.
        may_go: keys of its atoms that may be taken out.
        candidates: effects that may be missing.

    Returns:
        The moments, each to be tried for every sudden effect: when is known sooner than what.
    """
    atoms = scorer.system.atoms
    timely = [key for key in may_go if is_timely(atoms[key])]
    happened = [key for key in timely if is_sudden(atoms[key])]
    unknown = [key for key in may_go if atoms[key].block is not None]
    changed = [key for key in timely if key not in happened]
    gone = {
        frozenset(keys) for keys in ([], timely, unknown, changed, [*unknown, *timely], *([key] for key in happened))
    }
    sudden = [effect for effect in candidates if isinstance(effect, Sudden)]
    found = [moment_beside(scorer, state, sorted(keys), effect) for keys in gone for effect in sudden]
    return unlike([*found, *(shape for key in happened if (shape := atoms[key].shape) is not None)])


def hidden_moments(scorer: Scorer, state: State, candidates: Sequence[Effect]) -> tuple[Shape, ...]:
    """Moments that what changes slowly in a set may stand for, as `best_moments` dates them; none where nothing does.

    A drift or a wander follows a jump but for the rows about it, and so well that a search by single steps stays there.

    Args:
        scorer: of a linearised problem.
        state: the set.
        candidates: effects that may be missing.

    Returns:
        The moments, each to be tried for every sudden effect.
    """
    atoms, memory = scorer.system.atoms, state.memory.wander
    slow = [key for key in state.keys if is_timely(atoms[key]) and not is_sudden(atoms[key])]
    if not slow and (memory is None or not scorer.system.clock.is_slow(memory)):
        return ()
    return best_moments(scorer, state, slow, candidates)


def shapes_of(effect: Effect, view: View, moments: Sequence[Shape]) -> Sequence[Shape]:
    """The shapes that an effect searches, for sudden effects with further moments."""
    return unlike([*effect.search(view), *moments]) if isinstance(effect, Sudden) else effect.search(view)


def moments_of(model: Model) -> list[Shape]:
    """The moments of a model's own sudden effects."""
    return [{"after": term.theta[-1:]} for term in model.terms if isinstance(term.effect, Sudden) and len(term.theta)]


def unlike(moments: Sequence[Shape]) -> tuple[Shape, ...]:
    """Each moment once, ascending."""
    found = {float(shape["after"]): shape for shape in moments}
    return tuple(found[moment] for moment in sorted(found))


def moment_beside(scorer: Scorer, state: State, gone: Sequence[str], effect: Sudden) -> Shape:
    """The best moment of a sudden effect beside a set without some of its atoms."""
    system = rows_of(scorer.system)
    still = scorer.score(without(state, *gone), WHITE, state.variances)
    left = np.zeros((system.at.problem.table.rows, 3))
    left[system.rows] = system.residual(still.columns, still.posterior.values)
    frame = np.zeros((*left.shape, len(system.frame)))
    frame[system.rows] = system.columns[:, :, system.frame]
    return best_moment(system.at, frame, left, np.isin(np.arange(len(left)), system.rows), effect)
