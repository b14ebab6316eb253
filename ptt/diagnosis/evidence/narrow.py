"""Wide atoms reduced to the directions that the rows show: of a field or a map, one path shows but a few.

Independent unknowns with one common prior variance stay so under a rotation, so each group of columns can be expressed
in the eigenvectors of its Gram matrix, and those of negligible eigenvalue dropped. Atoms of equal width are stored side
by side, so that batched products over them need no copies.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, Reduction

CHEAP_COLUMNS = 50  # columns up to which an atom costs a search little
# Columns from which an effect is a map of harmonics whose columns are mostly alike: fewer pay on any run
MAP_COLUMNS = 150
LEAST_COORDINATES = 8  # coordinates per column from which a search saves more than the eigenvectors cost
EIGENVALUE_ROUNDING = 1e-9  # share of the largest eigenvalue below which a direction is rounding
LEAST_SIGNAL = 1e-3  # variance over noise that a direction has to put into the readings at its largest prior variance


@dataclass(frozen=True)
class Narrowed:
    """Atoms on fewer columns: unchanged columns first, then those of reduced atoms.

    Attributes:
        atoms: by key, each with its new columns.
        place: new index of each old column that is kept, -1 for the others.
        stay: old indices of the kept columns, in their new order.
        reduced: keys of the reduced atoms, in the order of their columns.
        old: key of a reduced atom -> its old columns.
    """

    atoms: dict[str, Atom]
    place: np.ndarray
    stay: np.ndarray
    reduced: tuple[str, ...]
    old: Mapping[str, np.ndarray]

    def columns(self, columns: np.ndarray) -> np.ndarray:
        """The new columns from old ones, (.., P) each."""
        if not self.reduced:
            return columns
        behind = columns.transpose()  # as they lie in memory, one behind the other
        first = len(self.stay)
        found = np.empty((first + sum(len(self.atoms[key].columns) for key in self.reduced), *behind.shape[1:]))
        np.take(behind, self.stay, axis=0, out=found[:first], mode="clip")  # without a check it needs no second copy
        for key in self.reduced:
            reduction = self.atoms[key].reduction
            assert reduction is not None
            own, last = behind[self.old[key]], first + reduction.basis.shape[1]
            width = int(np.prod(own.shape[1:]))
            found[first:last] = (reduction.basis.T @ own.reshape(len(own), width)).reshape(last - first, *own.shape[1:])
            first = last
        return found.transpose()

    def scale(self, scale: np.ndarray) -> np.ndarray:
        """Size of a unit of each new column, (P,); those of reduced atoms are in their `Reduction`."""
        if not self.reduced:
            return scale
        return np.concatenate([scale[self.stay], *(np.ones(len(self.atoms[k].columns)) for k in self.reduced)])


def narrow(atoms: Mapping[str, Atom], columns: np.ndarray, scale: np.ndarray) -> Narrowed:
    """Reduce wide atoms, group by group, to the directions that the rows show.

    Args:
        atoms: by key.
        columns: (m, 3, P) whitened.
        scale: (P,) size of a unit of each column.

    Returns:
        The atoms on fewer columns.
    """
    wide = [key for key, atom in atoms.items() if _pays(atom, columns[:, :, 0].size)]
    if not wide:
        every = np.arange(columns.shape[2])
        return Narrowed(dict(atoms), every, every, (), {})
    stay = _by_width(atoms, wide, columns.shape[2])
    place = np.full(columns.shape[2], -1)
    place[stay] = np.arange(len(stay))
    found = {key: atom if key in wide else replace(atom, columns=place[atom.columns]) for key, atom in atoms.items()}
    first = len(stay)
    for key in wide:
        atom = atoms[key]
        behind = columns.transpose()[atom.columns]
        basis, group = _seen(behind.reshape(len(behind), behind[0].size), atom.group, atom.most)
        own = np.arange(first, first + len(group))
        reduction = Reduction(basis, atom.group, scale[atom.columns])
        free = np.zeros(len(own), dtype=bool)
        found[key] = replace(atom, columns=own, group=group, bounded=free, reduction=reduction, joint=None)
        first += len(group)
    return Narrowed(found, place, stay, tuple(wide), {key: atoms[key].columns for key in wide})


def _by_width(atoms: Mapping[str, Atom], wide: Collection[str], count: int) -> np.ndarray:
    """Kept columns: first those of no atom, then atoms by width, effects before blocks of the same width."""
    own = [atom for key, atom in atoms.items() if key not in wide]
    own.sort(key=lambda atom: (len(atom.columns), atom.effect is None))
    free = np.ones(count, dtype=bool)
    free[np.concatenate([atom.columns for atom in atoms.values()])] = False
    return np.concatenate([np.flatnonzero(free), *(atom.columns for atom in own)])


def _pays(atom: Atom, coordinates: int) -> bool:
    width, is_map = len(atom.columns), atom.effect is not None and len(atom.columns) > MAP_COLUMNS
    return (
        (is_map or CHEAP_COLUMNS < width < coordinates / LEAST_COORDINATES)
        and not atom.bounded.any()
        and atom.within is None
    )


def _seen(flat: np.ndarray, group: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions that the rows show of columns (w, m), one group at a time, (w, r), and the group of each."""
    basis, owner = [], []
    for index, largest in enumerate(most):
        own = np.flatnonzero(group == index)
        eigenvalues, vectors = np.linalg.eigh(flat[own] @ flat[own].T)
        kept = np.flatnonzero(eigenvalues > max(EIGENVALUE_ROUNDING * eigenvalues[-1], LEAST_SIGNAL / largest))
        kept = kept if len(kept) else np.array([len(own) - 1])
        part = np.zeros((len(flat), len(kept)))
        part[own] = vectors[:, kept]
        basis.append(part)
        owner.append(np.full(len(kept), index))
    return np.concatenate(basis, axis=1), np.concatenate(owner)
