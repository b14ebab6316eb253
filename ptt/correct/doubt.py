"""Uncertainty of a command: standard deviation of the tool at its target, and whether it exceeds the held-out error."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.correct.task import CommandTask
from ptt.effects.dated import unplaced
from ptt.effects.late import has_begun, starts_of
from ptt.fitting.kept import kept_covariance
from ptt.fitting.tool_sigma import tool_sigma
from ptt.model.chain import EffectTerms
from ptt.model.model import Model
from ptt.run.direction import STANDSTILL
from ptt.run.travel import OVERTRAVEL
from ptt.run.view import View

CHANCE = 0.5  # probability that a joint came from the other side than that to which it goes on
FAR = 20.0  # times the overtravel that is assumed: no program overtravels farther


@dataclass(frozen=True)
class NetworkError:
    """Held-out error of a network.

    Attributes:
        inside: error of held-out rows with it, mm.
        outside: error of held-out rows without it, mm: outside its domain it corrects nothing.
    """

    inside: float
    outside: float


def command_sigma(
    model: Model, task: CommandTask, terms: EffectTerms, q: Tensor, in_domain: np.ndarray, network: NetworkError | None
) -> tuple[np.ndarray, float | None]:
    """Standard deviation of the tool position at each target, by the parameters' covariance and the network's error.

    Args:
        model: its file keeps the covariance of the fit.
        task: the targets.
        terms: effects of the machine with their parameters.
        q: commands, (n, k), finite.
        in_domain: rows inside the network's domain, (n,) bool.
        network: its held-out error; None without one.

    Returns:
        (n,) mm, NaN where no covariance is kept; and the standard deviation that a command should not exceed: the error
        of held-out rows, 0 where the drawing did as well there, None where it is not known.
    """
    kept = kept_covariance(model)
    if (terms and kept is None) or (not terms and network is None):
        return np.full(len(q), np.nan), None
    sigma, view = np.zeros(len(q)), task.view_of(q)
    if kept is not None and terms:
        sigma = tool_sigma(kept, terms, view, model.file)
    if network is None:
        return sigma, None if kept is None else kept.promised
    if kept is not None and terms and kept.unnamed is not None:
        # Inside its domain the network has learned the unnamed part too, as far as it reduced held-out errors.
        named = tool_sigma(replace(kept, unnamed=None), terms, view, model.file)
        left = min(network.inside / network.outside, 1.0) if network.outside > 0.0 else 1.0
        sigma = np.where(in_domain, np.hypot(named, left * np.sqrt(np.maximum(sigma**2 - named**2, 0.0))), sigma)
    # Held-out errors contain the parameters' share within the poses measured; outside it may be larger: the maximum.
    return np.maximum(sigma, np.where(in_domain, network.inside, network.outside)), network.inside


def approach_doubt(task: CommandTask, terms: EffectTerms, q: Tensor) -> np.ndarray:
    """Standard deviation of the tool because the targets do not say how the joints arrived.

    It covers the side from which joints came to the first row, where `dir1..` does not state it, and the overtravel
    past a row before a joint turned, where `dir1..` states that it did.

    A drive that winds up needs dozens of small steps to turn over, so rows behind the first are affected. The first row
    itself arrives as the second moves, and a joint that never moves in a run counts as +1, by convention
    (`ptt.run.travel`): neither is doubted.

    Args:
        task: the targets.
        terms: effects of the machine with their parameters.
        q: commands, (n, k), finite.

    Returns:
        (n,) mm.
    """
    drives = [(effect, theta) for effect, theta in terms if effect.stage == "drive" and len(theta)]
    known, view = [(effect, theta) for effect, theta in drives if effect.reverses], task.view_of(q)
    past, other = _past_doubt(known, view, ~_untold(task, q)), from_other_side(task, view)
    if not known or other is None:
        return past
    apart = torch.stack([effect.shift(theta, view) - effect.shift(theta, other) for effect, theta in known]).sum(dim=0)
    each = view.jacobian * apart[:, None, :]  # shape: (n, 3, k)
    # Each joint may have come from the other side independently: second moment of a sum of k independent coin tosses.
    off = (CHANCE**2 * each.sum(dim=2).square() + CHANCE * (1.0 - CHANCE) * each.square().sum(dim=2)).sum(dim=1).sqrt()
    ever = _moved(view).any(dim=1).cumsum(dim=0)
    stands = ever == torch.where(view.starts, ever, torch.zeros_like(ever)).cummax(dim=0).values  # where the run began
    stands &= view.starts.cumsum(dim=0) > 0
    return np.hypot(torch.where(stands, torch.zeros_like(off), off).numpy(), past)


def beginning_doubt(terms: EffectTerms, view: View) -> np.ndarray:
    """Standard deviation of the tool because the targets do not say how warm a late body is at their first row.

    It is taken to be as warm as the air. How far from it it was at most as a measured run began is taken to be likely.

    Args:
        terms: effects of the machine with their parameters.
        view: of the commands, n rows.

    Returns:
        (n,) mm.
    """
    square = torch.zeros(view.rows, dtype=view.q.dtype)
    for effect, theta in terms:
        if not has_begun(effect, theta):
            continue
        measured = unplaced(effect)(label=effect.label)
        away = theta.clone()
        starts_of(away)[:] = starts_of(theta).abs().max()
        off = measured.shift(away, view) - effect.shift(theta, view)
        tool = (view.jacobian @ off[:, :, None])[:, :, 0] if effect.stage == "drive" else off
        square += tool.square().sum(dim=1)
    return np.asarray(square.sqrt().numpy())


def from_other_side(task: CommandTask, view: View) -> View | None:
    """The travel with joints that came to the first row of a run from the other side, where the targets do not say it.

    Args:
        task: the targets.
        view: the travel of their commands.

    Returns:
        The view; None where no joint may have come from there, or none of the rows remembers that it did.
    """
    moved, run = _moved(view), torch.cumsum(view.starts, dim=0) - int(view.starts[0])  # of each row, as the list has it
    moving = torch.zeros(int(run.max()) + 1, view.joints, dtype=torch.int64).index_add(0, run, moved.long())[run] > 0
    turned = view.starts[:, None] & _untold(task, view.q) & moving
    before = None if task.handover is None else task.handover.other_side
    if before is None and not turned.any():
        return None
    entries = view.entries if before is None else (replace(before, row=0),)
    return replace(view, direction=torch.where(turned, -view.direction, view.direction), entries=entries)


def _untold(task: CommandTask, q: Tensor) -> Tensor:
    """Arrivals of commands q (n, k) whose direction the targets do not state, (n, k) bool."""
    stated = task.targets.direction
    return torch.ones_like(q, dtype=torch.bool) if stated is None else torch.as_tensor(~(np.abs(stated) > 0.0))


def _moved(view: View) -> Tensor:
    """Which joints have moved since the row before in the same run, (n, k) bool."""
    return (view.q.diff(dim=0, prepend=view.q[:1]).abs() > STANDSTILL) & ~view.starts[:, None]


def _past_doubt(known: EffectTerms, view: View, told: Tensor) -> np.ndarray:
    """Standard deviation of the tool by unknown overtravel, where the targets state a direction that the rows lack.

    The travel has `OVERTRAVEL` there; `FAR` times as much is taken to be as likely.

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
    """Rows whose command is less certain than held-out rows promise.

    Args:
        sigma: standard deviation, (n,) mm, NaN where unknown.
        shift: correction, (n,) mm: the bound where nothing was promised, since beyond it nothing is gained.
        promised: error of held-out rows, mm; None where it is not known.

    Returns:
        (n,) bool.
    """
    bound = np.nan_to_num(shift, nan=np.inf) if promised is None else promised
    return np.asarray(np.nan_to_num(sigma, nan=0.0) > bound)
