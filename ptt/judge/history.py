"""The history of a model: one entry per step, enough to draw the ladder again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from ptt.errors import MachineError
from ptt.files import sha256
from ptt.fitting.kept import keep_covariance
from ptt.judge.ladder.ladder import Ladder, LadderStep
from ptt.machine import MachineFile
from ptt.model.entries import write_model
from ptt.model.model import Model
from ptt.run.axes import AXES_TOTAL


@dataclass(frozen=True)
class HistoryEntry:
    """One step that led to a model.

    Attributes:
        date: ISO 8601, UTC.
        command: 'add', 'remove' or 'fit'.
        effect: what was added or removed; 'refit' where nothing was.
        kind: 'added', 'removed' or 'refit'.
        files: run files, {'file', 'sha256'} each.
        rows: readings that counted.
        before_um: training error before, x, y, z, total.
        after_um: training error after.
        heldout_before_um: held-out error before.
        heldout_after_um: held-out error after.
        noise_um: noise floor, x, y, z, total, source.
        helped: whether the held-out error fell (removed: did not rise) by more than chance.
    """

    date: str
    command: str
    effect: str
    kind: str
    files: tuple[dict[str, str], ...]
    rows: int
    before_um: dict[str, float]
    after_um: dict[str, float]
    heldout_before_um: dict[str, float]
    heldout_after_um: dict[str, float]
    noise_um: dict[str, Any]
    helped: bool


def record(
    ladder: Ladder, command: str, files: Sequence[str | Path | Mapping[str, str]], *, date: str | None = None
) -> MachineFile:
    """The machine file of a ladder's last model, with one history entry for each step.

    Args:
        ladder: the ladder.
        command: the verb that made it.
        files: run files it was made from; of one that is not here, its {'file', 'sha256'}.
        date: ISO 8601; None for now.

    Returns:
        The machine file with effects and history.
    """
    stamp = date or datetime.now(UTC).isoformat(timespec="seconds")
    sources = [_source(each) for each in files]
    head = {"date": stamp, "command": command, "files": sources}
    entries = [_entry(before, step, ladder, head) for before, step in pairwise(ladder.steps)]
    written = write_model(ladder.model, [item["sha256"] for item in sources])
    last = ladder.steps[-1]
    covariance = keep_covariance(last.fitted, 1e-3 * float(last.heldout_rms_um["total"]), helped(ladder))
    if covariance is not None and ladder.masked is not None:
        covariance = covariance.model_copy(update={"masked": ladder.masked.spec()})
    return replace(written, history=(*ladder.model.file.history, *entries), covariance=covariance)


def helped(ladder: Ladder) -> bool | None:
    """Whether the last model of a ladder predicts held-out readings better than the drawing, beyond chance.

    Args:
        ladder: the ladder.

    Returns:
        Whether it does; None where the ladder did not begin at the drawing, or has no further step.
    """
    first, *steps = ladder.steps
    if first.fitted.model.terms or not steps:
        return None
    falls = steps[-1].heldout_rms_um["total"] < first.heldout_rms_um["total"]
    return falls and any(step.helped for step in steps)


def _source(file: str | Path | Mapping[str, str]) -> dict[str, str]:
    return dict(file) if isinstance(file, Mapping) else {"file": Path(file).name, "sha256": sha256(file)}


def read_entries(file: MachineFile) -> tuple[HistoryEntry, ...]:
    """Read the steps back.

    Args:
        file: a machine file; entries of other kinds (a person's own) are left aside.

    Returns:
        The steps, oldest first.

    Raises:
        MachineError: an entry of the program that lacks a key or cannot be read.
    """
    try:
        return tuple(_read(row) for row in file.steps)
    except KeyError as error:
        raise MachineError(f"history entry without {error}", where=file.source, fix="remove that [[history]]") from None
    except (TypeError, ValueError) as error:
        words = f"history entry that cannot be read ({error})"
        raise MachineError(words, where=file.source, fix="remove that [[history]]") from None


def runs_of(entries: Sequence[HistoryEntry]) -> list[list[HistoryEntry]]:
    """Cut a history into ladders: entries with the same date and the same files.

    Args:
        entries: oldest first.

    Returns:
        One list for each ladder.
    """
    ladders: list[list[HistoryEntry]] = []
    for entry in entries:
        if ladders and (ladders[-1][-1].date, ladders[-1][-1].files) == (entry.date, entry.files):
            ladders[-1].append(entry)
        else:
            ladders.append([entry])
    return ladders


def _entry(before: LadderStep, step: LadderStep, ladder: Ladder, head: Mapping[str, Any]) -> dict[str, Any]:
    change = {step.kind: [step.effect]} if step.kind in ("added", "removed") else {}
    return {
        **head,
        "kind": step.kind,
        **change,
        "rows": ladder.report.rows,
        "ranges": ladder.ranges,
        "helped": step.helped,
        "error_before_um": _plain(before.rms_um),
        "error_after_um": _plain(step.rms_um),
        "heldout_before_um": _plain(before.heldout_rms_um),
        "heldout_after_um": _plain(step.heldout_rms_um),
        "noise_um": {**_plain(ladder.noise_um), "source": str(ladder.noise_um["source"])},
        "parameters_before": _parameters(before.fitted.model),
    }


def _noise(figures: Mapping[str, Any]) -> dict[str, Any]:
    return {**figures, **_plain(figures)}


def _plain(figures: Mapping[str, Any]) -> dict[str, float]:
    return {axis: float(figures[axis]) for axis in AXES_TOTAL}


def _parameters(model: Model) -> dict[str, dict[str, float | list[float]]]:
    """Effect -> parameter -> value or values; effects without values are left out."""
    found = {}
    for entry, term in zip(write_model(replace(model, aside=())).effect, model.terms, strict=True):
        if entry.parameters:
            found[term.effect.key] = {name: _number(item.value) for name, item in entry.parameters.items()}
    return found


def _number(value: float | tuple[float, ...]) -> float | list[float]:
    return list(value) if isinstance(value, tuple) else value


def _read(row: Mapping[str, Any]) -> HistoryEntry:
    changed = row.get("added") or row.get("removed") or ["refit"]
    return HistoryEntry(
        str(row["date"]), str(row["command"]), str(changed[0]), str(row["kind"]),
        tuple({"file": str(item["file"]), "sha256": str(item["sha256"])} for item in row["files"]), int(row["rows"]),
        _plain(row["error_before_um"]), _plain(row["error_after_um"]), _plain(row["heldout_before_um"]),
        _plain(row["heldout_after_um"]), _noise(row["noise_um"]), bool(row["helped"]),
    )  # fmt: skip
