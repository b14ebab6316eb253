"""Whether joints reverse where a smooth path through the rows does, as on a circle, rather than at rows."""

from dataclasses import replace

from ptt.diagnosis.evidence.system import holds_unknown
from ptt.diagnosis.search.bursts import lost_rows
from ptt.diagnosis.search.find import find, named_effects_suffice
from ptt.diagnosis.search.fits import fit_less
from ptt.diagnosis.search.found import Found, is_denser
from ptt.effects import Library
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem
from ptt.run.smooth import LIKELIER, smoothly


def on_smooth_way(
    found: Found, model: Model, problem: Problem, known: Library, tell: Tell, steps: int
) -> tuple[Found, Model, Problem]:
    """Search again with the reversals of a smooth path, where that may explain more.

    Args:
        found: the best explanation.
        model: the model as given.
        problem: the readings.
        known: effects by name.
        tell: callback for progress.
        steps: how many effects may be added.

    Returns:
        The likelier explanation, with the model and the readings under its kind of path.
    """
    other = smoothly(problem) if found.sample is None else None
    if other is None:
        return found, model, problem
    smooth = replace(model, file=other.file)
    unknown = holds_unknown(found.system, found.state.keys, found.state.memory)
    tell("smooth way")
    likely = _gross_elsewhere(found, problem, other) or _turns_say_more(found, problem, other)
    if not likely and not (unknown and named_effects_suffice(smooth, other, known, tell, steps)):
        return found, model, problem
    again = find(smooth, other, known, tell, steps)
    return (again, smooth, other) if is_denser(again, found, LIKELIER) else (found, model, problem)


def _gross_elsewhere(found: Found, problem: Problem, other: Problem) -> bool:
    """Whether the direction of arrival at a gross error differs on the smooth path, which may be why it is one."""
    here, there = problem.view, other.view
    differ = (here.direction != there.direction) | (here.turning_point != there.turning_point)  # shape: (n, k)
    return bool((found.gross & ~lost_rows(problem))[differ.any(dim=1).numpy()].any())


def _turns_say_more(found: Found, problem: Problem, other: Problem) -> bool:
    """Whether reversing effects fit better with the smooth path's reversals, beside the present unknowns."""
    effects = [found.system.atoms[key].effect for key in found.state.keys]
    if not any(effect is not None and effect.reverses for effect in effects):
        return False
    aside = found.gross if found.opening is None else found.gross | found.opening
    here, there = (
        fit_less(replace(found.fitted.model, file=one.file), one, found.carried, aside, found.noise)
        for one in (problem, other)
    )
    return here.chi2 - there.chi2 > 2.0 * found.state.posterior.phi * LIKELIER
