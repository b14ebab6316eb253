"""Corrected commands: the joint values that put the real tool where it is wanted, each row with a status of its own."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from torch import Tensor

from ptt.correct.blocks import Block, cut, settle_blocks
from ptt.correct.commands import UNCERTAIN, Commands, sent_rows
from ptt.correct.doubt import NetworkError, command_sigma, doubtful
from ptt.correct.task import Task, first_order, nearest_commands
from ptt.correct.terms import Reversal, split_terms
from ptt.effects import Effect
from ptt.errors import TableError
from ptt.mechanisms import build_mechanism
from ptt.model.chain import Shifts
from ptt.model.model import Model
from ptt.progress import Progress
from ptt.run.cores import map_cores
from ptt.run.table import Table
from ptt.run.target_frame import in_base, target_frames
from ptt.run.view import elapsed

__all__ = ["LIMIT_MM", "Commands", "Correction", "NetworkError", "Reversal", "compensate", "missing_context"]

LIMIT_MM = 5.0  # machines err by 0.1 to 2 mm; what goes beyond this is a mistake in drawing, frame or network

Correction = Callable[
    [np.ndarray], np.ndarray
]  # wanted positions (n, 3) mm -> positions to ask the model for (n, 3) mm
Inside = Callable[[np.ndarray], np.ndarray]  # wanted positions (n, 3) mm -> (n,) bool


def compensate(
    model: Model,
    targets: Table,
    *,
    correction: Correction | None = None,
    inside: Inside | None = None,
    reversal: Reversal | None = None,
    limit: float = LIMIT_MM,
    network: NetworkError | None = None,
    progress: Progress | None = None,
) -> Commands:
    """Invert drive, geometry and structure of a model, never its metrology.

    Metrology includes where a reflector sat on an arm: what is put right is the drawing's tool point. Of a mount that
    was fitted along, the data cannot tell shifts of the last link; those stay at zero.

    The exact inverse is found by Newton steps through the whole chain. Reversal effects look at the order of the
    corrected commands, because the correction may move the turning points. A row that cannot be sent gets a status and
    no command; the machine stands where the row before left it, so the reversals of the rows behind stay right.

    Args:
        model: effects with their parameters.
        targets: wanted tool positions in travel order, with payload, temperature and speed where the model needs them.
        correction: what a network adds: wanted position -> position to ask the model for.
        inside: which wanted positions lie in the network's training domain.
        reversal: 'software', the default, puts the reversal compensation into the commands, 'none' leaves it out.
            What the machine file says its controller compensates is never put in.
        limit: largest correction that is sent, mm of tool: physics, network and reversal together.
        network: what the network that made the correction leaves, where that is known.
        progress: told what is done, how much of how much.

    Returns:
        The commands.

    Raises:
        TableError: a row without target.
    """
    tell = progress or (lambda what, done, of: None)
    tell("invert", 0, 1)
    steady, turning, words = split_terms(model, reversal)
    task = _prepare(model, targets, correction, (steady, turning), limit)
    found = _settle(task, tell)
    sent = sent_rows(found.status)
    in_domain = np.ones(len(sent), dtype=bool) if inside is None else inside(task.wanted.numpy())
    about = partial(_judge, task, found, sent, in_domain, network)
    parts = list(map_cores(about, found.blocks))
    sigma, simple, gap = (np.concatenate(values) for values in zip(*(part[:3] for part in parts), strict=True))
    promised = next((part[3] for part in parts if part[3] is not None), None)  # the same for all
    found.status[sent & doubtful(sigma, found.shift, promised)] = UNCERTAIN
    nearest, distance = nearest_commands(task, sent)
    tell("done", 1, 1)
    blank = np.where(sent[:, None], 0.0, np.nan)
    reversed_ = found.q - found.height
    return Commands(
        found.q + blank,
        reversed_ + blank,
        found.status,
        in_domain,
        found.shift,
        simple + reversed_,
        gap,
        words,
        np.where(sent, found.missed, np.nan),
        nearest,
        distance,
        np.where(sent, sigma, np.nan),
    )


@dataclass(frozen=True)
class _Found:
    """What an inversion ends with, n rows: as `Solved`, the tool's miss in mm, and the blocks."""

    height: np.ndarray
    q: np.ndarray
    missed: np.ndarray
    status: np.ndarray
    shift: np.ndarray
    blocks: list[Block]


