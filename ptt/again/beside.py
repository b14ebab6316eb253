"""Changes beside something new, looked at again: a strong new effect is only known once it stands in the model."""

from dataclasses import replace

import numpy as np

from ptt.again.before import ANYTHING, Before
from ptt.again.weigh import Weighed, weigh
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import Library
from ptt.fitting.layout import lay_out
from ptt.progress import Tell
from ptt.run.problem import Problem


def sure_beside(found: Weighed, new: Diagnosis, problem: Problem, known: Library, tell: Tell) -> Weighed:
    """An explanation without the changes that nothing asks for once what is new stands in the model.

    Beside what has changed a new effect is linearised where it is zero, and what that leaves of a large one can look
    like a change. In the model it is linearised at its size.

    Args:
        found: the explanation, with changes.
        new: what is new, as diagnosed.
        problem: the run.
        known: effects by name.
        tell: told what is being done.

    Returns:
        The explanation, with those changes only whose effects are asked for again.
    """
    wider = _with_new(found.before, new, problem)
    if wider.width == found.before.width:
        return found
    again = weigh(wider, problem, known, tell)
    asked = {change.effect.key for change in again.changed}
    gone = {change.key for change in found.changed if change.effect.key not in asked}
    if not gone:
        return found
    state = found.state
    return replace(found, state=found.scorer.score([key for key in state.keys if key not in gone], state.memory))


def _with_new(before: Before, new: Diagnosis, problem: Problem) -> Before:
    """The solved model with what is new in it, at the values that the run gives it and free to be anything else."""
    own = {term.effect.key for term in before.layout.terms}
    more = tuple(t for t in new.model.terms if t.effect.key not in own and not t.effect.of_run and len(t.theta))
    terms = (*before.layout.terms, *(replace(term, fixed=frozenset()) for term in more))
    model = replace(before.model, terms=terms)
    layout = lay_out(model, problem, terms)
    width = int((layout.owner >= 0).sum())
    root = np.zeros((width, before.root.shape[1] + width - before.width))
    root[: before.width, : before.root.shape[1]] = before.root
    root[before.width :, before.root.shape[1] :] = ANYTHING * np.eye(width - before.width)
    values = np.concatenate([before.values, layout.start()[before.width : width]])
    wide = [replace(r, absorbed=np.pad(r.absorbed, [(0, width - before.width), (0, 0)])) for r in before.rooms.each]
    rooms = replace(before.rooms, each=tuple(room for room in wide if room.effect.key not in model.keys))
    blind = before.blind | {term.effect.key for term in more}
    unnamed = before.unnamed
    if unnamed is not None:
        blank = [before.width] * (width - before.width)
        unnamed = replace(unnamed, root=np.insert(unnamed.root, blank, 0.0, axis=0))
    return replace(
        before, model=model, layout=layout, values=values, root=root, blind=blind, rooms=rooms, unnamed=unnamed
    )
