"""Pairing of an export that holds readings only with the file of its targets."""

import re
from collections import Counter
from dataclasses import replace

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.beside import rows_beside
from ptt.run.readers.alignment import align_names
from ptt.run.readers.export import Export, Request
from ptt.run.readers.mapping import Understood, answer

NAME, NUMBER, ORDER = "name", "number", "order"
_SHOWN = 8
_MOST_OPEN = 0.1  # share of ambiguous readings above which the files are taken to be in different orders
_MOST_BACK = 0.3  # share of steps back in the list: a repeated list has one per repeat, a random order half
_LOAD = ("payload", "feed")
# Columns of targets, beside their commands, that fill poses without reading; their time is not the tracker's
_SET = (*_LOAD, "temp", "role", "run")


def pair_targets(export: Export, targets: Export, request: Request) -> Export:
    """Give every reading its target: by name, by number where the ids count the targets, else in order.

    The result has the rows of the targets in their order, which is the travel order; a target without reading keeps its
    place with empty readings, and one that was read twice has two rows. Where targets were measured more often than
    they are listed, and in another order, the rows are the readings in theirs instead.

    Args:
        export: readings.
        targets: targets or commands, and what else that file knows of each row.
        request: known answers and who to ask.

    Returns:
        One export with the columns of both (those of the export where both have one), gaps and unmatched rows among
        the findings.

    Raises:
        TableError: no row matches, or it cannot be known which readings are missing.
    """
    way = request.mapping.pairing or _way(export, targets, request)
    _check_way(way, export, targets)
    reading_of, order, note = {NAME: _by_name, NUMBER: _by_number, ORDER: _by_order}[way](export, targets)
    if (reading_of < 0).all():
        raise TableError(
            f"no reading belongs to a target of {targets.source}",
            where=export.source,
            fix="use the same names in both files, or none in the targets to pair in order",
        )
    joined = _join(export, targets, reading_of, order)
    findings = [note, *_nameless(way, export, targets), *_gaps(export, targets, reading_of, order)]
    mapping = replace(export.understood.mapping, pairing=way, targets=targets.understood.mapping)
    lines = (*export.understood.lines, *targets.understood.lines, *findings)
    ignored = tuple(dict.fromkeys((*export.understood.ignored, *targets.understood.ignored)))
    return replace(joined, understood=Understood(lines, ignored, mapping))


def _nameless(way: str, export: Export, targets: Export) -> list[str]:
    """A warning where both files have names, none in common, and the order alone says what belongs together."""
    names = [next(filter(None, each.columns.get("name", np.array([""]))), "") for each in (export, targets)]
    if way != ORDER or not all(names):
        return []
    listed = " and ".join(f"'{shown(name)}'" for name in names)
    return [f"warning: no reading has the name of a target (they begin with {listed}): paired by their order alone"]


def _check_way(way: str, export: Export, targets: Export) -> None:
    """An answer from the mapping must suit the files."""
    names = export.columns.get("name")
    if way == NAME and (names is None or "name" not in targets.columns):
        raise TableError("cannot pair by name", where=export.source, fix="both files need a column name")
    if way == NUMBER and (names is None or not _counts_targets(names, targets.n)):
        raise TableError(
            f"ids are not rising row numbers of the {targets.n} targets",
            where=export.source,
            fix="pair by name or in order",
        )


def _way(export: Export, targets: Export, request: Request) -> str:
    names, wanted = export.columns.get("name"), targets.columns.get("name")
    if names is not None and wanted is not None and _matches(names, wanted):
        return NAME
    if wanted is None and names is not None and _counts_targets(names, targets.n):
        return NUMBER
    if export.n == targets.n:
        return ORDER
    question = f"{export.n} readings for {targets.n} targets and no names in common; which readings belong together?"
    if export.n > targets.n:
        raise TableError(question, where=export.source, fix="name the points alike in both files")
    return answer(question, (ORDER,), request.ask, export.source, "pairing")


def _matches(names: np.ndarray, wanted: np.ndarray) -> bool:
    return bool((set(_comparable(names.tolist(), wanted.tolist())) & set(wanted.tolist())) - {""})