def _settle(task: Task, tell: Progress) -> _Found:
    rows, joints = task.nominal.shape
    height, q, missed, shift = np.empty((rows, joints)), np.empty((rows, joints)), np.empty(rows), np.empty(rows)
    status, blocks = np.empty(rows, dtype=object), []
    for block, solved, said, moved in settle_blocks(task):
        here, own = slice(block.first, block.last), block.own
        height[here], q[here] = solved.height[own].numpy(), solved.q[own].numpy()
        missed[here], status[here], shift[here] = solved.missed[own].norm(dim=1).numpy(), said[own], moved[own]
        blocks.append(block)
        if block.last < rows:
            tell("invert", block.last, rows)
    return _Found(height, q, missed, status, shift, blocks)


def _judge(
    task: Task, found: _Found, sent: np.ndarray, in_domain: np.ndarray, network: NetworkError | None, block: Block
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float | None]:
    """Of the rows of a block: sigma, the first-order command and how far off it is; and the error that is promised."""
    part, own, seen = cut(task, block), block.own, slice(block.low, block.high)
    sigma, promised = np.full(block.high - block.low, np.nan), None
    if sent[seen].any():
        q, terms, part = torch.as_tensor(found.q[seen]), [*task.steady, *task.turning], part.paced(sent[seen])
        sigma, promised = command_sigma(task.model, part, terms, q, in_domain[seen], network)
    here = slice(block.first, block.last)
    height = torch.as_tensor(found.height[here])
    simple = first_order(task.mechanism, task.wanted[here], height, sent[here])
    gap = (task.mechanism.forward(simple) - task.mechanism.forward(height)).norm(dim=1)
    return sigma[own], simple.numpy(), gap.numpy(), promised


def missing_context(model: Model, targets: Table) -> list[str]:
    """What effects of a model depend on and a list of targets does not tell.

    Args:
        model: the model.
        targets: the targets.

    Returns:
        One sentence for each such column.
    """
    told = {
        "payload": ("payload_kg", targets.payload_kg, "none"),
        "temperature": ("temp_c", targets.temp_c, f"{model.file.machine.reference_temp_c:g} C"),
        "speed": ("feed_mm_s", targets.feed_mm_s if targets.time_s is None else targets.time_s, "standstill"),
        "time": ("time_s", targets.time_s, "zero"),
    }
    lines = []
    for need, (column, values, assumed) in told.items():
        users = [t.effect.key for t in model.terms if need in t.effect.requires and t.effect.stage != "metrology"]
        if users and values is None:
            lines.append(
                f"{', '.join(users)} depends on {need}, {targets.source} has no {column}: {assumed} is assumed"
            )
    return lines


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
    """Joint commands that say how an arm is to reach its targets, (n, k) rad; None where there are none.

    An arm reaches a position in many postures, so its nominal commands are the target: the corrected ones lie beside.
    """
    if model.file.machine.kind != "serial" or targets.command is None or not np.isfinite(targets.command).all():
        return None
    return torch.as_tensor(np.array(targets.command, dtype=float))


def _prepare(
    model: Model, targets: Table, correction: Correction | None, terms: tuple[Shifts, Shifts], limit: float
) -> Task:
    mechanism = build_mechanism(model.file.machine)
    near = _posture(model, targets)
    wanted = _wanted(model, targets) if near is None else mechanism.forward(near).numpy()
    place = torch.as_tensor(wanted)
    asked = place if correction is None else torch.as_tensor(correction(wanted))
    nominal = mechanism.inverse(place, None, near)
    start = nominal if correction is None else mechanism.inverse(asked, None, near)
    start = torch.where(torch.isfinite(start).all(dim=1)[:, None], start, nominal)
    time = elapsed(targets)
    follows = any(map(_follows_speed, (effect for part in terms for effect, _ in part)))
    clock, targets = targets if follows else None, targets.replace(time_s=None, feed_mm_s=None)
    return Task(model, targets, mechanism, *terms, place, asked, nominal, start, limit, time, clock=clock)


def _follows_speed(effect: Effect) -> bool:
    """Whether an effect may look at speeds; one of the user's own may do so without a word."""
    return "speed" in effect.requires or not type(effect).__module__.startswith("ptt.")
