"""Sizes of the drawing that a model does not have, and the further uncertainty of its values by them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.effects import Effect, library
from ptt.effects.layout import linear_size
from ptt.fitting.packed import pack, unpack
from ptt.machine_schema import MaskedSpec


@dataclass(frozen=True)
class Unnamed:
    """Sizes of the drawing that a model does not have, beside what it has, in usual sizes.

    Attributes:
        effects: the effects that correct them.
        root: (u + p, r) root of the further covariance, root @ root.T, of the u unknowns of a fit and their own p
            values.
        otherwise: pairs of a fit's effect whose values may as well be quite different, and the size beside which.
    """

    effects: tuple[Effect, ...]
    root: np.ndarray
    otherwise: tuple[tuple[str, str], ...] = ()

    def among(self, rows: Sequence[int], joints: int) -> "Unnamed":
        """The same of some unknowns of the fit alone.

        Args:
            rows: of these.
            joints: number of joints.
        """
        own = range(len(self.root) - _width(self.effects, joints), len(self.root))
        return Unnamed(self.effects, self.root[[*rows, *own]])

    def spec(self) -> MaskedSpec:
        """As a machine file keeps it."""
        keys = tuple(effect.key for effect in self.effects)
        return MaskedSpec(of=keys, told=pack(np.concatenate([[len(self.root)], self.root.ravel()])))


def read_unnamed(spec: MaskedSpec, count: int, joints: int) -> Unnamed | None:
    """From a machine file.

    Args:
        spec: as kept.
        count: number of unknowns that are kept, u.
        joints: number of joints.

    Returns:
        The sizes; None where they cannot be read, or are of another program's library.
    """
    known = library()
    if not set(spec.of) <= set(known):
        return None
    effects = tuple(known[key]() for key in spec.of)
    rows, flat = count + _width(effects, joints), unpack(spec.told)
    if flat is None or not len(flat) or flat[0] != rows or (len(flat) - 1) % rows:
        return None
    return Unnamed(effects, flat[1:].reshape(rows, -1))


def _width(effects: Sequence[Effect], joints: int) -> int:
    return sum(linear_size(effect, joints) for effect in effects)
