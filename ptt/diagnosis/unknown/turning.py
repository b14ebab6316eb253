"""What remembers its travel: how far friction, seals and cables have turned over since the last reversals."""

import numpy as np

from ptt.effects.memory import gradual_reversal, play
from ptt.run.view import View

LENGTHS = (0.02, 0.06, 0.2, 0.6)  # of a joint's travel, over which it turns over by and by
GAPS = (0.05, 0.15, 0.4, 1.0)  # of a joint's travel, over which it turns over evenly, and then slips
STILL = 1e-6  # mm or rad


def turning(view: View, travel: np.ndarray) -> np.ndarray:
    """Dahl's friction and elements that slip, of several lengths beside each other, and what a run began with.

    Sums of either make up what depends on the way back to former reversals, at any speed (Prandtl and Ishlinskii;
    Visintin, Differential Models of Hysteresis, 1994). How a run's first row was reached nobody knows: that is
    forgotten over the same lengths.

    Args:
        view: n rows, entered as their run enters them.
        travel: of each joint, (k,) mm or rad.

    Returns:
        (n, k, 12), of about unit size.
    """
    spread = view.q.new_tensor(np.maximum(travel, STILL))
    gradual = [gradual_reversal(view, share * spread).numpy() for share in LENGTHS]
    even = [(2.0 * play(view, share * spread) / (share * spread)).numpy() for share in GAPS]
    way = _way(view)
    begun = [np.exp(-way / (share * spread.numpy())) for share in LENGTHS]
    return np.stack([*gradual, *even, *begun], axis=2)


def _way(view: View) -> np.ndarray:
    """How far each joint has moved since its run began, (n, k); infinite where that lies before the first row."""
    starts = view.starts.numpy()
    moved = view.q.diff(dim=0, prepend=view.q[:1]).abs().numpy()
    moved[starts] = 0.0
    way, run = np.cumsum(moved, axis=0), np.cumsum(starts)
    begun = np.concatenate([np.full((1, way.shape[1]), -np.inf), way[starts]])
    return way - begun[run]
