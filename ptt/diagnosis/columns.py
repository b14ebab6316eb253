"""Columns of the linearised problem, as the fit assembles them."""

from ptt.fit.linear import Linear, Shapes, Trial, few_shapes, linear_columns

__all__ = ["Linear", "Shapes", "Trial", "few_shapes", "linear_columns"]
