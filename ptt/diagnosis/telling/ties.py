"""Ties: effects that do as well in another's place."""

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.search.moves import added

TIE_NATS = 7.0  # nats within which an effect does as well in another's place: a thousand to one, were the forms exact
SCREEN_SLACK = 4.0  # nats by which the screen may misjudge the exact score of a tie
MOST_TIES, MOST_LOOKED_AT = 4, 6  # ties that are named, and candidates that are scored for them


def ties(scorer: Scorer, state: State, key: str) -> tuple[str, ...]:
    """Other effects that would do as well in the place of one.

    Args:
        scorer: of the system.
        state: the best set.
        key: of an effect in it.

    Returns:
        Their names, best first.
    """
    atoms, less = scorer.system.atoms, scorer.less(state, key)
    own = atoms[key].name

    def other(atom: Atom) -> bool:
        return atom.effect is not None and atom.effect.name != own.partition("[")[0]

    # The screen holds the others' variances, so gains are compared with the effect's own screened gain. Prior odds are
    # left aside, since a tie is what the data cannot tell apart.
    mine = scorer.screen(less, lambda atom: atom.name == own)
    usual = max((gain.nats + atoms[gain.key].odds for gain in mine), default=-np.inf)
    here = state.total + atoms[key].odds
    found: dict[str, float] = {}
    for gain in sorted(scorer.screen(less, other), key=lambda gain: -gain.nats - atoms[gain.key].odds)[:MOST_LOOKED_AT]:
        odds = atoms[gain.key].odds
        if gain.nats + odds < usual - TIE_NATS - SCREEN_SLACK:
            break
        total = added(scorer, less, gain).total
        if total + odds > here - TIE_NATS:
            found[atoms[gain.key].name] = total
    return tuple(sorted(found, key=lambda name: -found[name])[:MOST_TIES])
