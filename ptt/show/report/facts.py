"""What was understood of a run: rows, runs, columns and units, what varied, and repeats."""

from dataclasses import dataclass

import numpy as np

from ptt.record import Record
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem
from ptt.run.repeats import repeat_groups
from ptt.run.table import Table
from ptt.run.written import table_to_frame

LEVELS = 6  # distinct values up to which they are listed one by one
# Names of units in mapping files -> as they are written.
UNITS = {"c": "deg C", "mm_s": "mm/s", "n": "N", "nm": "N m", "um": "um"}
COVARIATES = (  # name, column, unit, and name among what varies in a view
    ("payload", "payload_kg", "kg", "payload"),
    ("temperature", "temp_c", "deg C", "temperature"),
    ("speed (feed)", "feed_mm_s", "mm/s", "speed"),
    ("time", "time_s", "s", "time"),
)


@dataclass(frozen=True)
class Column:
    """A column of the file, what it was taken for, and its unit there ('' where it has none)."""

    title: str
    meaning: str
    unit: str


@dataclass(frozen=True)
class Covariate:
    """A variable besides the pose on which the error may depend.

    Attributes:
        name: 'payload', 'temperature', 'speed (feed)', 'time', 'arrival of slider 1'.
        values: its values in words, with unit; 'not recorded' where the run does not have it.
        varies: whether it varies, so that effects of it can be tested.
    """

    name: str
    values: str
    varies: bool


@dataclass(frozen=True)
class RunFacts(Record):
    """A run as it was understood.

    Attributes:
        rows: number of rows of the file or files.
        observed: number of rows with a complete reading.
        roles: 'pose', 'base', 'datum' -> number of rows.
        runs: label and number of rows of each run.
        poses: number of distinct targets that were read.
        repeats: number of rows that repeat an earlier one (same pose, direction, load and speed).
        low: lowest target coordinates, (3,) mm.
        high: highest target coordinates, (3,) mm.
        columns: of the first file.
        ignored: titles of columns that were not used.
        covariates: variables besides the pose.
        lines: notes of the reader, one finding a line.
    """

    rows: int
    observed: int
    roles: dict[str, int]
    runs: tuple[tuple[str, int], ...]
    poses: int
    repeats: int
    low: tuple[float, ...]
    high: tuple[float, ...]
    columns: tuple[Column, ...]
    ignored: tuple[str, ...]
    covariates: tuple[Covariate, ...]
    lines: tuple[str, ...]


def facts_of(problem: Problem) -> RunFacts:
    """Gather what was understood of a run.

    Args:
        problem: the run and its machine.

    Returns:
        The facts.
    """
    table, used = problem.table, problem.used
    whole = np.isfinite(table.measured).all(axis=1)
    groups = repeat_groups(table, problem.view.direction.numpy())[used]
    target = problem.target[used]
    return RunFacts(
        rows=table.rows,
        observed=int(whole.sum()),
        roles={role: int((table.role == role).sum()) for role in ("pose", "datum", "base")},
        runs=tuple((label, int((table.run == code).sum())) for code, label in enumerate(table.run_label)),
        poses=len(np.unique(pose_groups(table)[used])),
        repeats=int(used.sum() - len(np.unique(groups))),
        low=tuple(target.min(axis=0).tolist()),
        high=tuple(target.max(axis=0).tolist()),
        columns=columns_of_table(table),
        ignored=table.understood.ignored,
        covariates=(*_covariates(problem), *_directions(problem)),
        lines=table.understood.lines,
    )


def columns_of_table(table: Table) -> tuple[Column, ...]:
    """The columns of the first file that were used, with what they were taken for."""
    found = table.understood.mapping
    titles = found.columns or {str(title): str(title) for title in table_to_frame(table).columns}
    joint = "slider" if table.joint_prefix == "b" else "joint"
    return tuple(
        Column(title, _meaning(what, joint), UNITS.get(unit := found.units.get(title, ""), unit))
        for title, what in titles.items()
        if what != "ignore"
    )


def _meaning(what: str, joint: str) -> str:
    """'x_cmd' as 'target x', 'b2_cmd' as 'command of slider 2', 'z_std' as 'scatter of z, as the tracker says'."""
    stem, _, kind = what.partition("_")
    number = stem[-1] if stem[-1:].isdigit() else ""
    if kind.startswith("cmd"):
        return f"command of {joint} {number}" if number else f"target {stem}"
    if kind.startswith("meas"):
        return f"reading {stem}"
    if kind == "std":
        return f"scatter of {stem}, as the tracker says"
    if number and stem[:-1] in ("dir", "tau"):
        return f"{'direction of arrival' if stem.startswith('dir') else 'force or torque'} of {joint} {number}"
    return what.replace("_", " ")


def _covariates(problem: Problem) -> list[Covariate]:
    found = []
    for name, key, unit, word in COVARIATES:
        values = getattr(problem.table, key)
        rows = None if values is None else values[problem.used & np.isfinite(values)]
        if rows is None or not len(rows):
            found.append(Covariate(name, "not recorded", False))
        else:
            found.append(Covariate(name, _spread(rows, unit), word in problem.view.varies))
    return found


def _spread(values: np.ndarray, unit: str) -> str:
    """Values in words: each of a few, else the range."""
    levels = np.unique(values)
    if len(levels) <= LEVELS:
        return f"{', '.join(f'{level:g}' for level in levels)} {unit}"
    return f"{levels[0]:.6g} to {levels[-1]:.6g} {unit}"


def _directions(problem: Problem) -> list[Covariate]:
    serial = problem.file.machine.kind == "serial"
    joint, up, down = ("joint", "forward", "back") if serial else ("slider", "up", "down")
    arrived = problem.view.direction.numpy()[problem.used]
    counts = [(int((ways > 0).sum()), int((ways < 0).sum())) for ways in arrived.T]
    return [
        Covariate(f"arrival of {joint} {number}", f"{plus} {up}, {minus} {down}", bool(plus and minus))
        for number, (plus, minus) in enumerate(counts, 1)
    ]
