"""Commands for the machine as a result: what to send, and the status of every row."""

from dataclasses import dataclass, fields, replace

import numpy as np

from ptt.mechanisms.workspace import NEAR_SINGULAR, OK, OUT_OF_REACH, OUT_OF_TRAVEL

UNCERTAIN, TOO_LARGE = "uncertain", "too large"
NOTE = "reversal_note"  # the one attribute that has no entry for each row
ROUNDING = 1e-3  # mm: a smaller miss is below the resolution of any machine
NO_TARGET = ""  # status of a row of a base reflector, at which the machine stands
STATUSES = (OK, UNCERTAIN, TOO_LARGE, NEAR_SINGULAR, OUT_OF_TRAVEL, OUT_OF_REACH)


@dataclass(frozen=True)
class Commands:
    """What to send, and what not.

    Attributes:
        q: joint commands, everything included, (n, k) mm or rad; NaN where nothing is to be sent.
        reversal: the part of them that is reversal compensation, (n, k); NaN where nothing is to be sent.
        status: one of `STATUSES`, (n,); only 'ok' and 'uncertain' are sent. Empty in rows that are no targets.
        in_domain: rows inside the training domain of the network, all True without one, (n,) bool.
        shift: size of the correction, reversal left aside: distance of the commands' nominal position from the target,
            (n,) mm; NaN where no command was found.
        first_order_gap: distance of the nominal position of the commands by the first-order form
            H_m(b - db) = f(p) - J_a dp from that of the exact ones, (n,) mm; NaN where nothing is to be sent.
        reversal_note: which reversal effects are in the commands and which are left to the controller, in words.
        missed: distance of the model's tool from what it was asked for, (n,) mm; more than rounding only where
            reversal effects leave a step that no command can make; NaN where nothing is to be sent.
        nearest: for rows that are not sent, the corrected command of the last position that can be reached on the line
            from the nearest target that is sent, (n, k); NaN elsewhere, and where there is none.
        nearest_gap: distance of that position from the target, (n,) mm.
        sigma: standard deviation of the tool position that parameters and network leave, (n,) mm; NaN where unknown.
        approach: the part of it that is due to the unknown side from which joints came to the first row, (n,) mm.
    """

    q: np.ndarray
    reversal: np.ndarray
    status: np.ndarray
    in_domain: np.ndarray
    shift: np.ndarray
    first_order_gap: np.ndarray
    reversal_note: str
    missed: np.ndarray
    nearest: np.ndarray
    nearest_gap: np.ndarray
    sigma: np.ndarray
    approach: np.ndarray

    @property
    def sent(self) -> np.ndarray:
        """Rows with a command to send, (n,) bool."""
        return sent_rows(self.status)

    @property
    def targets(self) -> np.ndarray:
        """Rows that are targets, (n,) bool: all but those of base reflectors."""
        return np.asarray(self.status != NO_TARGET)

    @property
    def counts(self) -> dict[str, int]:
        """How many rows have each status."""
        return {status: int((self.status == status).sum()) for status in STATUSES}


def without(commands: Commands, rows: np.ndarray) -> Commands:
    """The same commands with some rows blanked, which are no targets.

    Args:
        commands: n rows.
        rows: (n,) bool.
    """
    if not rows.any():
        return commands
    blank = {each.name: getattr(commands, each.name).copy() for each in fields(commands) if each.name != NOTE}
    for values in blank.values():
        values[rows] = {"f": np.nan, "b": False}.get(values.dtype.kind, NO_TARGET)
    return replace(commands, **blank)


def sent_rows(status: np.ndarray) -> np.ndarray:
    """Rows whose status allows them to be sent.

    Args:
        status: (n,), of `STATUSES`.

    Returns:
        (n,) bool.
    """
    return np.asarray((status == OK) | (status == UNCERTAIN))
