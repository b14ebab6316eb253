"""Hypotheses of a recheck as atoms of the evidence: equally likely, their columns concatenated."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.effect_atoms import MOST_EFFECT_VARIANCE
from ptt.effects import Effect


def side_by_side(effects: Sequence[tuple[str, Effect, int]], odds: float, among: int, first: int) -> dict[str, Atom]:
    """Atoms of equally likely hypotheses.

    Args:
        effects: key, effect and number of columns of each hypothesis.
        odds: prior log odds against any of them, nats.
        among: number of hypotheses that share these odds, those that are not listed included.
        first: index of the first column in the linear problem.

    Returns:
        The atoms by key.
    """
    against, atoms = odds + float(np.log(max(among, 1))), dict[str, Atom]()
    for key, effect, width in effects:
        atoms[key] = Atom(
            key, key, np.arange(first, first + width), np.zeros(width, dtype=int),
            np.array([MOST_EFFECT_VARIANCE]), against, np.zeros(width, dtype=bool), effect=effect,
        )  # fmt: skip
        first += width
    return atoms
