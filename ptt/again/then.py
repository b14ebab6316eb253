"""Effects that a model's own run may have had without showing them: told of both runs together."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ptt.again.atoms import side_by_side
from ptt.diagnosis.evidence.atoms import EFFECT_ODDS, Atom
from ptt.effects import Effect, library
from ptt.effects.layout import linear_size
from ptt.fitting.kept import Kept, rows_by_name
from ptt.fitting.layout import FRAME_NAMES, MOUNT_NAMES
from ptt.fitting.linear import LinearPoint
from ptt.fitting.masked import read_masked
from ptt.run.view import View

THEN = "then already: "


@dataclass(frozen=True)
class Then:
    """An effect that a model does not have, as its run leaves room for it.

    Attributes:
        effect: the effect.
        absorbed: (w, m) by how much the model's values would be less for each unit of it, in usual sizes.
        seen: (p, m) its part of the root of what the run knows of all such effects.
    """

    effect: Effect
    absorbed: np.ndarray
    seen: np.ndarray

    @property
    def key(self) -> str:
        """Of its atom."""
        return f"{THEN}{self.effect.key}"


@dataclass(frozen=True)
class Rooms:
    """All such effects.

    Attributes:
        each: the effects.
        said: (p,) what the run said of them: sum of seen @ values, with unit errors.
    """

    each: tuple[Then, ...] = ()
    said: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def width(self) -> int:
        """Number of their values."""
        return sum(room.seen.shape[1] for room in self.each)

    def columns(self, at: LinearPoint, own: np.ndarray, gone: np.ndarray) -> np.ndarray:
        """What each adds to the readings less what the model's values have of it already, (n, 3, p) whitened.

        Args:
            at: where columns come from.
            own: (n, 3, w) columns of the model's values.
            gone: (w,) bool, values that are zero now whatever they were.
        """
        parts = (at.columns(room.effect, {}) - own @ np.where(gone[:, None], 0.0, room.absorbed) for room in self.each)
        return np.concatenate([np.zeros((*own.shape[:2], 0)), *parts], axis=2)

    def readings(self) -> tuple[np.ndarray, np.ndarray]:
        """What the model's run said, as readings of unit error three to a row, (r, 3, p) and (r, 3)."""
        count = -(-len(self.said) // 3)
        columns, values = np.zeros((3 * count, self.width)), np.zeros(3 * count)
        values[: len(self.said)] = self.said
        if self.each:
            columns[: len(self.said)] = np.concatenate([room.seen for room in self.each], axis=1)
        return columns.reshape(count, 3, self.width), values.reshape(count, 3)


def rooms_of(kept: Kept | None, names: Sequence[str], view: View) -> Rooms:
    """What a model's file keeps of effects that the model does not have.

    Args:
        kept: of the file; None where it keeps nothing.
        names: of the model's values, (w,).
        view: of the new run.

    Returns:
        Those that the new run can judge as well.
    """
    own = [] if kept is None else [name for name in kept.names if name not in (*FRAME_NAMES, *MOUNT_NAMES)]
    masked = None if kept is None or kept.masked is None else read_masked(kept.masked, len(own))
    if masked is None:
        return Rooms()
    known, found, first = library(), list[Then](), 0
    effects = [known[key]() for key in masked.keys if key in known]
    sizes = [linear_size(effect, view.joints) for effect in effects]
    if len(effects) < len(masked.keys) or sum(sizes) != len(masked.said):  # of another program's library
        return Rooms()
    rows = rows_by_name(own, names)
    absorbed = np.where(rows[:, None] >= 0, masked.absorbed[rows], 0.0)
    for effect, size in zip(effects, sizes, strict=True):
        if not effect.needs(view):
            found.append(Then(effect, absorbed[:, first : first + size], masked.seen[:, first : first + size]))
        first += size
    return Rooms(tuple(found), masked.said)


def atoms_then(rooms: Rooms, first: int) -> dict[str, Atom]:
    """These effects as hypotheses beside others, as likely as one that is new.

    Args:
        rooms: the effects.
        first: place of the first column.

    Returns:
        The atoms by key.
    """
    return side_by_side(
        [(room.key, room.effect, room.seen.shape[1]) for room in rooms.each], EFFECT_ODDS, len(library()), first
    )
