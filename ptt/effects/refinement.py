"""Time and travel constants: what is tried between the trials of a search."""

from collections.abc import Mapping, Sequence

import numpy as np
from torch import Tensor

FINER = 8  # values that are tried between the neighbours of a trial


def finer(trials: Sequence[Mapping[str, Tensor]], shape: Mapping[str, Tensor], stem: str) -> list[Mapping[str, Tensor]]:
    """Values of a time or travel constant between the trials on either side of one, in proportion.

    Args:
        trials: what the search offers.
        shape: the trial, or a value between trials.
        stem: the constant; other values of the shape stay.

    Returns:
        The shape itself first, then `FINER` values up to its neighbours.
    """
    own = _mean(shape[stem])
    tried = sorted({_mean(trial[stem]) for trial in trials})
    low = max((value for value in tried if value < own), default=own)
    high = min((value for value in tried if value > own), default=own)
    inner = [*np.geomspace(low, own, FINER // 2 + 2)[1:-1], *np.geomspace(own, high, FINER // 2 + 2)[1:-1]]
    values = (value for value in inner if value != own)
    return [shape, *({**shape, stem: shape[stem] * (value / own)} for value in values)]


def _mean(constants: Tensor) -> float:
    """Of joints that have each their own, the geometric mean."""
    return float(constants.log().mean().exp()) if len(constants) > 1 else float(constants)
