"""Changes that are artefacts of linearising a strong new effect at zero: tested again with it in the model."""

from dataclasses import replace

import numpy as np

from ptt.again.explanation import Explanation, find_explanation
from ptt.again.prior import ANYTHING, Prior
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import Library
from ptt.fitting.layout import lay_out
from ptt.progress import Tell
from ptt.run.problem import Problem


def drop_artefacts(found: Explanation, new: Diagnosis, problem: Problem, known: Library, tell: Tell) -> Explanation:
    """Drop changes that the evidence no longer supports once the new effects are part of the model.

    Beside the changes a new effect is linearised at zero, and the second-order remainder of a large one can look like a
    change. As part of the model it is linearised at its fitted size.

    Args:
        found: the explanation, with changes.
        new: diagnosis of the new effects.
        problem: the run.
        known: effects by name.
        tell: told what is being done.

    Returns:
        The explanation, with only those changes whose effects change in the repeated search too.
    """
    wider = _with_new(found.prior, new, problem)
    if wider.width == found.prior.width:
        return found
    again = find_explanation(wider, problem, known, tell)
    asked = {change.effect.key for change in again.changed}
    gone = {change.key for change in found.changed if change.effect.key not in asked}
    if not gone:
        return found
    state = found.state
    return replace(found, state=found.scorer.score([key for key in state.keys if key not in gone], state.memory))


def _with_new(prior: Prior, new: Diagnosis, problem: Problem) -> Prior:
    """The prior with the new effects of the machine added to its model, at their diagnosed values with a flat prior."""
    own = {term.effect.key for term in prior.layout.terms}
    more = tuple(t for t in new.model.terms if t.effect.key not in own and not t.effect.of_run and len(t.theta))
    terms = (*prior.layout.terms, *(replace(term, fixed=frozenset()) for term in more))
    model = replace(prior.model, terms=terms)
    layout = lay_out(model, problem, terms)
    width = int((layout.owner >= 0).sum())
    root = np.zeros((width, prior.root.shape[1] + width - prior.width))
    root[: prior.width, : prior.root.shape[1]] = prior.root
    root[prior.width :, prior.root.shape[1] :] = ANYTHING * np.eye(width - prior.width)
    values = np.concatenate([prior.values, layout.start()[prior.width : width]])
    wide = [
        replace(r, absorbed=np.pad(r.absorbed, [(0, width - prior.width), (0, 0)])) for r in prior.masked_effects.each
    ]
    masked_effects = replace(
        prior.masked_effects, each=tuple(masked for masked in wide if masked.effect.key not in model.keys)
    )
    blind = prior.blind | {term.effect.key for term in more}
    unnamed = prior.unnamed
    if unnamed is not None:
        blank = [prior.width] * (width - prior.width)
        unnamed = replace(unnamed, root=np.insert(unnamed.root, blank, 0.0, axis=0))
    return replace(
        prior,
        model=model,
        layout=layout,
        values=values,
        root=root,
        blind=blind,
        masked_effects=masked_effects,
        unnamed=unnamed,
    )
