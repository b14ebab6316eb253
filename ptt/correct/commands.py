"""Commands for the machine as a result: what to send, what not and why."""

from dataclasses import dataclass, fields, replace

import numpy as np

OK, UNCERTAIN = "ok", "uncertain"
OUT_OF_REACH, OUT_OF_TRAVEL, NEAR_SINGULAR, TOO_LARGE = "out of reach", "out of travel", "near singular", "too large"
NOTE = "reversal_note"  # the one thing that commands have that is not of a row
ROUNDING = 1e-3  # mm: commands that miss by less miss by nothing that a machine could do
NO_TARGET = ""  # a row of a base reflector, at which the machine stands
STATUSES = (OK, UNCERTAIN, TOO_LARGE, NEAR_SINGULAR, OUT_OF_TRAVEL, OUT_OF_REACH)


@dataclass(frozen=True)
class Commands:
    """What to send, and what not.

    Attributes:
        q: joint commands, everything included, (n, k) mm or rad; NaN where nothing is to be sent.
        reversal: the part of them that is reversal compensation, (n, k); NaN where nothing is to be sent.
        status: one of `STATUSES`, (n,); only 'ok' and 'uncertain' are sent. Empty in rows that are no targets.
        in_domain: rows inside the training domain of the network, all True without one, (n,) bool.
        shift: how far the commands ask the drawing to go from the target, reversal left aside, (n,) mm; NaN where no
            command was found.
        first_order: the same commands by H_m(b - db) = f(p) - J_a dp, (n, k); NaN where nothing is to be sent.
        first_order_gap: how far apart the two put the tool, (n,) mm; NaN where nothing is to be sent.
        reversal_note: who compensates what at a reversal, in words.
        missed: by how much the model's tool misses what it was asked for, (n,) mm; more than rounding only where
            reversal effects leave a step that no command can take; NaN where nothing is to be sent.
        nearest: for rows that are not sent, the corrected command of the last place that works on the straight way
            from the nearest target that is sent, (n, k); NaN elsewhere, and where not even that works.
        nearest_gap: how far that place is from the target, (n,) mm.
        sigma: what parameters and network leave uncertain of where the tool will be, (n,) mm; NaN where nothing tells.
        approach: what of that hangs on from which side the joints came to the first row, (n,) mm.
    """

    q: np.ndarray
    reversal: np.ndarray
    status: np.ndarray
    in_domain: np.ndarray
    shift: np.ndarray
    first_order: np.ndarray
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
    """The same commands with nothing said of some rows, which are no targets.

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
    """Say which rows their status lets be sent.

    Args:
        status: (n,), of `STATUSES`.

    Returns:
        (n,) bool.
    """
    return np.asarray((status == OK) | (status == UNCERTAIN))
