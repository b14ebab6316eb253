"""Effects that stand beside the others of a run measured later, as hypotheses: their columns one behind the other."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.effect_atoms import MOST_EFFECT_VARIANCE
from ptt.effects import Effect


def side_by_side(effects: Sequence[tuple[str, Effect, int]], odds: float, among: int, first: int) -> dict[str, Atom]:
    """Hypotheses that are equally likely.

    Args:
        effects: key, effect and number of columns of each.
        odds: nats of prior odds against that any of them is needed.
        among: how many might have been.
        first: place of the first column.

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
