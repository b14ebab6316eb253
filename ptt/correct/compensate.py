"""Corrected commands: the joint values that put the real tool where it is wanted, each row with a status of its own."""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from ptt.correct.commands import UNCERTAIN, Commands, sent_rows
from ptt.correct.doubt import NetworkError, command_sigma, doubtful
from ptt.correct.task import Task, first_order, nearest_commands, settle
from ptt.correct.terms import Reversal, split_terms
from ptt.errors import TableError
from ptt.mechanisms import build_mechanism
from ptt.model.chain import Shifts
from ptt.model.model import Model
from ptt.progress import Progress
from ptt.run.table import Table
from ptt.run.target_frame import in_base, target_frames

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
    solved, status, shift = settle(task)
    sent = sent_rows(status)
    in_domain = np.ones(len(sent), dtype=bool) if inside is None else inside(task.wanted.numpy())
    sigma = np.full(len(sent), np.nan)
    if sent.any():
        sigma, promised = command_sigma(model, task, [*steady, *turning], solved.q, in_domain, network)
        status[sent & doubtful(sigma, shift, promised)] = UNCERTAIN
    blank = torch.as_tensor(np.where(sent[:, None], 0.0, np.nan))  # shape: (n, 1)
    simple = first_order(task, solved.height, sent)
    gap = (task.mechanism.forward(simple) - task.mechanism.forward(solved.height)).norm(dim=1)
    nearest, distance = nearest_commands(task, sent)
    tell("done", 1, 1)
    return Commands(
        (solved.q + blank).numpy(),
        (solved.q - solved.height + blank).numpy(),
        status,
        in_domain,
        shift,
        (simple + (solved.q - solved.height)).numpy(),
        gap.numpy(),
        words,
        np.where(sent, solved.missed.norm(dim=1).numpy(), np.nan),
        nearest,
        distance,
        np.where(sent, sigma, np.nan),
    )


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
    return Task(model, targets, mechanism, *terms, place, asked, nominal, start, limit)
