"""Context that a model depends on and targets may lack or exceed: payload, temperature, speed, time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.errors import TableError
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.blanks import without_empty
from ptt.run.ranges import LEAST_BEYOND, QUANTITIES, contexts_of, ranges_of_model, ranges_of_steps
from ptt.run.table import Table, take_rows
from ptt.run.target_frame import in_base, target_frames
from ptt.run.viewing import build_view

ASKED = 100  # rows, evenly spaced, at which one kg or one K is tried: an effect that moves none of them moves few
# Share of the run's range by which a context may be outside it and a command still count as certain: what is learned
# over a range says little of a place half of it further on; of what follows the clock, no later time says anything
NEAR = 0.5
BY_ONE = {"payload": "payload", "temperature": "warmth"}  # context -> field of a view, tried by one kg, one K
COLUMNS = {"payload_kg": "payload", "temp_c": "temperature"}


def missing_context(model: Model, targets: Table) -> list[str]:
    """Contexts that effects of a model depend on and a list of targets does not state.

    Args:
        model: the model.
        targets: the targets.

    Returns:
        One sentence for each missing column.
    """
    targets = without_empty(targets)
    told = {
        "payload": ("payload_kg", targets.payload_kg, "0 kg"),
        "temperature": ("temp_c", targets.temp_c, f"{model.file.machine.reference_temp_c:g} C"),
        "speed": ("feed_mm_s", targets.feed_mm_s if targets.time_s is None else targets.time_s, "standstill"),
        "time": ("time_s", targets.time_s, "zero"),
    }
    lines = []
    for need, (column, values, assumed) in told.items():
        asked = values is None and (need != "payload" or _had_load(model.file))
        users = _followers(model, targets, need) if asked else []
        if users:
            verb = "depends" if len(users) == 1 else "depend"
            lines.append(
                f"{', '.join(users)} {verb} on {need}, but {targets.source} has no {column}: {assumed} is assumed"
            )
    return lines


@dataclass(frozen=True)
class Beyond:
    """Rows of targets outside the range of payload, temperature, speed or time that the model was fitted over.

    Attributes:
        column: of the targets.
        users: keys of the effects that depend on it.
        run: lowest and highest value in the model's run.
        rows: number of rows outside.
        worst: largest distance outside, in the column's unit.
    """

    column: str
    users: tuple[str, ...]
    run: tuple[float, float]
    rows: int
    worst: float


def beyond_context(
    model: Model, targets: Table, contexts: Mapping[str, np.ndarray] | None = None
) -> tuple[Beyond, ...]:
    """Payloads, temperatures, speeds and times of targets outside the range that the model was fitted over.

    Args:
        model: the model.
        targets: the targets, or a part of them.
        contexts: column -> (n,) as `contexts_of` gives them; None: these are the whole list.

    Returns:
        One entry for each column on which an effect of the model depends.
    """
    then, found = ranges_of_model(model.file) or {}, []
    contexts = contexts_of(targets, targets.target) if contexts is None else contexts
    for column, values in contexts.items():
        if column not in then or not np.isfinite(values).any():
            continue
        low, high = then[column]
        beyond = (values < low - LEAST_BEYOND[column]) | (values > high + LEAST_BEYOND[column])
        users = _followers(model, targets, QUANTITIES[column][0]) if beyond.any() else []
        if users:
            worst = float(np.nanmax(np.maximum(low - values, values - high)))
            found.append(Beyond(column, tuple(users), (low, high), int(beyond.sum()), worst))
    return tuple(found)


def far_beyond(model: Model, contexts: Mapping[str, np.ndarray]) -> np.ndarray | bool:
    """Rows with a context far outside the range that the model was fitted over, where an effect requires it.

    Args:
        model: the model.
        contexts: column -> (n,) as `contexts_of` gives them.

    Returns:
        (n,) bool; False where there are none.
    """
    then = ranges_of_model(model.file) or {}
    far: np.ndarray | bool = False
    needs = {need for term in model.terms if term.effect.stage != "metrology" for need in term.effect.requires}
    for column, values in contexts.items():
        if column in then and QUANTITIES[column][0] in needs:
            low, high = then[column]
            slack = max(NEAR * (high - low) if column != "time_s" else 0.0, LEAST_BEYOND[column])
            far = far | (values < low - slack) | (values > high + slack)
    return far


def beyond_lines(parts: Sequence[Sequence[Beyond]], source: str, rows: int) -> list[str]:
    """What `beyond_context` found, in words, for all parts of a list together.

    Args:
        parts: what it found in each part.
        source: file name for messages.
        rows: number of rows of the whole list.
    """
    lines = []
    for column, (need, unit) in QUANTITIES.items():
        own = [each for part in parts for each in part if each.column == column]
        if own:
            (low, high), users = own[0].run, list(dict.fromkeys(user for each in own for user in each.users))
            worst, count = max(each.worst for each in own), sum(each.rows for each in own)
            verb = "depends" if len(users) == 1 else "depend"
            lines.append(
                f"{source}: {need} goes beyond the model's run ({low:.3g} to {high:.3g} {unit}) by up to {worst:.3g} "
                f"in {count} of {rows} rows, where nobody measured how {', '.join(users)} {verb} on it"
            )
    return lines


def require_context(model: Model, targets: Table) -> None:
    """Refuse an empty cell of a payload or temperature on which the command depends.

    Args:
        model: the model.
        targets: the targets.

    Raises:
        TableError: there is one; it names file, row and column.
    """
    told = without_empty(targets)
    for column, need in COLUMNS.items():
        values = getattr(told, column)
        blank = np.flatnonzero(np.isnan(values)) if values is not None else np.empty(0, dtype=int)
        users = _followers(model, targets.replace(**dict.fromkeys(COLUMNS)), need) if len(blank) else []
        if users:
            raise TableError(
                f"empty, and {users[0]} depends on it ({len(blank)} of {targets.rows} rows)",
                where=targets.place(int(blank[0]), column),
                fix=f"write the value into the cell, or --set {column}=VALUE for all rows",
            )


def _followers(model: Model, targets: Table, need: str) -> list[str]:
    """Keys of the effects that depend on a context: those that require it, and those that it moves at these targets."""
    moved = _moved(model, targets, need) if need in BY_ONE else set()
    terms = [term.effect for term in model.terms if term.effect.stage != "metrology"]
    return [effect.key for effect in terms if need in effect.requires or effect.key in moved]


def _moved(model: Model, targets: Table, need: str) -> set[str]:
    """Keys of the effects whose shift one kg or one K changes at some of the targets that the drawing reaches."""
    file, rows = model.file, np.unique(np.linspace(0, targets.rows - 1, ASKED).round().astype(int))
    part = take_rows(targets, rows)
    command = part.command
    if command is None or not np.isfinite(command).all():
        base = torch.as_tensor(in_base(part, target_frames(file, targets)).target)
        command = build_mechanism(file.machine).inverse(base).numpy()
    part = take_rows(part.replace(command=command), np.flatnonzero(np.isfinite(command).all(axis=1)))
    if not part.rows:
        return set()
    view = build_view(file, part)
    more = replace(view, **{BY_ONE[need]: getattr(view, BY_ONE[need]) + 1.0})
    with torch.no_grad():
        return {
            term.effect.key
            for term in model.terms
            if len(term.theta)
            and not torch.equal(term.effect.shift(term.theta, view), term.effect.shift(term.theta, more))
        }


def _had_load(file: MachineFile) -> bool:
    """Whether the model's runs had a payload, or do not say; without one, targets need not state any."""
    ranges = [each for each in ranges_of_steps(file) if each is not None]
    return not ranges or any(each.get("payload_kg", (0.0, 0.0))[1] > 0.0 for each in ranges)