def _comparable(names: list[str], wanted: list[str]) -> list[str]:
    """Names as the targets spell them: without their group where no full name is listed."""
    return names if set(names) & set(wanted) - {""} else [re.split(r"/|::", name)[-1] for name in names]


def _counts_targets(names: np.ndarray, n: int) -> bool:
    """Whether ids are row numbers of the targets: whole, rising, from 1 to at most n; gaps are poses not measured."""
    if not all(re.fullmatch(r"[0-9]{1,18}", name) for name in names.tolist()):
        return False
    numbers = names.astype(np.int64)
    return bool((np.diff(numbers) > 0).all() and numbers[0] >= 1 and numbers[-1] <= n)


def _by_name(export: Export, targets: Export) -> tuple[np.ndarray, np.ndarray, str]:
    """Pair by name: with the only target of that name, k-th with k-th, or by alignment where a reading is missing."""
    wanted = targets.columns["name"].tolist()
    names = np.array(_comparable(export.columns["name"].tolist(), wanted), dtype=object)
    target_of = _targets_of(names.tolist(), wanted, export, targets)
    if _mixes_visits(target_of, targets):
        timed = _by_clock(export)
        target_of[timed] = _targets_of(names[timed].tolist(), wanted, export, targets)
        if _mixes_visits(target_of[timed], targets):
            raise _disordered(target_of, export, targets)
    paired = target_of[target_of >= 0]
    rows = np.flatnonzero(target_of >= 0)
    if len(set(paired.tolist())) < len(paired) and (np.diff(paired) < 0).any():
        return rows, paired, "paired by name, in the order of the readings"
    missed = np.setdiff1d(np.arange(targets.n), paired)
    order = np.concatenate([paired, missed])
    reading_of = np.concatenate([rows, np.full(len(missed), -1)])
    by_target = np.argsort(order, kind="stable")
    return reading_of[by_target], order[by_target], "paired by name, in the order of the targets"


def _targets_of(names: list[str], wanted: list[str], export: Export, targets: Export) -> np.ndarray:
    """Index of the target of each reading, (n,), -1 where there is none or it is not certain."""
    count, listed = Counter(names), Counter(wanted)
    index_of = {key: index for index, key in enumerate(_numbered(wanted)) if key[0]}
    target_of = np.array(
        [index_of.get((name, 0 if listed[name] == 1 else k), -1) for name, k in _numbered(names)], dtype=np.int64
    )
    uneven = np.array([bool(name) and listed[name] > 1 and count[name] != listed[name] for name in names])
    if not uneven.any():
        return target_of
    code = {name: number for number, name in enumerate(dict.fromkeys(wanted)) if name}
    own, theirs = (np.array([code.get(name, none) for name in each]) for each, none in ((names, -1), (wanted, -2)))
    aligned, open_ = align_names(own, theirs, _places(targets), export.source)
    unsure = np.flatnonzero(uneven & (open_ | (aligned < 0)))
    if len(unsure) > _MOST_OPEN * len(names):
        name = names[unsure[0]]
        raise TableError(
            f"'{shown(name)}' was read {count[name]} times and is listed {listed[name]} times; which reading belongs "
            "to which is not certain",
            where=f"{export.source} row {export.line[unsure[0]]}",
            fix="give the readings in the order of the targets, and a row with the name alone where one is missing",
        )
    return np.where(uneven, aligned, target_of)


def _by_clock(export: Export) -> np.ndarray:
    """The readings as they were taken, (n,) int: by their clock where all have one, else as listed."""
    time = export.columns.get("time", np.full(export.n, np.nan))
    return np.argsort(time, kind="stable") if np.isfinite(time).all() else np.arange(export.n)


def _visited_again(target_of: np.ndarray, targets: Export) -> np.ndarray:
    """Indices of readings of positions visited more than once, whose visit only the order tells, (m,) int."""
    listed, rows = targets.columns["name"], np.flatnonzero(target_of >= 0)
    visits = Counter(name for name, _ in set(zip(listed.tolist(), _places(targets).tolist(), strict=True)))
    return rows[np.array([visits[name] > 1 for name in listed[target_of[rows]].tolist()], dtype=bool)]


