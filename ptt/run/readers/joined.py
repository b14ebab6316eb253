"""Concatenation of several runs; runs of different files stay separate."""

from collections.abc import Mapping as Dictionary
from collections.abc import Sequence
from typing import Any

import numpy as np

from ptt.errors import TableError
from ptt.run.readers.mapping import Understood

_OF_RUNS = ("run", "run_label", "run_sha256", "run_file")
_KEPT = (*_OF_RUNS, "source", "files", "joint_prefix", "extra", "watched", "understood")


def join_fields(parts: Sequence[Dictionary[str, Any]]) -> dict[str, Any]:
    """Fields of the table that holds all rows of several tables, in their order.

    Args:
        parts: fields of each table.

    Returns:
        Fields: arrays joined, NaN where one table has a column and another does not; runs renumbered and labelled
        'file:run' or 'file'.

    Raises:
        TableError: tables of different machines, or joint commands in one and not in another.
    """
    _check_same_machine(parts)
    offsets = np.cumsum([0, *(len(part["run_label"]) for part in parts)])
    labels = [_label(part, label) for part in parts for label in part["run_label"]]
    files = [part["files"] or (part["source"],) for part in parts]
    firsts = np.cumsum([0, *map(len, files)]).tolist()
    fields = {name: _join(parts, name) for name in parts[0] if name not in _KEPT}
    understood = [part["understood"] for part in parts]
    return fields | {
        "run": np.concatenate([part["run"] + offset for part, offset in zip(parts, offsets, strict=False)]),
        "run_label": tuple(_distinct(labels)),
        "run_sha256": tuple(
            digest for part in parts for digest in part["run_sha256"] or ("",) * len(part["run_label"])
        ),
        "files": tuple(name for names in files for name in names),
        "run_file": tuple(
            first + index
            for part, first in zip(parts, firsts, strict=False)
            for index in part["run_file"] or (0,) * len(part["run_label"])
        ),
        "source": " + ".join(part["source"] for part in parts),
        "joint_prefix": parts[0]["joint_prefix"],
        "extra": _join_extra(parts),
        "watched": tuple(dict.fromkeys(title for part in parts for title in part["watched"])),
        "understood": Understood(
            tuple(line for each in understood for line in each.lines),
            tuple(dict.fromkeys(title for each in understood for title in each.ignored)),
            understood[0].mapping,
        ),
    }


def _check_same_machine(parts: Sequence[Dictionary[str, Any]]) -> None:
    first = parts[0]
    for part in parts[1:]:
        if (part["command"] is None) != (first["command"] is None):
            without = first["source"] if first["command"] is None else part["source"]
            raise TableError(
                "no joint commands while the other files have them",
                where=without,
                fix="add them, or remove them from the other files",
            )
        widths = [None if each["command"] is None else each["command"].shape[1] for each in (first, part)]
        if widths[0] != widths[1] or part["joint_prefix"] != first["joint_prefix"]:
            raise TableError("joint commands of another machine", where=part["source"], fix="read it separately")


def _join(parts: Sequence[Dictionary[str, Any]], name: str) -> np.ndarray | None:
    arrays = [part[name] for part in parts]
    shape = next((array.shape[1:] for array in arrays if array is not None), None)
    if shape is None:
        return None
    rows = [len(part["line"]) for part in parts]
    blocks = [np.full((n, *shape), np.nan) if a is None else a for a, n in zip(arrays, rows, strict=True)]
    return np.concatenate(blocks)


def _join_extra(parts: Sequence[Dictionary[str, Any]]) -> dict[str, np.ndarray]:
    titles = dict.fromkeys(title for part in parts for title in part["extra"])
    return {
        title: np.concatenate([part["extra"].get(title, np.full(len(part["line"]), "")) for part in parts])
        for title in titles
    }


def _label(part: Dictionary[str, Any], run: str) -> str:
    if part["files"]:  # joined before: its labels name their files already
        return run
    source = part["source"]
    return f"{source}:{run}" if run else source


def _distinct(labels: list[str]) -> list[str]:
    """Labels made distinct, so that a file given twice stays two runs, also when written."""
    seen: dict[str, int] = {}
    distinct = []
    for label in labels:
        seen[label] = seen.get(label, 0) + 1
        distinct.append(label if seen[label] == 1 else f"{label}#{seen[label]}")
    return distinct
