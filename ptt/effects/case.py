"""An effect at its usual size on the sample run: test case of the contract and source of the pictures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.bench import sample_view
from ptt.effects.layout import flatten, sizes
from ptt.run.view import View

Differentiate = Callable[[Effect, Tensor, View], tuple[Tensor, Tensor]]


@dataclass(frozen=True)
class Case:
    """An effect at its usual size on a sample run.

    Attributes:
        effect: the effect.
        kind: mechanism family of the sample.
        view: the sample, n rows.
        shape: searched and given parameters.
        theta: all parameters, amplitudes about their usual size.
        differentiate: (effect, theta, view) -> shift and its derivative, as the fit uses it.
    """

    effect: Effect
    kind: str
    view: View
    shape: Mapping[str, Tensor]
    theta: Tensor
    differentiate: Differentiate

    def shift(self, view: View | None = None) -> Tensor:
        """Shift of the effect on the sample or on other rows, (n, out)."""
        return self.effect.shift(self.theta, self.view if view is None else view)


def make_case(effect: Effect, kind: str, differentiate: Differentiate) -> Case:
    """Put an effect at its usual size on the sample run.

    Args:
        effect: the effect.
        kind: 'three-ptt' or 'serial'.
        differentiate: `ptt.model.chain.differentiate`.

    Returns:
        The case.

    Raises:
        ValueError: the search leaves out a searched or given parameter.
    """
    view = sample_view(kind, effect.least_joints)
    shape = effect.usual_trial(view)
    missing = [p.stem for p in effect.parameters if p.role != "linear" and p.stem not in shape]
    if missing:
        raise ValueError(f"search() gives no value for '{missing[0]}'")
    return Case(effect, kind, view, shape, usual_theta(effect, kind, view, shape), differentiate)


def usual_theta(effect: Effect, kind: str, view: View, shape: Mapping[str, Tensor]) -> Tensor:
    """Amplitudes of usual size, different for each joint, within their bounds.

    Args:
        effect: the effect.
        kind: mechanism family.
        view: gives the number of joints.
        shape: searched and given parameters.

    Returns:
        Flat theta.
    """
    theta = flatten(effect, shape, view.joints).clone()
    start = 0
    for parameter, size in zip(effect.parameters, sizes(effect, view.joints), strict=True):
        if parameter.role == "linear":
            place = torch.arange(size, dtype=torch.float64)
            values = parameter.on(kind).usual * (1.0 - 0.3 * (place % 3)) * torch.where(place % 2 == 1, -1.0, 1.0)
            theta[start : start + size] = values.abs() if parameter.lower >= 0.0 else values
        start += size
    return theta
