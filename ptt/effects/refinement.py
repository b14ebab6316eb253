"""Refinement of a searched time or travel constant between the trials of a search."""

from collections.abc import Mapping, Sequence

import numpy as np
from torch import Tensor

BETWEEN = 8  # values from the lower neighbour of a trial to the upper one, evenly in their logarithms


def between_trials(
    trials: Sequence[Mapping[str, Tensor]], shape: Mapping[str, Tensor], stem: str
) -> list[Mapping[str, Tensor]]:
    """Values of a time or travel constant between the trials on either side of one, geometrically spaced.

    Args:
        trials: what the search offers.
        shape: the trial, or a value between trials.
        stem: of the constant; joints with constants of their own keep their ratios, other parameters their values.

    Returns:
        The shape itself first, then those with `BETWEEN` values up to its neighbours.
    """
    own = _mean(shape[stem])
    tried = sorted({_mean(trial[stem]) for trial in trials})
    low = max((value for value in tried if value < own), default=own)
    high = min((value for value in tried if value > own), default=own)
    inner = [*np.geomspace(low, own, BETWEEN // 2 + 2)[1:-1], *np.geomspace(own, high, BETWEEN // 2 + 2)[1:-1]]
    values = (value for value in inner if value != own)
    return [shape, *({**shape, stem: shape[stem] * (value / own)} for value in values)]


def _mean(constants: Tensor) -> float:
    """Geometric mean over the joints."""
    return float(constants.log().mean().exp()) if len(constants) > 1 else float(constants)
