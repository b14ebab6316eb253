"""Isolated impossible values: typing errors, a sensor that dropped out."""

from collections.abc import Iterator

import numpy as np

from ptt.machine import ThreePttSpec
from ptt.setup.columns import HOTTEST, fastest, heaviest, said
from ptt.setup.result import Finding
from ptt.setup.score import forward_many
from ptt.setup.setup import Setup, used_rows

MOST_STRAY = 0.05  # of the rows: where more are off, the column is in another unit
APART = (
    0.5  # of the limit: least gap between a stray value and all others; values that grow steadily are no typing error
)
OFF, BEYOND = 20.0, 100.0  # mm, and times the median: distance of target and command that no correction causes
SHOWN_ROWS = 5  # named in a message


def find_stray(setup: Setup) -> tuple[list[Finding], Setup]:
    """Impossible temperatures, payloads and feeds in a few rows, with plausible ones in all others.

    Args:
        setup: both files.

    Returns:
        Findings, and the files with those cells empty.
    """
    findings, spec = [], setup.file.machine
    limits = (
        ("temp_c", "deg C", HOTTEST),
        ("payload_kg", "kg", heaviest(spec)),
        ("feed_mm_s", "mm/s", fastest(spec)),
    )
    for title, unit, limit in limits:
        values = getattr(setup.table, title)
        stray = np.zeros(0, dtype=bool) if values is None else _beyond(np.asarray(values, dtype=float), limit)
        if not stray.any():
            continue
        others = values[~stray & np.isfinite(values)]
        words = (
            f"{title} is {', '.join(f'{value:,.6g}' for value in values[stray][:SHOWN_ROWS])} in {_rows(setup, stray)},"
            f" and {others.min():.6g} to {others.max():.6g} in all others; up to {limit:,.0f} {unit} is plausible"
        )
        findings.append(said(setup, "stray-value", words, "correct it, or leave the cell empty"))
        setup = setup.with_rows(**{title: np.where(stray, np.nan, values)})
    return findings, setup


def find_far_targets(setup: Setup) -> tuple[list[Finding], Setup]:
    """Targets of a few rows far from where their commands put the tool, with all others close.

    Args:
        setup: both files of a 3-PTT, the geometry in order.

    Returns:
        At most one finding, and the files with those targets replaced by the positions of their commands.
    """
    assert isinstance(setup.file.machine, ThreePttSpec)
    place, target = forward_many([setup])[0], setup.table.target
    off = np.linalg.norm(target - place, axis=1)
    known = np.isfinite(off) & used_rows(setup.table)
    far = known & (np.nan_to_num(off) > OFF)
    if not far.any() or far.sum() > _few(known) or any((far | ~known)[rows].all() for rows in _runs_of(setup, far)):
        return [], setup
    if off[far].min() < BEYOND * np.median(off[known]):
        return [], setup
    words = (
        f"the target of {_rows(setup, far)} lies {off[far].max():,.0f} mm from where its commands put the tool, all "
        f"others within {off[known & ~far].max():.2g} mm"
    )
    finding = said(setup, "stray-value", words, "correct x_cmd, y_cmd, z_cmd or the joint commands there")
    return [finding], setup.with_rows(target=np.where(far[:, None], place, target))


def _beyond(values: np.ndarray, limit: float) -> np.ndarray:
    """Values (n,) beyond a limit where they are few and far from all others, (n,) bool."""
    size, known = np.abs(np.nan_to_num(values)), np.isfinite(values)
    stray = known & (size > limit)
    if not 0 < stray.sum() <= _few(known) or size[stray].min() - size[known & ~stray].max() < APART * limit:
        return np.zeros(len(values), dtype=bool)
    return stray


def _few(known: np.ndarray) -> int:
    """Largest number of stray rows among the known ones; 0 where too few are known to compare with."""
    return int(np.ceil(MOST_STRAY * known.sum())) if known.sum() >= 1.0 / MOST_STRAY else 0


def _runs_of(setup: Setup, rows: np.ndarray) -> Iterator[np.ndarray]:
    """Which rows belong to each run that some of the given ones are in, (n,) bool."""
    return (setup.table.run == run for run in np.unique(setup.table.run[rows]))


def _rows(setup: Setup, rows: np.ndarray) -> str:
    lines = [str(line) for line in setup.table.line[rows]]
    more = f" and {len(lines) - SHOWN_ROWS} more" if len(lines) > SHOWN_ROWS else ""
    return f"row{'s' if len(lines) > 1 else ''} {', '.join(lines[:SHOWN_ROWS])}{more}"
