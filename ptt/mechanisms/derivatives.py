"""Exact derivatives by reverse mode.

Torch's forward mode loads torch's compiler, and sympy with it, at the first product of a number and a dual number. That
takes longer than all the rest of a command; reverse mode does without.
"""

from collections.abc import Callable

import torch
from torch import Tensor

Function = Callable[[Tensor], Tensor]


def by_parameters(function: Function, theta: Tensor) -> Tensor:
    """Jacobian of a function of a few parameters, by two reverse passes for each parameter.

    The vector-Jacobian product g = J^T u is linear in the weights u of the values: the gradient of g_j by u is column j
    of J.

    Args:
        function: (P,) -> (...).
        theta: where, (P,).

    Returns:
        (..., P).
    """
    with torch.enable_grad():
        inputs = theta.detach().clone().requires_grad_(True)
        values = function(inputs)
        if not values.requires_grad or not len(theta):
            return values.new_zeros(*values.shape, len(theta)).detach()
        weights = torch.zeros_like(values, requires_grad=True)
        return torch.stack([_gradient(each, weights) for each in _vector_jacobian(values, weights, inputs)], dim=-1)


def by_input(function: Function, x: Tensor) -> Tensor:
    """Jacobian of each row of a function that treats every row by itself.

    A reverse pass for each value of a row, or as in `by_parameters` for each input where a row has fewer of these.

    Args:
        function: (n, m) -> (n, out).
        x: where, (n, m).

    Returns:
        (n, out, m).
    """
    with torch.enable_grad():
        inputs = x.detach().clone().requires_grad_(True)
        values = function(inputs)
        if not values.requires_grad:
            return values.new_zeros(*values.shape, x.shape[1]).detach()
        if values.shape[1] <= x.shape[1]:
            return torch.stack([_gradient(column.sum(), inputs) for column in values.unbind(dim=-1)], dim=-2)
        weights = torch.zeros_like(values, requires_grad=True)
        product = _vector_jacobian(values, weights, inputs).unbind(dim=-1)
        return torch.stack([_gradient(column.sum(), weights) for column in product], dim=-1)


def _vector_jacobian(values: Tensor, weights: Tensor, inputs: Tensor) -> Tensor:
    """Vector-Jacobian product J^T u, as a differentiable function of the weights u, shaped as the inputs."""
    # The sum is weighted here: weights handed to `grad` would have their shapes compared by sympy.
    (product,) = torch.autograd.grad((values * weights).sum(), inputs, create_graph=True)
    return product


def _gradient(value: Tensor, inputs: Tensor) -> Tensor:
    """Gradient of one number; zero where it does not depend on the inputs."""
    if not value.requires_grad:
        return torch.zeros_like(inputs).detach()
    (found,) = torch.autograd.grad(value, inputs, retain_graph=True, allow_unused=True)
    return torch.zeros_like(inputs).detach() if found is None else found
