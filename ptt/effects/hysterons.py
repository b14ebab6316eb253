"""Hysteresis elements (hysterons) of a joint's travel: Dahl friction and stops, each over several travel lengths.

Friction, seals and cables of unknown law are sums of such elements.
"""

import torch
from torch import Tensor

from ptt.effects.memory import gradual_reversal, play
from ptt.run.view import View

DAHL_LENGTHS = (0.02, 0.05, 0.12, 0.3, 0.7)  # travel constants l of 1 - 2 exp(-x/l), as shares of a joint's travel
STOP_WIDTHS = (0.03, 0.07, 0.15, 0.3, 0.6, 1.2)  # travel from one end of a stop to the other, as shares of the same
HYSTERONS = len(DAHL_LENGTHS) + len(STOP_WIDTHS)
LEAST_TRAVEL = 1e-6  # mm or rad: a joint that stands still has no travel to divide by


def hysterons(view: View, travel: Tensor) -> Tensor:
    """Dahl friction elements and stop operators of several lengths, side by side.

    Weighted sums of them make up any rate-independent dependence on the travel back to former reversals
    (Prandtl-Ishlinskii model; Visintin, Differential Models of Hysteresis, 1994).

    Args:
        view: n rows, with `entries` where rows of their run are left out.
        travel: range of each joint over the run, (k,) mm or rad.

    Returns:
        (n, k, 11), between -1 and 1: after a reversal each goes to the other side, the first five exponentially, the
        others linearly until they slip.
    """
    span = travel.clamp(min=LEAST_TRAVEL)
    dahl = [gradual_reversal(view, share * span) for share in DAHL_LENGTHS]
    stops = [2.0 * play(view, share * span) / (share * span) for share in STOP_WIDTHS]
    return torch.stack([*dahl, *stops], dim=2)


def initial_memory(view: View, travel: Tensor) -> Tensor:
    """How much of the state in which a run begins is left at each row: exp(-x/l), x the travel since its first row.

    How the first row was reached is not in the data, so that state is an unknown of its own.

    Args:
        view: n rows.
        travel: range of each joint over the run, (k,) mm or rad.

    Returns:
        (n, k, 5), one for each Dahl element: 1 at the first row of a run, 0 in rows before any.
    """
    moved = view.q.diff(dim=0, prepend=view.q[:1]).abs()
    path = torch.where(view.starts[:, None], 0.0, moved).cumsum(dim=0)
    first = torch.cat([path.new_full((1, path.shape[1]), -torch.inf), path[view.starts]])
    since = path - first[view.starts.long().cumsum(dim=0)]
    return torch.stack([torch.exp(-since / (share * travel.clamp(min=LEAST_TRAVEL))) for share in DAHL_LENGTHS], dim=2)
