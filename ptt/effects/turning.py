"""What remembers its travel: how far friction, seals and cables have turned over since the last reversals."""

import torch
from torch import Tensor

from ptt.effects.memory import gradual_reversal, play
from ptt.run.view import View

LENGTHS = (0.02, 0.05, 0.12, 0.3, 0.7)  # of a joint's travel, over which it turns over by and by
GAPS = (0.03, 0.07, 0.15, 0.3, 0.6, 1.2)  # of a joint's travel, over which it turns over evenly, and then slips
TURNS = len(LENGTHS) + len(GAPS)
STILL = 1e-6  # mm or rad


def turning(view: View, travel: Tensor) -> Tensor:
    """Dahl's friction and elements that slip, of several lengths beside each other.

    Sums of such elements make up what depends on the way back to former reversals, at any speed (Prandtl and
    Ishlinskii; Visintin, Differential Models of Hysteresis, 1994).

    Args:
        view: n rows, entered as their run enters them.
        travel: of each joint, (k,) mm or rad.

    Returns:
        (n, k, 11), between -1 and 1.
    """
    spread = travel.clamp(min=STILL)
    gradual = [gradual_reversal(view, share * spread) for share in LENGTHS]
    even = [2.0 * play(view, share * spread) / (share * spread) for share in GAPS]
    return torch.stack([*gradual, *even], dim=2)


def begun(view: View, travel: Tensor) -> Tensor:
    """What is left of the way in which a run's first row was reached, which nobody knows.

    Args:
        view: n rows.
        travel: of each joint, (k,) mm or rad.

    Returns:
        (n, k, 5), from 1 as a run begins; 0 where that lies before the first row.
    """
    moved = view.q.diff(dim=0, prepend=view.q[:1]).abs()
    way = torch.where(view.starts[:, None], 0.0, moved).cumsum(dim=0)
    first = torch.cat([way.new_full((1, way.shape[1]), -torch.inf), way[view.starts]])
    since = way - first[view.starts.long().cumsum(dim=0)]
    return torch.stack([torch.exp(-since / (share * travel.clamp(min=STILL))) for share in LENGTHS], dim=2)
