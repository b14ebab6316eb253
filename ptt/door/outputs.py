"""What may be written where; loads nothing heavy."""

from pathlib import Path

from ptt.errors import InputError


def refuse_readings(out: Path) -> None:
    """Refuse to write targets or commands over a tracker run, which nothing brings back.

    Args:
        out: the file about to be written; an earlier list of targets or commands may be replaced.

    Raises:
        InputError: a file of that name has a column x_meas.
    """
    if not out.is_file():
        return
    with out.open("rb") as file:
        head = file.read(8192).replace(b"\0", b"").lower()  # without the zeros, UTF-16 too shows its titles
    if b"x_meas" in head:
        raise InputError("holds readings; nothing was written", where=str(out), fix="name another file")
