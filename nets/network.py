"""The Gaussian radial basis function network."""

from typing import Self

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from nets.domain import Domain
from nets.scaling import FloatArray

CHUNK_ROWS = 32768  # bounds the memory of predict(): rows x nodes


class GaussianRbf(nn.Module):
    """y = sum_j w_j exp(-|x - g_j|^2 / (2 eps_j^2)) - threshold (+ x slope), x the standardised inputs.

    Eqs. 14 and 17 of the 3-PTT paper. Without nodes, slope and threshold it is the null network: zero everywhere.
    float64; differentiable in its inputs and its weights.

    Attributes:
        input_mean: (m,) subtracted from the inputs, in their units.
        input_scale: (m,) the inputs are divided by.
        centres: (q, m) g, scaled inputs.
        widths: (q,) eps, scaled inputs.
        weights: (q, o) w, in the units of the outputs.
        threshold: (o,), in the units of the outputs.
        slope: (m, o), in the units of the outputs per scaled input; zero where no straight-line part was chosen.
        domain_points: (d, m), scaled inputs; with `domain_reach` () and `domain_box` (2, m) see `nets.domain.Domain`.
    """

    input_mean: Tensor
    input_scale: Tensor
    centres: Tensor
    widths: Tensor
    domain_points: Tensor
    domain_reach: Tensor
    domain_box: Tensor

    def __init__(
        self,
        *,
        scaling: tuple[FloatArray, FloatArray],
        centres: FloatArray,
        widths: FloatArray,
        weights: FloatArray,
        threshold: FloatArray,
        slope: FloatArray,
        domain: Domain,
    ) -> None:
        """Build the network from its numbers; shapes as under Attributes.

        Args:
            scaling: mean (m,) and scale (m,) of the inputs.
            centres: (q, m).
            widths: (q,).
            weights: (q, o).
            threshold: (o,).
            slope: (m, o).
            domain: where it was trained, in scaled inputs.
        """
        super().__init__()
        self.register_buffer("input_mean", _tensor(scaling[0]))
        self.register_buffer("input_scale", _tensor(scaling[1]))
        self.register_buffer("centres", _tensor(centres))
        self.register_buffer("widths", _tensor(widths))
        self.register_buffer("domain_points", _tensor(domain.points))
        self.register_buffer("domain_reach", _tensor(np.asarray(domain.reach)))
        self.register_buffer("domain_box", _tensor(np.stack([domain.low, domain.high])))
        self.weights = nn.Parameter(_tensor(weights))
        self.threshold = nn.Parameter(_tensor(threshold))
        self.slope = nn.Parameter(_tensor(slope))
        self._domain = domain

    @classmethod
    def from_tensors(cls, tensors: dict[str, FloatArray]) -> Self:
        """Rebuild a network from the arrays of its `state_dict`.

        Args:
            tensors: name -> array, shapes as under Attributes.

        Returns:
            The network.
        """
        low, high = tensors["domain_box"]
        return cls(
            scaling=(tensors["input_mean"], tensors["input_scale"]),
            domain=Domain(tensors["domain_points"], float(tensors["domain_reach"]), low, high),
            **{name: tensors[name] for name in ("centres", "widths", "weights", "threshold", "slope")},
        )

    @property
    def inputs(self) -> int:
        """Number of inputs m."""
        return self.slope.shape[0]

    @property
    def outputs(self) -> int:
        """Number of outputs o."""
        return self.slope.shape[1]

    @property
    def domain(self) -> Domain:
        """Where the network was trained, in scaled inputs."""
        return self._domain

    def forward(self, x: Tensor) -> Tensor:
        """Outputs of the network.

        Args:
            x: (..., m), in the units of the training inputs, float64.

        Returns:
            (..., o), in the units of the training outputs.
        """
        scaled = (x - self.input_mean) / self.input_scale  # shape: (..., m)
        return hidden(scaled, self.centres, self.widths) @ self.weights + scaled @ self.slope - self.threshold

    def predict(self, x: npt.ArrayLike) -> FloatArray:
        """Outputs for numpy inputs, in chunks of rows, without derivatives.

        Args:
            x: (n, m), in the units of the training inputs.

        Returns:
            (n, o), in the units of the training outputs.
        """
        rows = torch.as_tensor(np.asarray(x, dtype=np.float64))
        with torch.no_grad():
            parts = [self(part) for part in rows.split(CHUNK_ROWS)]
        return np.asarray(torch.cat(parts).numpy())

    def inside(self, x: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether points lie in the training domain, by the rule of `nets.domain.Domain`.

        Args:
            x: (n, m), in the units of the training inputs; a row with NaN is outside.

        Returns:
            (n,) True inside.
        """
        return self._domain.contains(
            (np.asarray(x, dtype=np.float64) - self.input_mean.numpy()) / self.input_scale.numpy()
        )


def hidden(scaled: Tensor, centres: Tensor, widths: Tensor) -> Tensor:
    """Values of the hidden nodes, eq. 14: phi = exp(-|x - g|^2 / (2 eps^2)).

    Args:
        scaled: (..., m) scaled inputs.
        centres: (q, m).
        widths: (q,).

    Returns:
        (..., q), in (0, 1].
    """
    # The squares are multiplied out: a matrix product needs no (n, q, m) array.
    cross = scaled @ centres.T  # shape: (..., q)
    squared = (scaled**2).sum(-1, keepdim=True) + (centres**2).sum(-1) - 2.0 * cross
    return torch.exp(-squared.clamp_min(0.0) / (2.0 * widths**2))


def _tensor(values: FloatArray) -> Tensor:
    # ascontiguousarray makes a 0-d array 1-d, array() does not; and the network owns its numbers.
    return torch.from_numpy(np.array(values, dtype=np.float64, order="C"))
