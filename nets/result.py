"""What a training returns."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nets.network import GaussianRbf
from nets.scaling import FloatArray


@dataclass(frozen=True)
class Candidate:
    """What the hidden layer may look like.

    Attributes:
        centres: number of nodes; 0 is the threshold alone, or with `affine` a straight line.
        spread: as in `RbfSettings.spreads`; 0 without nodes.
        affine: whether there is a straight-line part.
    """

    centres: int
    spread: float
    affine: bool


@dataclass(frozen=True)
class TriedSetting:
    """One row of the table of what was tried.

    Attributes:
        candidate: the hidden layer.
        ridge: the penalty; 0 without nodes.
        heldout_rms: (o,) root mean square over all held-out rows, in units of the outputs.
    """

    candidate: Candidate
    ridge: float
    heldout_rms: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class RbfTraining:
    """A trained network and how it was found.

    Attributes:
        network: fitted on all rows; outputs that were not learned are zero.
        chosen: the hidden layer; centres = 0 and affine = False for the null network.
        ridges: (o,) the penalty of each output; 0 where it was not learned.
        heldout_rms: (o,) error on rows that neither fit nor choice has seen, in units of the outputs.
        null_rms: (o,) the same when zero is predicted.
        p_value: (o,) of the gain over zero, see `nets.selection.judge`.
        learned: (o,) whether the output is predicted.
        fitted_rms: (o,) error on the training rows.
        tried: every setting with its held-out error.
        mse_curve: (epochs + 1, o) mean squared error along the gradient descent, squared units of the outputs;
            (0, o) for the closed form.
    """

    network: GaussianRbf
    chosen: Candidate
    ridges: FloatArray
    heldout_rms: FloatArray
    null_rms: FloatArray
    p_value: FloatArray
    learned: npt.NDArray[np.bool_]
    fitted_rms: FloatArray
    tried: tuple[TriedSetting, ...]
    mse_curve: FloatArray
