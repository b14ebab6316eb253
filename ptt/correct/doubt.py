"""How sure a command is: what the fit left uncertain at its target, and whether that is more than was promised."""

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from ptt.correct.task import Task
from ptt.fitting.kept import Kept, kept_covariance
from ptt.fitting.tool_sigma import tool_sigma
from ptt.model.chain import Shifts
from ptt.model.model import Model


@dataclass(frozen=True)
class NetworkError:
    """What a network leaves.

    Attributes:
        inside: error of held-out rows with it, mm.
        outside: error of held-out rows without it, mm: outside its domain it corrects nothing.
    """

    inside: float
    outside: float


def command_sigma(
    model: Model, task: Task, terms: Shifts, q: Tensor, in_domain: np.ndarray, network: NetworkError | None
) -> tuple[np.ndarray, float | None]:
    """What parameters and network leave uncertain at each target.

    Args:
        model: with what its file keeps of the fit.
        task: the targets.
        terms: effects of the machine with their parameters.
        q: commands, (n, k), finite.
        in_domain: rows inside the network's domain, (n,) bool.
        network: what it leaves; None without one.

    Returns:
        (n,) mm, NaN where nothing is kept; and how sure a command should be in mm: the error of held-out rows, nothing
        where the drawing did as well at them, None where nothing tells it.
    """
    kept: Kept | None = kept_covariance(model)
    if (terms and kept is None) or (not terms and network is None):
        return np.full(len(q), np.nan), None
    sigma = np.zeros(len(q))
    if kept is not None and terms:
        sigma = tool_sigma(kept, terms, task.see(q), model.file.machine.kind)
    if network is None:
        return sigma, None if kept is None else kept.promised
    # The errors of held-out rows have in them what the parameters leave open there; more than that they do not know.
    return np.maximum(sigma, np.where(in_domain, network.inside, network.outside)), network.inside


def doubtful(sigma: np.ndarray, shift: np.ndarray, promised: float | None) -> np.ndarray:
    """Rows whose command is less sure than held-out rows promise.

    Args:
        sigma: (n,) mm, NaN where unknown.
        shift: correction, (n,) mm; where nothing was promised, more than that would leave nothing gained.
        promised: error of held-out rows, mm; None where nothing tells it.

    Returns:
        (n,) bool.
    """
    bound = np.nan_to_num(shift, nan=np.inf) if promised is None else promised
    return np.asarray(np.nan_to_num(sigma, nan=0.0) > bound)
