"""Protection of existing files from being overwritten; imports nothing heavy."""

import csv
from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from ptt.errors import InputError

if TYPE_CHECKING:
    import numpy as np

HEAD = 8192  # bytes of a file that hold its titles
OWN = (b"reversal1", b"in_domain", b"shift_um")  # titles that `ptt predict` puts behind those of its targets


def refuse_readings(out: Path, copied: Iterable["np.ndarray"] = ()) -> None:
    """Refuse to overwrite a tracker run by targets or commands.

    Args:
        out: the file about to be written; an earlier list of targets or commands may be replaced.
        copied: readings in the targets whose commands are written, (m, 3) mm in parts: earlier commands with the same
            readings may be replaced, since these are only a copy.

    Raises:
        InputError: a file of that name has a column x_meas, with other readings.
    """
    if b"x_meas" not in _head(out) or (is_commands(out) and _are_copied(out, copied)):
        return
    raise InputError("holds readings; nothing was written", where=str(out), fix="name another file")


def is_commands(out: Path) -> bool:
    """Whether a file has the titles of commands that `ptt predict` wrote."""
    head = _head(out)
    return all(title in head for title in OWN)


def _head(out: Path) -> bytes:
    if not out.is_file():
        return b""
    with out.open("rb") as file:
        return file.read(HEAD).replace(b"\0", b"").lower()  # without the zeros, UTF-16 too shows its titles


def _are_copied(out: Path, copied: Iterable["np.ndarray"]) -> bool:
    """Whether the readings in a file are those of some targets, row by row to the last digit."""
    import numpy as np

    with out.open(newline="", encoding="utf-8") as file:
        try:
            rows = csv.reader(file)
            titles = next(rows)
            places = [titles.index(title) for title in ("x_meas", "y_meas", "z_meas")]
            for part in copied:
                held = [[float(row[place] or "nan") for place in places] for row in islice(rows, len(part))]
                if not np.array_equal(np.reshape(held, (-1, 3)), part, equal_nan=True):
                    return False
            return next(rows, None) is None
        except (ValueError, IndexError, csv.Error):  # it is not as `ptt predict` wrote it
            return False
