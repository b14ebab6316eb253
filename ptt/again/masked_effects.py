"""Masked effects: those that a model's own run could hardly tell from the model's, tested on both runs together."""

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

MASKED_PREFIX = "then already: "


@dataclass(frozen=True)
class MaskedEffect:
    """An effect that a model does not have, with what the model's own run says of its m values.

    Attributes:
        effect: the effect.
        absorbed: decrease of the model's w values per unit of its own, (w, m) in usual sizes.
        seen: its columns of `ptt.fitting.masked.Masked.seen`, (p, m).
    """

    effect: Effect
    absorbed: np.ndarray
    seen: np.ndarray

    @property
    def key(self) -> str:
        """Key of its atom."""
        return f"{MASKED_PREFIX}{self.effect.key}"


@dataclass(frozen=True)
class MaskedEffects:
    """The masked effects of a model, p values in all.

    Attributes:
        each: the effects.
        said: right-hand side of the model's own run: sum of seen @ values = said, with unit errors, (p,).
    """

    each: tuple[MaskedEffect, ...] = ()
    said: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def width(self) -> int:
        """Number of values of the effects in `each`."""
        return sum(masked.seen.shape[1] for masked in self.each)

    def columns(self, at: LinearPoint, own: np.ndarray, gone: np.ndarray) -> np.ndarray:
        """Shift of the readings per unit of each effect, less the part that the model's values absorbed, (n, 3, p).

        Args:
            at: where the model is linearised.
            own: columns of the model's values, (n, 3, w) whitened.
            gone: values of cured effects, (w,) bool: these have absorbed nothing that is still there.
        """
        parts = (
            at.columns(masked.effect, {}) - own @ np.where(gone[:, None], 0.0, masked.absorbed) for masked in self.each
        )
        return np.concatenate([np.zeros((*own.shape[:2], 0)), *parts], axis=2)

    def readings(self) -> tuple[np.ndarray, np.ndarray]:
        """Equations of the model's own run as pseudo-readings of unit error, three to a row, (r, 3, p) and (r, 3)."""
        count = -(-len(self.said) // 3)
        columns, values = np.zeros((3 * count, self.width)), np.zeros(3 * count)
        values[: len(self.said)] = self.said
        if self.each:
            columns[: len(self.said)] = np.concatenate([masked.seen for masked in self.each], axis=1)
        return columns.reshape(count, 3, self.width), values.reshape(count, 3)


def read_masked_effects(kept: Kept | None, names: Sequence[str], view: View) -> MaskedEffects:
    """Read the masked effects from a model's file.

    Args:
        kept: covariance and masked effects of the file; None where it has none.
        names: of the model's values, (w,).
        view: the new run.

    Returns:
        Those that the new run can test.
    """
    own = [] if kept is None else [name for name in kept.names if name not in (*FRAME_NAMES, *MOUNT_NAMES)]
    masked = None if kept is None or kept.masked is None else read_masked(kept.masked, len(own))
    if masked is None:
        return MaskedEffects()
    known, found, first = library(), list[MaskedEffect](), 0
    effects = [known[key]() for key in masked.keys if key in known]
    sizes = [linear_size(effect, view.joints) for effect in effects]
    if len(effects) < len(masked.keys) or sum(sizes) != len(masked.said):  # written with another library
        return MaskedEffects()
    rows = rows_by_name(own, names)
    absorbed = np.where(rows[:, None] >= 0, masked.absorbed[rows], 0.0)
    for effect, size in zip(effects, sizes, strict=True):
        if not effect.needs(view):
            found.append(MaskedEffect(effect, absorbed[:, first : first + size], masked.seen[:, first : first + size]))
        first += size
    return MaskedEffects(tuple(found), masked.said)


def masked_atoms(masked_effects: MaskedEffects, first: int) -> dict[str, Atom]:
    """Atoms of masked effects, as likely as new ones.

    Args:
        masked_effects: the effects.
        first: index of the first column in the linear problem.

    Returns:
        The atoms by key.
    """
    return side_by_side(
        [(masked.key, masked.effect, masked.seen.shape[1]) for masked in masked_effects.each],
        EFFECT_ODDS,
        len(library()),
        first,
    )
