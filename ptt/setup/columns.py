"""What the checks of single columns share: a finding of one column, and what undoes it."""

import numpy as np

from ptt.setup.names import Mistake
from ptt.setup.result import Finding
from ptt.setup.setup import Setup, Undo

Result = tuple[Finding, Undo | None]


def known(values: np.ndarray | None) -> np.ndarray:
    """Values of a column that are there."""
    return np.zeros(0) if values is None else np.asarray(values, dtype=float)[np.isfinite(values)]


def said(setup: Setup, mistake: Mistake, words: str, fix: str, sure: bool = True) -> Finding:
    """A finding whose proof is no error of the tool."""
    return Finding(mistake, words, fix, None, None, sure, setup.table.source)


def shifted(field: str, factor: float, offset: float) -> Undo:
    """A column times a factor plus an offset."""
    return lambda setup: setup.with_rows(**{field: np.asarray(getattr(setup.table, field)) * factor + offset})
