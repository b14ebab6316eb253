"""Corrected commands: the joint values that put the real tool where it is wanted, each row with a status of its own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.correct.blocks import Settled, settle_task
from ptt.correct.commands import ROUNDING, UNCERTAIN, Commands, sent_rows
from ptt.correct.context import far_beyond
from ptt.correct.doubt import NetworkError, approach_doubt, beginning_doubt, command_sigma, doubtful
from ptt.correct.nearest import nearest_of
from ptt.correct.settle import first_order, nearest_commands
from ptt.correct.task import CommandTask, Correction
from ptt.correct.terms import Reversal, split_terms
from ptt.errors import TableError
from ptt.mechanisms import Mechanism, build_mechanism
from ptt.model.chain import EffectTerms
from ptt.model.model import Model
from ptt.progress import Progress, unwatched
from ptt.run.blanks import without_empty
from ptt.run.ranges import contexts_of
from ptt.run.table import Table
from ptt.run.target_frame import in_base, target_frames
from ptt.run.viewing import elapsed, lags_of

__all__ = ["LIMIT_MM", "Commands", "Correction", "NetworkError", "Reversal", "compensate"]

LIMIT_MM = 5.0  # machines err by 0.1 to 2 mm; a larger correction is a mistake in drawing, frame or network

# Which wanted positions, (n, 3) mm, with their nominal joint values, (n, k), a network knows, (n,) bool.
Inside = Callable[[np.ndarray, np.ndarray], np.ndarray]


def compensate(
    model: Model,
    targets: Table,
    *,
    correction: Correction | None = None,
    inside: Inside | None = None,
    reversal: Reversal | None = None,
    limit: float = LIMIT_MM,
    network: NetworkError | None = None,
    nearest: bool = True,
    progress: Progress | None = None,
) -> Commands:
    """Corrected commands: invert drive, geometry and structure of a model, never its metrology.

    The offset of an arm's reflector belongs to metrology: it is the drawing's tool point that is put on the target.
    Where that offset was fitted too, the data do not determine shifts of the last link, which stay at zero.

    The exact inverse is found by Newton's method through the whole chain. Reversal effects follow the order of the
    corrected commands, because the correction may move the turning points. A row that cannot be sent gets a status and
    no command; the machine stands where the row before left it, so that reversals of the rows behind are right.

    Args:
        model: effects with their parameters.
        targets: wanted tool positions in travel order, with payload, temperature and speed where the model needs them.
        correction: of a network: wanted position, nominal joint values -> position that the model is to reach.
        inside: which of these lie in the network's training domain.
        reversal: 'software', the default, puts the reversal compensation into the commands, 'none' leaves it out.
            What the machine file says its controller compensates is never put in.
        limit: largest correction that is sent, mm of tool: physics, network and reversal together.
        network: held-out error of the network that made the correction, where that is known.
        nearest: whether to find, for each row that cannot be sent, the nearest command that can.
        progress: told what is done, how much of how much.

    Returns:
        The commands.

    Raises:
        TableError: a row without target, or no row.
    """
    tell = progress or unwatched
    tell("invert", 0, 1)
    plan = plan_of(model, reversal, limit, network)
    task, rows = prepare(plan, targets, correction, inside), targets.rows
    done = []
    for settled in settle_task(task):
        done.append(finish(plan, settled))
        if settled.last < rows:
            tell("invert", settled.last, rows)
    commands = joined(done)
    rest = np.flatnonzero(~commands.sent) if nearest else np.empty(0, dtype=int)
    near = nearest_of(task.wanted, task.nominal, commands.sent) if len(rest) else None
    commands_near, distance = nearest_commands(task, rest, near)
    tell("done", 1, 1)
    return replace(commands, nearest=commands_near, nearest_gap=distance)


@dataclass(frozen=True)
class InversionPlan:
    """What an inversion is to do, apart from the targets.

    Attributes:
        model: effects with their parameters.
        steady: effects that depend on pose and context alone.
        reversing: effects that depend on the direction or travel before, as far as the commands compensate them.
        words: which reversal effects are in the commands and which are left to the controller.
        limit: largest correction that is sent, mm.
        network: held-out error of the network that made the correction, where that is known.
    """

    model: Model
    steady: EffectTerms
    reversing: EffectTerms
    words: str
    limit: float
    network: NetworkError | None

    @property
    def follows_speed(self) -> bool:
        """Whether an effect may depend on speed; a user's own may do so without requiring it."""
        effects = [effect for effect, _ in (*self.steady, *self.reversing)]
        return any("speed" in each.requires or not type(each).__module__.startswith("ptt.") for each in effects)


def plan_of(model: Model, reversal: Reversal | None, limit: float, network: NetworkError | None) -> InversionPlan:
    """The plan of an inversion; arguments as `compensate`."""
    return InversionPlan(model, *split_terms(model, reversal), limit, network)


