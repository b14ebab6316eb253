"""Usual sizes of an effect's values on a machine."""

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.layout import family
from ptt.run.view import View


def usual_values(effect: Effect, view: View) -> Tensor:
    """Usual size of each value of an effect on a machine.

    Args:
        effect: the effect.
        view: n rows of the machine.

    Returns:
        (P,) of all parameters in declared order, in their units.
    """
    kind, joints = family(view), view.joints
    parts = [torch.full((p.size(joints),), p.on(kind).usual, dtype=torch.float64) for p in effect.parameters]
    usual = torch.cat(parts) if parts else torch.zeros(0, dtype=torch.float64)
    shares = effect.proportions(view.mechanism)
    return usual if shares is None else usual * shares
