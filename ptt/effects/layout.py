"""Layout of an effect's parameter values in one flat vector, and of its basis columns."""

from collections.abc import Mapping
from typing import ClassVar, Protocol

import torch
from torch import Tensor

from ptt.effects.parameter import Parameter
from ptt.mechanisms.serial import Serial
from ptt.run.view import View


class Parametrised(Protocol):
    """What has parameters in a declared order: an effect."""

    parameters: ClassVar[tuple[Parameter, ...]]


def family(view: View) -> str:
    """Mechanism family of a view: 'three-ptt' or 'serial'."""
    return "serial" if isinstance(view.mechanism, Serial) else "three-ptt"


def sizes(effect: Parametrised, joints: int) -> tuple[int, ...]:
    """Number of values of each parameter of an effect on k joints."""
    return tuple(parameter.size(joints) for parameter in effect.parameters)


def weigh(basis: Tensor, amounts: Tensor) -> Tensor:
    """Linear combination of basis columns; a basis expanded from one row is multiplied once.

    Args:
        basis: (n, out, P).
        amounts: (P,).

    Returns:
        (n, out).
    """
    if basis.stride(0) == 0 and len(basis):
        return (basis[0] @ amounts).expand(len(basis), -1)
    return basis @ amounts


def linear_size(effect: Parametrised, joints: int) -> int:
    """Number of linear values of an effect on k joints."""
    return sum(parameter.size(joints) for parameter in effect.parameters if parameter.role == "linear")


def total_size(effect: Parametrised, joints: int) -> int:
    """Number of all values of an effect on k joints."""
    return sum(sizes(effect, joints))


def shape_of(effect: Parametrised, theta: Tensor, joints: int) -> dict[str, Tensor]:
    """Cut the searched and given parameters out of the flat vector.

    Args:
        effect: the effect.
        theta: all its parameters, flat.
        joints: k.

    Returns:
        Stem -> values, (size,).
    """
    parts = torch.split(theta, list(sizes(effect, joints)))
    return {p.stem: part for p, part in zip(effect.parameters, parts, strict=True) if p.role != "linear"}


def flatten(effect: Parametrised, shape: Mapping[str, Tensor], joints: int) -> Tensor:
    """Flat parameter vector with zero amplitudes and a given shape: where a search linearises an effect.

    Args:
        effect: the effect.
        shape: stem -> values of the searched and given parameters.
        joints: k.

    Returns:
        Flat theta.
    """
    parts = [
        torch.zeros(parameter.size(joints), dtype=torch.float64)
        if parameter.role == "linear"
        else torch.as_tensor(shape[parameter.stem], dtype=torch.float64).reshape(-1).expand(parameter.size(joints))
        for parameter in effect.parameters
    ]
    return torch.cat(parts) if parts else torch.zeros(0, dtype=torch.float64)


def per_joint(*columns: Tensor) -> Tensor:
    """Block-diagonal basis of parameters of which each value acts on its own joint alone.

    Args:
        columns: for each parameter (n, k) or (n, k, c), the shift of joint i per unit of its own value or values.

    Returns:
        (n, k, P), the parameters side by side.
    """
    blocks = []
    for column in columns:
        values = column.unsqueeze(-1) if column.dim() == 2 else column  # shape: (n, k, c)
        n, k, c = values.shape
        own = values.new_zeros(n, k, k, c)
        own.diagonal(dim1=1, dim2=2).copy_(values.transpose(1, 2))
        blocks.append(own.reshape(n, k, k * c))
    return torch.cat(blocks, dim=-1)