def finish(plan: InversionPlan, settled: Settled) -> Commands:
    """The commands of an inverted block, with their uncertainty; `nearest` is left blank.

    Args:
        plan: the plan.
        settled: the block.

    Returns:
        The commands of its own rows.
    """
    part, own, solved = settled.task, settled.own, settled.outcome.solved
    sent = sent_rows(settled.outcome.status)
    sigma, approach, promised = np.full(len(sent), np.nan), np.zeros(len(sent)), None
    if sent[own].any():
        terms, paced = [*part.steady, *part.reversing], part.paced(sent)
        sigma, promised = command_sigma(plan.model, paced, terms, solved.q, part.in_domain, plan.network)
        approach = approach_doubt(paced, terms, solved.q)
        sigma = np.hypot(np.hypot(sigma, approach), beginning_doubt(terms, paced.view_of(solved.q)))
    q, height, sent, sigma = solved.q[own].numpy(), solved.height[own], sent[own], sigma[own]
    status, shift = settled.outcome.status[own].copy(), settled.outcome.shift_mm[own]
    missed = np.where(sent, solved.missed[own].norm(dim=1).numpy(), np.nan)
    in_all = np.where(missed > ROUNDING, np.hypot(np.nan_to_num(sigma, nan=0.0), missed), sigma)
    far = far_beyond(plan.model, part.targets, part.contexts)[own]
    status[sent & (doubtful(in_all, shift, promised) | far)] = UNCERTAIN
    simple = first_order(part.mechanism, part.wanted[own], height, sent)
    gap = (part.mechanism.forward(simple) - part.mechanism.forward(height)).norm(dim=1).numpy()
    blank, reversed_ = np.where(sent[:, None], 0.0, np.nan), q - height.numpy()
    nothing, sigma = np.full(q.shape, np.nan), np.where(sent, sigma, np.nan)
    return Commands(
        q + blank, reversed_ + blank, status, part.in_domain[own], shift, gap, plan.words,
        missed, nothing, nothing[:, 0].copy(), sigma, np.where(sent, approach[own], 0.0),
    )  # fmt: skip


def joined(parts: Sequence[Commands]) -> Commands:
    """The commands of several blocks, concatenated."""
    values = [vars(part) for part in parts]
    one = {name: np.concatenate([each[name] for each in values]) for name in values[0] if name != "reversal_note"}
    return Commands(**one, reversal_note=parts[0].reversal_note)


def _wanted(model: Model, targets: Table) -> np.ndarray:
    """Targets in the base frame, (n, 3) mm."""
    missing = np.flatnonzero(~np.isfinite(targets.target).all(axis=1))
    if len(missing):
        raise TableError(
            f"no target position ({len(missing)} of {targets.rows} rows)",
            where=targets.place(int(missing[0])),
            fix="fill x_cmd, y_cmd, z_cmd or take the row out",
        )
    return in_base(targets, target_frames(model.file, targets)).target


def _posture(model: Model, targets: Table) -> Tensor | None:
    """Nominal joint commands of an arm's targets, (n, k) rad; None where there are none.

    An arm reaches a position in many postures, so where it has nominal commands these are its targets, and corrected
    commands keep their posture.
    """
    if model.file.machine.kind != "serial" or targets.command is None or not np.isfinite(targets.command).all():
        return None
    return torch.as_tensor(np.array(targets.command, dtype=float))


def _start(mechanism: Mechanism, asked: Tensor, nominal: Tensor, near: Tensor | None) -> Tensor:
    """Joint values that reach what is asked in the posture of the target, else those of the target, (n, k).

    An arm with joints to spare reaches it in many postures: another than that of `nominal` would be sent unjudged.
    """
    start, lost = mechanism.inverse(asked, None, nominal if near is None else near), ~torch.isfinite(nominal).all(dim=1)
    if near is None and lost.any():
        start[lost] = mechanism.inverse(asked[lost])
    return torch.where(torch.isfinite(start).all(dim=1)[:, None], start, nominal)


def prepare(
    plan: InversionPlan,
    targets: Table,
    correction: Correction | None,
    inside: Inside | None,
    time: Tensor | None = None,
    *,
    by_feed: bool | None = None,
) -> CommandTask:
    """The task of inverting some targets.

    Args:
        plan: the plan.
        targets: the rows.
        correction: as `compensate`.
        inside: as `compensate`.
        time: seconds since the first row of the whole list, (n,) s; None: these are the whole list.
        by_feed: whether the whole list shows a feed; None: these are the whole list.

    Returns:
        The task.

    Raises:
        TableError: a row without target, or no row.
    """
    if not targets.rows:
        raise TableError("no rows", where=targets.source, fix="name at least one target")
    mechanism = build_mechanism(plan.model.file.machine)
    near = _posture(plan.model, targets)
    wanted = _wanted(plan.model, targets) if near is None else mechanism.forward(near).numpy()
    place = torch.as_tensor(wanted)
    nominal = mechanism.inverse(place, None, near)
    joints = (nominal if near is None else near).numpy()
    asked = place if correction is None else torch.as_tensor(correction(wanted, joints))
    in_domain = np.ones(len(wanted), dtype=bool) if inside is None else inside(wanted, joints)
    start = nominal if correction is None else _start(mechanism, asked, nominal, near)
    time = elapsed(targets) if time is None else time
    contexts = contexts_of(targets, wanted, time.numpy(), by_feed=by_feed)
    clock = targets if plan.follows_speed else None
    targets = without_empty(targets)
    behind, targets = lags_of(targets), targets.replace(time_s=None, feed_mm_s=None)
    ways = plan.steady, plan.reversing
    return CommandTask(
        plan.model, targets, mechanism, *ways, place, asked, in_domain, nominal, start, plan.limit, time, behind,
        contexts, clock=clock, correction=correction,
    )  # fmt: skip
