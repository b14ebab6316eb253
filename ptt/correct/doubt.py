"""How sure a command is: what the fit left uncertain at its target, and whether that is more than was promised."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.correct.task import CommandTask
from ptt.fitting.kept import kept_covariance
from ptt.fitting.tool_sigma import tool_sigma
from ptt.model.chain import EffectTerms
from ptt.model.model import Model
from ptt.run.direction import STANDSTILL
from ptt.run.travel import OVERTRAVEL
from ptt.run.view import View

CHANCE = 0.5  # that a joint came from the other side than that on which it goes on
FAR = 20.0  # times the overtravel that is assumed: as far as anybody goes past a pose


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
    model: Model, task: CommandTask, terms: EffectTerms, q: Tensor, in_domain: np.ndarray, network: NetworkError | None
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
    kept = kept_covariance(model)
    if (terms and kept is None) or (not terms and network is None):
        return np.full(len(q), np.nan), None
    sigma, view = np.zeros(len(q)), task.see(q)
    if kept is not None and terms:
        sigma = tool_sigma(kept, terms, view, model.file)
    if network is None:
        return sigma, None if kept is None else kept.promised
    if kept is not None and terms and kept.unnamed is not None:
        # What has no name a network has learned where it knows poses, whatever it is, as far as its errors have fallen.
        named = tool_sigma(replace(kept, unnamed=None), terms, view, model.file)
        left = min(network.inside / network.outside, 1.0) if network.outside > 0.0 else 1.0
        sigma = np.where(in_domain, np.hypot(named, left * np.sqrt(np.maximum(sigma**2 - named**2, 0.0))), sigma)
    # The errors of held-out rows have in them what the parameters leave open there; more than that they do not know.
    return np.maximum(sigma, np.where(in_domain, network.inside, network.outside)), network.inside


def approach_doubt(task: CommandTask, terms: EffectTerms, q: Tensor) -> np.ndarray:
    """How far the tool may be off because the targets leave open how the joints came.

    From which side to the first row, where `dir1..` does not say it; and how far past a row before a joint turned,
    where `dir1..` says that it did.

    A drive that winds up has not turned over for dozens of small steps. The first row itself arrives as the second
    moves, and a joint that never moves in a run counts as +1, by convention (`ptt.run.travel`): neither is doubted.

    Args:
        task: the targets.
        terms: effects of the machine with their parameters.
        q: commands, (n, k), finite.

    Returns:
        (n,) mm, standard deviation.
    """
    drives = [(effect, theta) for effect, theta in terms if effect.stage == "drive" and len(theta)]
    known, view = [(effect, theta) for effect, theta in drives if effect.reverses], task.see(q)
    stated = task.targets.direction
    untold = torch.ones_like(q, dtype=torch.bool) if stated is None else torch.as_tensor(~(np.abs(stated) > 0.0))
    moved = (q.diff(dim=0, prepend=q[:1]).abs() > STANDSTILL) & ~view.starts[:, None]
    run = torch.cumsum(view.starts, dim=0) - int(view.starts[0])  # of each row, as the list has them
    moving = torch.zeros(int(run.max()) + 1, view.joints, dtype=torch.int64).index_add(0, run, moved.long())[run] > 0
    turned = view.starts[:, None] & untold & moving
    past = _past_doubt(known, view, ~untold)
    if not known or not turned.any():
        return past
    other = replace(view, direction=torch.where(turned, -view.direction, view.direction))
    apart = torch.stack([effect.shift(theta, view) - effect.shift(theta, other) for effect, theta in known]).sum(dim=0)
    each = view.jacobian * apart[:, None, :]  # shape: (n, 3, k)
    # Each joint may have come from the other side by itself: the mean square of so many coins.
    off = (CHANCE**2 * each.sum(dim=2).square() + CHANCE * (1.0 - CHANCE) * each.square().sum(dim=2)).sum(dim=1).sqrt()
    ever = moved.any(dim=1).cumsum(dim=0)
    stands = ever == torch.where(view.starts, ever, torch.zeros_like(ever)).cummax(dim=0).values  # where the run began
    return np.hypot(torch.where(stands, torch.zeros_like(off), off).numpy(), past)


def _past_doubt(known: EffectTerms, view: View, told: Tensor) -> np.ndarray:
    """What hangs on how far joints went past rows, where the targets say from which side they came and the rows do not.

    The travel has `OVERTRAVEL` there; that it was as far as anybody goes is as likely.

    Args:
        known: effects that remember the travel.
        view: of the commands.
        told: arrivals that the targets state, (n, k) bool.

    Returns:
        (n,) mm, standard deviation.
    """
    past = told & ~view.starts[:, None] & (((view.q - view.turning_point).abs() - OVERTRAVEL).abs() < STANDSTILL)
    if not known or not past.any():
        return np.zeros(view.rows)
    far = replace(view, turning_point=torch.where(past, view.q - FAR * OVERTRAVEL * view.direction, view.turning_point))
    apart = torch.stack([effect.shift(theta, view) - effect.shift(theta, far) for effect, theta in known]).sum(dim=0)
    each = CHANCE * view.jacobian * apart[:, None, :]
    return np.asarray(each.square().sum(dim=(1, 2)).sqrt().numpy())


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
