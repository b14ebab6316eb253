"""Two runs of the same poses, one before and one after a compensation, compared."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial

import numpy as np

from ptt.effects import Library
from ptt.errors import TableError, TooFewError
from ptt.judge.aimed import MISSING, aim, with_frame_of
from ptt.judge.evaluation import Evaluation
from ptt.judge.gross import gross_rows
from ptt.judge.match import match_rows, targets_of
from ptt.judge.run_errors import LEAST_ROWS, Datum, Errors, errors_of, refer_z
from ptt.machine import MachineFile
from ptt.run.same_pose import count_places
from ptt.run.table import Table

SIDES = ("before", "after")


def evaluate_pair(
    before: Table,
    after: Table,
    file: MachineFile | None = None,
    *,
    frame: str | None = None,
    z_datum: Datum = "absolute",
    rows: np.ndarray | None = None,
    known: Library | None = None,
) -> Evaluation:
    """Compare two runs of the same poses, both treated alike.

    Args:
        before: run without compensation.
        after: run with it.
        file: the machine, whose tracker policy counts; None: the best rigid motion for each run.
        frame: policy instead of the machine's.
        z_datum: 'first' refers z errors to the first pose of each run, as the source paper does.
        rows: rows of `before` that count, (n,) bool; None for all. Frames are fitted to all matched rows.
        known: effects by name, which turn an arm's tool; None for the library.

    Returns:
        The evaluation; rows of `after` that state no target are judged against that of their counterpart.

    Raises:
        TableError: no pose in common, or a run that cannot be evaluated.
    """
    file = file and with_frame_of(file, before)
    aimed = aim(before, after, file)
    before, after = runs = aimed.before, aimed.after
    errors_at = partial(errors_of, file=file, frame=frame, known=known)
    whole = [errors_at(table) for table in runs]
    first, second, unmatched = match_rows(before, after, *map(_found, whole))
    if not len(first) or (rows is not None and not rows[first].any()):
        fix = "run both on the same targets, or name the points alike"
        fix += "" if aimed.told.any() else "; AFTER states no targets: " + MISSING
        raise TableError(f"no pose in common with {before.source}", where=after.source, fix=fix)
    wanted = targets_of(before, file)
    _require_poses(before, after, count_places(wanted[first]), frame or (file.tracker.frame if file else "fitted"))
    counted = whole
    if z_datum == "absolute":  # else each run is referred to its own first pose, matched or not
        counted = [
            _of_shared(errors, table, errors_at, own) if unmatched[side] else errors
            for errors, table, own, side in zip(whole, runs, (first, second), SIDES, strict=True)
        ]
    if rows is not None:
        first, second = first[rows[first]], second[rows[first]]
    matched = (first, second)
    gross, sound = _gross(whole, runs, matched)
    protocol = {
        "rows": len(first),
        "poses": count_places(wanted[first]),
        "frame": counted[0].frame,
        "z_datum": z_datum,
        "measured": True,
        "held_out": None,
        "before": before.source,
        "after": after.source,
        "targets_from_before": aimed.lent,
    }
    aligned = _pair([errors.aligned for errors in counted], runs, matched, z_datum)
    raw = _pair([errors.raw for errors in counted], runs, matched, z_datum)
    without = (aligned[0][sound], aligned[1][sound]) if gross and sound.any() else None
    return Evaluation(
        *aligned, protocol, raw, counted[1].noise, unmatched, matched=matched, gross=gross, without=without
    )


def _gross(
    whole: Sequence[Errors], runs: Sequence[Table], matched: Sequence[np.ndarray]
) -> tuple[dict[str, list[int]], np.ndarray]:
    """Gross errors among the matched rows: side -> rows of its table; and which pairs have none, (m,) bool."""
    off = [gross_rows(table, errors.aligned)[own] for table, errors, own in zip(runs, whole, matched, strict=True)]
    gross = {side: own[far].tolist() for side, own, far in zip(SIDES, matched, off, strict=True) if far.any()}
    return gross, ~(off[0] | off[1])


def _pair(
    errors: Sequence[np.ndarray], runs: Sequence[Table], matched: Sequence[np.ndarray], z_datum: Datum
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the matched rows of both runs, (m, 3) mm each, z relative to the datum."""
    one, two = (_refer_z(*each, z_datum) for each in zip(errors, runs, matched, strict=True))
    return one, two


def _of_shared(errors: Errors, table: Table, errors_at: Callable[..., Errors], own: np.ndarray) -> Errors:
    """Errors of a run with its frame fitted to the matched rows alone: the others would turn it.

    Args:
        errors: with the frame fitted to all rows; returned where the matched ones are too few.
        table: the run, n rows.
        errors_at: errors of a table, `rows` of which count.
        own: indices of the matched rows.
    """
    with suppress(TooFewError):  # with a frame for each run, one may have hardly any matched row
        return errors_at(table, rows=np.isin(np.arange(table.rows), own))
    return errors


def _require_poses(before: Table, after: Table, poses: int, policy: str) -> None:
    """Refuse a comparison at fewer poses than a fitted frame needs."""
    if policy in ("fitted", "fitted-per-run") and poses < LEAST_ROWS:
        what = f"only {poses} pose{'' if poses == 1 else 's'} in common with {before.source}"
        fix = f"run both on the same targets: a fitted frame needs {LEAST_ROWS} poses; or give --frame trusted"
        raise TableError(what, where=after.source, fix=fix)


def _found(errors: Errors) -> np.ndarray:
    return np.isfinite(errors.aligned).all(axis=1)


def _refer_z(errors: np.ndarray, table: Table, index: np.ndarray, z_datum: Datum) -> np.ndarray:
    """Errors of rows `index`, (m, 3) mm; with z_datum 'first' less the mean z error of the run's first pose."""
    usable = np.isfinite(errors).all(axis=1) & (table.role == "pose")
    return refer_z(errors, table.target, usable, z_datum)[index]
