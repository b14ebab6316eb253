"""Corrected commands: the joint values that put the real tool where it is wanted."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from ptt.chain import Shifts, predict
from ptt.effects.drive import Backlash
from ptt.errors import TableError, WorkspaceError
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.protocol import Mechanism, require_reachable
from ptt.mechanisms.workspace import reach
from ptt.model import Model
from ptt.table import Table
from ptt.view import View, build_view, joint_limits

ROUNDS = 12
SETTLED = 1e-7  # mm: a tool this near its goal ends the iteration
MISSED = 1e-4  # mm: a tool this far from its goal after all rounds cannot get there
ROWS_SHOWN = 5

Reversal = Literal["software", "none"]
Correction = Callable[
    [np.ndarray], np.ndarray
]  # wanted positions (n, 3) mm -> positions to ask the model for (n, 3) mm
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Commands:
    """What to send.

    Attributes:
        q: joint commands, everything included, (n, k) mm or rad.
        reversal: the part of them that is reversal compensation, (n, k).
        status: 'ok', 'out of travel' or 'near singular', (n,).
        in_domain: rows inside the training domain of the network, all True without one, (n,) bool.
        shift: how far the commands ask the drawing to go from the target, (n,) mm.
        first_order: the same commands by H_m(b - db) = f(p) - J_a dp, (n, k).
        first_order_gap: how far apart the two put the tool, (n,) mm.
        reversal_note: who compensates what at a reversal, in words.
        missed: by how much the model's tool misses what it was asked for, (n,) mm; more than rounding only where
            reversal effects leave a step that no command can take.
    """

    q: np.ndarray
    reversal: np.ndarray
    status: np.ndarray
    in_domain: np.ndarray
    shift: np.ndarray
    first_order: np.ndarray
    first_order_gap: np.ndarray
    reversal_note: str
    missed: np.ndarray


def compensate(
    model: Model,
    targets: Table,
    *,
    correction: Correction | None = None,
    inside: Callable[[np.ndarray], np.ndarray] | None = None,
    reversal: Reversal | None = None,
    progress: Progress | None = None,
) -> Commands:
    """Invert drive, geometry and structure of a model, never its metrology.

    Metrology includes where a reflector sat on an arm: what is put right is the drawing's tool point. Of a mount that
    was fitted along, the data cannot tell shifts of the last link; those stay at zero.

    The exact inverse is found by Newton steps through the whole chain. Reversal effects look at the order of the
    corrected commands, because the correction may move the turning points.

    Args:
        model: effects with their parameters.
        targets: wanted tool positions in travel order, with payload, temperature and speed where the model needs them.
        correction: what a network adds: wanted position -> position to ask the model for.
        inside: which wanted positions lie in the network's training domain.
        reversal: 'software', the default, puts the reversal compensation into the commands, 'none' leaves it out.
            What the machine file says its controller compensates is never put in.
        progress: told what is done, how much of how much.

    Returns:
        The commands.

    Raises:
        WorkspaceError: a target out of reach, by line.
        TableError: a row without target.
    """
    tell = progress or (lambda what, done, of: None)
    mechanism = build_mechanism(model.file.machine)
    near = _posture(model, targets)
    wanted = _wanted(targets) if near is None else mechanism.forward(near).numpy()
    place = torch.as_tensor(wanted)
    lines = [int(line) for line in targets.line]
    require_reachable(mechanism, place, targets.source, lines=lines, near=near)
    asked = wanted if correction is None else correction(wanted)
    steady, turning, words = _split(model, reversal)
    goal = torch.as_tensor(asked)
    start = require_reachable(mechanism, goal, f"{targets.source}, corrected", lines=lines, near=near)
    tell("invert", 0, 2)
    height, step = _newton(steady, lambda q: _see(model, targets, q), start, goal)
    _require(height, step, targets)
    tell("reversal", 1, 2)
    q = height
    if turning:
        opened = _opened(height, turning, _see(model, targets, height))
        q, step = _newton([*steady, *turning], lambda q: _see(model, targets, q), opened, goal)
        _require(q, torch.zeros_like(step), targets)
    tell("done", 2, 2)
    nominal = mechanism.forward(height)
    simple = _first_order(mechanism, place, nominal, height)
    return Commands(
        q.numpy(),
        (q - height).numpy(),
        _status(model, mechanism, q, place),
        np.ones(len(wanted), dtype=bool) if inside is None else inside(wanted),
        (nominal - place).norm(dim=1).numpy(),
        (simple + (q - height)).numpy(),
        (mechanism.forward(simple) - nominal).norm(dim=1).numpy(),
        words,
        step.norm(dim=1).numpy(),
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


def _wanted(targets: Table) -> np.ndarray:
    missing = np.flatnonzero(~np.isfinite(targets.target).all(axis=1))
    if len(missing):
        raise TableError(
            f"no target position ({len(missing)} of {targets.rows} rows)",
            where=targets.place(int(missing[0])),
            fix="fill x_cmd, y_cmd, z_cmd or take the row out",
        )
    return np.asarray(targets.target, dtype=float)


def _posture(model: Model, targets: Table) -> Tensor | None:
    """Joint commands that say how an arm is to reach its targets, (n, k) rad; None where there are none.

    An arm reaches a position in many postures, so its nominal commands are the target: the corrected ones lie beside.
    """
    if model.file.machine.kind != "serial" or targets.command is None or not np.isfinite(targets.command).all():
        return None
    return torch.as_tensor(np.array(targets.command, dtype=float))


def _split(model: Model, reversal: Reversal | None) -> tuple[Shifts, Shifts, str]:
    """Effects that depend on the pose and its context, those that depend on the way there, and who does the latter."""
    terms = [(term.effect, term.theta) for term in model.terms if term.effect.stage != "metrology" and len(term.theta)]
    steady = [item for item in terms if not item[0].reverses]
    turning = [item for item in terms if item[0].reverses]
    if not turning:
        return steady, [], "the model has no reversal effect"
    if reversal == "none":
        return steady, [], f"none, as asked: {_keys(turning)} left out"
    done = [item for item in turning if item[0].name in model.file.controller.compensates]
    mine = [item for item in turning if item not in done]
    words = [f"in these commands: {_keys(mine)}"] if mine else []
    words += [f"left to the controller: {_keys(done)}"] if done else []
    return steady, mine, "; ".join(words)


def _keys(terms: Shifts) -> str:
    return ", ".join(effect.key for effect, _ in terms)


def _see(model: Model, targets: Table, q: Tensor) -> View:
    """The travel that commands q make, with the context of the targets."""
    return build_view(model.file, replace(targets, command=q.numpy()))


def _newton(terms: Shifts, see: Callable[[Tensor], View], q: Tensor, goal: Tensor) -> tuple[Tensor, Tensor]:
    """Joint values at which the model puts the tool at its goal, and by how much it misses, (n, 3) mm.

    The view is taken anew in every round, because reversal effects remember the travel that the commands make. Where
    they leave a step that no command can take, rows go to and fro; each row keeps its best round.
    """
    best, least = q, torch.full_like(goal, torch.inf)
    if not terms:
        return q, torch.zeros_like(goal)
    for _ in range(ROUNDS):
        if not bool(torch.isfinite(q).all()):
            return q, least
        view = see(q)
        step = goal - predict(terms, view).p
        better = (step.norm(dim=1) < least.norm(dim=1))[:, None]
        best, least = torch.where(better, q, best), torch.where(better, step, least)
        if float(least.abs().max()) < SETTLED:
            break
        # Least squares serves arms whose Jacobian is not square; for three sliders it is the plain solution.
        q = q + torch.linalg.lstsq(view.jacobian, step[..., None]).solution[..., 0]
    return best, least


def _require(q: Tensor, step: Tensor, targets: Table) -> None:
    bad = torch.nonzero(~torch.isfinite(q).all(dim=1) | ~(step.abs().amax(dim=1) < MISSED)).flatten().tolist()
    if bad:
        named = ", ".join(str(targets.line[row]) for row in bad[:ROWS_SHOWN])
        more = f" and {len(bad) - ROWS_SHOWN} more" if len(bad) > ROWS_SHOWN else ""
        raise WorkspaceError(
            f"the corrected target is out of reach: line{'s' if len(bad) > 1 else ''} {named}{more} "
            f"({len(bad)} of {len(q)} rows)",
            bad,
            where=targets.source,
            fix="keep targets inside the workspace, or check the model's parameters",
        )


def _opened(height: Tensor, turning: Shifts, view: View) -> Tensor:
    """Commands half the gap ahead in the direction of travel: the exact inverse of the play operator."""
    gaps = [0.5 * theta for effect, theta in turning if isinstance(effect, Backlash)]
    return height + sum(gaps, torch.zeros(height.shape[1], dtype=height.dtype)) * view.direction


def _first_order(mechanism: Mechanism, wanted: Tensor, nominal: Tensor, near: Tensor) -> Tensor:
    """H_m(b - db) = f(p) - J_a dp (eq. 13 of the source paper) with dp = p - N(p), N the corrected target.

    J_a is taken half-way, at p - dp/2: there the first-order form is good to the third order in dp.
    """
    shift = wanted - nominal
    at = mechanism.inverse(wanted - 0.5 * shift, None, near)
    # J_a = db/dp is the inverse of dp/dq; least squares serves arms whose Jacobian is not square.
    return (
        mechanism.inverse(wanted, None, near)
        - torch.linalg.lstsq(mechanism.jacobian(at), shift[..., None]).solution[..., 0]
    )


def _status(model: Model, mechanism: Mechanism, q: Tensor, wanted: Tensor) -> np.ndarray:
    limits = joint_limits(model.file, q.shape[1])
    status = np.where(reach(mechanism, wanted) == "near singular", "near singular", "ok").astype(object)
    status[((q < limits[:, 0]) | (q > limits[:, 1])).any(dim=1).numpy()] = "out of travel"
    return status