def _mixes_visits(target_of: np.ndarray, targets: Export) -> bool:
    """Whether readings are in another order than the targets and positions are visited more than once (ambiguous).

    A repeated list goes back to its first target, or to the first that was read; a random order goes back at every
    second step.

    Args:
        target_of: target of each reading in some order, (n,) int; -1 where there is none.
        targets: the targets.
    """
    paired = target_of[target_of >= 0]
    if not len(_visited_again(target_of, targets)):
        return False
    back = (np.diff(paired) < 0) & (paired[1:] > paired.min())
    return bool(back.sum() > _MOST_BACK * len(back))


def _disordered(target_of: np.ndarray, export: Export, targets: Export) -> TableError:
    row = _visited_again(target_of, targets)[0]
    return TableError(
        f"'{shown(export.columns['name'][row])}' is listed more than once, and the readings are in another order "
        "than the targets; which reading belongs to which is not certain",
        where=f"{export.source} row {export.line[row]}",
        fix="give the readings in the order of the targets, or the time of each in a column time_s",
    )


def _places(targets: Export) -> np.ndarray:
    """Index of each target's group of consecutive targets with equal name, position and load, (m,) int."""
    columns = [values for title, values in targets.columns.items() if title.endswith("_cmd") or title in _LOAD]
    keys = np.column_stack([np.unique(targets.columns["name"], return_inverse=True)[1], *columns])
    return np.cumsum(np.append(True, (np.diff(np.nan_to_num(keys), axis=0) != 0.0).any(axis=1))) - 1


def _numbered(names: list[str]) -> list[tuple[str, int]]:
    seen: Counter[str] = Counter()
    keys = []
    for name in names:
        keys.append((name, seen[name]))
        seen[name] += 1
    return keys


def _by_number(export: Export, targets: Export) -> tuple[np.ndarray, np.ndarray, str]:
    reading_of = np.full(targets.n, -1, dtype=np.int64)
    reading_of[export.columns["name"].astype(np.int64) - 1] = np.arange(export.n)
    return reading_of, np.arange(targets.n), "paired by number: the ids are row numbers of the targets"


def _by_order(export: Export, targets: Export) -> tuple[np.ndarray, np.ndarray, str]:
    reading_of = np.arange(targets.n)
    reading_of[export.n :] = -1
    return reading_of, np.arange(targets.n), "paired in order"


def _join(export: Export, targets: Export, reading_of: np.ndarray, order: np.ndarray) -> Export:
    columns = {quantity: values[order] for quantity, values in targets.columns.items()}
    for quantity, values in export.columns.items():
        if quantity != "name" or "name" not in columns:
            picked, known = _picked(values, reading_of), columns.get(quantity) if _is_set(quantity) else None
            if quantity == "run" and known is None:  # the machine went there in between
                known = picked[rows_beside(reading_of >= 0)]
            columns[quantity] = picked if known is None else np.where(reading_of < 0, known, picked)
    extra = {title: values[order] for title, values in targets.extra.items()}
    extra |= {title: _picked(values, reading_of) for title, values in export.extra.items()}
    line = np.where(reading_of >= 0, export.line[reading_of], targets.line[order])
    return Export(export.source, columns, extra, line, export.understood)


def _is_set(quantity: str) -> bool:
    return quantity in _SET or quantity.endswith("_cmd")


def _picked(values: np.ndarray, reading_of: np.ndarray) -> np.ndarray:
    """Values of the readings, empty where a target has none."""
    picked = values[reading_of]
    picked[reading_of < 0] = np.nan if values.dtype.kind == "f" else ""
    return picked


def _gaps(export: Export, targets: Export, reading_of: np.ndarray, order: np.ndarray) -> list[str]:
    missed = np.setdiff1d(np.arange(targets.n), order[reading_of >= 0])
    unmatched = np.setdiff1d(np.arange(export.n), reading_of[reading_of >= 0])
    found = []
    if missed.size:
        found.append(f"{_counted(missed.size, 'target')} without reading: {_listed(targets, missed)}")
    if unmatched.size:
        found.append(f"{_counted(unmatched.size, 'reading')} without target, left out: {_listed(export, unmatched)}")
    return found


def _listed(export: Export, rows: np.ndarray) -> str:
    names = export.columns.get("name", np.full(export.n, ""))
    shown = [f"row {export.line[row]} {names[row]}".strip() for row in rows[:_SHOWN]]
    return ", ".join(shown) + (f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else "")


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
