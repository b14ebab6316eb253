"""Context that a model depends on and targets may lack or exceed: payload, temperature, speed, time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.effects.curve import Curve
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
# Share of the known range by which a context may be outside it and a command still count as certain: what is learned
# over a range says little of a place half of it further on
NEAR = 0.5
BY_ONE = {"payload": "payload", "temperature": "warmth"}  # context -> field of a view, tried by one kg, one K
FROM_ZERO = ("payload_kg", "feed_mm_s")  # without load, at standstill, what depends on it is known to vanish
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
        users = _users(model, targets, need) if asked else []
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
    contexts = contexts_of(targets, targets.target) if contexts is None else contexts
    return tuple(
        Beyond(each.column, each.users, each.run, int((each.size > 0.0).sum()), float(each.size.max()))
        for each in _excesses(model, targets, contexts)
    )


def far_beyond(model: Model, targets: Table, contexts: Mapping[str, np.ndarray]) -> np.ndarray:
    """Rows with a context far outside the range that the model was fitted over, where an effect depends on it.

    Args:
        model: the model.
        targets: n rows of the targets.
        contexts: column -> (n,) as `contexts_of` gives them.

    Returns:
        (n,) bool.
    """
    far = np.zeros(targets.rows, dtype=bool)
    for each in _excesses(model, targets, contexts):
        far |= each.size > each.near
    return far


@dataclass(frozen=True)
class _Excess:
    """How far a context is outside the range of the model's run.

    Attributes:
        column: of the targets.
        users: keys of the effects that depend on it in some of these rows.
        run: lowest and highest value in the model's run.
        near: distance outside up to which a command still counts as certain, in the column's unit.
        size: distance outside, (n,) in the column's unit; 0 where it is no more than is mentioned, or no effect depends
            on it.
    """

    column: str
    users: tuple[str, ...]
    run: tuple[float, float]
    near: float
    size: np.ndarray


def _excesses(model: Model, targets: Table, contexts: Mapping[str, np.ndarray]) -> Iterator[_Excess]:
    """Each context of targets (n rows) that is outside the range of the model's run where an effect depends on it."""
    then = ranges_of_model(model.file) or {}
    for column in filter(then.__contains__, contexts):
        values, (low, high) = contexts[column], _known(model, column, then[column])
        outside = np.maximum(low - values, values - high)
        rows = np.flatnonzero(outside > LEAST_BEYOND[column])
        users = _followers(model, targets, QUANTITIES[column][0], rows) if len(rows) else {}
        if users:
            # what follows the clock may turn at any time, so no length of a run tells of the time after it
            near, size = (0.0 if column == "time_s" else NEAR * (high - low)), np.zeros(targets.rows)
            size[rows] = np.where(np.any(list(users.values()), axis=0), outside[rows], 0.0)
            yield _Excess(column, tuple(users), then[column], near, size)


def _known(model: Model, column: str, run: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest value of a context at which its effects are known: those of the run, and zero in `FROM_ZERO`.

    A curve along a load or speed need not vanish at zero.
    """
    curves = [term.effect for term in model.terms if isinstance(term.effect, Curve)]
    need = QUANTITIES[column][0]
    curved = any(name.startswith(need) for curve in curves for name in (curve.along, *curve.together))
    return (min(run[0], 0.0) if column in FROM_ZERO and not curved else run[0]), run[1]


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
        users = _users(model, targets.replace(**dict.fromkeys(COLUMNS)), need) if len(blank) else []
        if users:
            raise TableError(
                f"empty, and {users[0]} depends on it ({len(blank)} of {targets.rows} rows)",
                where=targets.place(int(blank[0]), column),
                fix=f"write the value into the cell, or --set {column}=VALUE for all rows",
            )


def _users(model: Model, targets: Table, need: str) -> list[str]:
    """Keys of the effects that depend on a context at some of `ASKED` targets."""
    return list(
        _followers(model, targets, need, np.unique(np.linspace(0, targets.rows - 1, ASKED).round().astype(int)))
    )


def _followers(model: Model, targets: Table, need: str, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Effects that depend on a context at some rows (m,) of targets: those that require it, and those that it moves.

    Returns:
        Key -> at which of the rows, (m,) bool.
    """
    moved = _moved(model, targets, need, rows) if need in BY_ONE else {}
    found = dict[str, np.ndarray]()
    for effect in (term.effect for term in model.terms if term.effect.stage != "metrology"):
        where = np.ones(len(rows), dtype=bool) if need in effect.requires else moved.get(effect.key)
        if where is not None and where.any():
            found[effect.key] = where
    return found


def _moved(model: Model, targets: Table, need: str, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Key of each effect -> which of some rows (m,) the drawing reaches and one kg or one K changes its shift at."""
    file, part = model.file, take_rows(targets, rows)
    command = part.command
    if command is None or not np.isfinite(command).all():
        base = torch.as_tensor(in_base(part, target_frames(file, targets)).target)
        command = build_mechanism(file.machine).inverse(base).numpy()
    reached = np.isfinite(command).all(axis=1)
    if not reached.any():
        return {}
    view = build_view(file, take_rows(part.replace(command=command), np.flatnonzero(reached)))
    more, found = replace(view, **{BY_ONE[need]: getattr(view, BY_ONE[need]) + 1.0}), dict[str, np.ndarray]()
    with torch.no_grad():
        for term in model.terms:
            if len(term.theta):
                change = term.effect.shift(term.theta, view) != term.effect.shift(term.theta, more)
                found[term.effect.key] = np.zeros(len(rows), dtype=bool)
                found[term.effect.key][reached] = change.flatten(1).any(dim=1).numpy()
    return found


def _had_load(file: MachineFile) -> bool:
    """Whether the model's runs had a payload, or do not say; without one, targets need not state any."""
    ranges = [each for each in ranges_of_steps(file) if each is not None]
    return not ranges or any(each.get("payload_kg", (0.0, 0.0))[1] > 0.0 for each in ranges)
