"""Design matrix for the weights, given centres and widths."""

from dataclasses import dataclass

import numpy as np
import torch

from nets.network import hidden
from nets.scaling import FloatArray


@dataclass(frozen=True, eq=False)
class Design:
    """Columns of the least-squares problem, features and outputs with the background projected off.

    Attributes:
        background: (n, h): ones, and the scaled inputs where there is a straight-line part.
        features: (n, q): hidden nodes, less their fit by the background. Wide nodes are nearly constant; without
            this the normal equations would lose digits by cancellation.
        outputs: (n, o), less their fit by the background.
        removed_features: (h, q) coefficients of that fit.
        removed_outputs: (h, o).
    """

    background: FloatArray
    features: FloatArray
    outputs: FloatArray
    removed_features: FloatArray
    removed_outputs: FloatArray

    def threshold_and_slope(self, background: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Threshold and slope of the network for weights fitted on this design.

        Args:
            background: (h, o) coefficients fitted beside the weights.
            weights: (q, o).

        Returns:
            threshold (o,) and the slope (h - 1, o), h - 1 = 0 without a straight-line part.
        """
        total = background + self.removed_outputs - self.removed_features @ weights
        return -total[0], total[1:]


def build_design(
    scaled: FloatArray, outputs: FloatArray, centres: FloatArray, widths: FloatArray, *, affine: bool
) -> Design:
    """Evaluate the hidden nodes, and project the background off features and outputs.

    Args:
        scaled: (n, m) scaled inputs.
        outputs: (n, o).
        centres: (q, m), scaled; q may be 0.
        widths: (q,), scaled.
        affine: whether there is a straight-line part.

    Returns:
        The design.
    """
    background = np.hstack([np.ones((len(scaled), 1)), scaled] if affine else [np.ones((len(scaled), 1))])
    features = hidden(*(torch.from_numpy(np.ascontiguousarray(each)) for each in (scaled, centres, widths))).numpy()
    inverse = np.linalg.pinv(background, rcond=1e-10)  # (h, n)
    removed_features, removed_outputs = inverse @ features, inverse @ outputs
    return Design(
        background=background,
        features=features - background @ removed_features,
        outputs=outputs - background @ removed_outputs,
        removed_features=removed_features,
        removed_outputs=removed_outputs,
    )
