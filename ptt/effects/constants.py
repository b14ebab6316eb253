"""Time and travel constants: what is tried between the trials of a search."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
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
    own = float(shape[stem])
    tried = sorted({float(trial[stem]) for trial in trials})
    low = max((value for value in tried if value < own), default=own)
    high = min((value for value in tried if value > own), default=own)
    inner = [*np.geomspace(low, own, FINER // 2 + 2)[1:-1], *np.geomspace(own, high, FINER // 2 + 2)[1:-1]]
    values = (value for value in inner if value != own)
    return [shape, *({**shape, stem: torch.tensor([value], dtype=torch.float64)} for value in values)]
