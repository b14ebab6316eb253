"""Screen: what every atom would add to a set of atoms, its own variances optimised alone.

With the columns X of a set, L L^T = X^T X + D^-1 for its prior variances D, and its solution b, the evidence of X and
an atom's columns Z together is that of X plus that of Z alone with

    Z^T Z - C^T C,  C = L^-1 X^T Z,   in the place of Z^T Z,   and   Z^T (y - X b)   in the place of Z^T y,

for a determinant of blocks is |A| |S|, S the Schur complement of A, and the quadratic form parts in the same way.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import blas, lapack

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.idle import idle_joints
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import Memory, run_of
from ptt.fitting.evidence import LOG_SIZE_STD, maximise
from ptt.fitting.factor import inverse
from ptt.fitting.posterior import Posterior

# Prior variances on a grid, over the white variance, at which one atom is screened
RATIOS = np.geomspace(1e-3, 1e4, 22)
# Nats of the log-normal prior of an effect's size against each of them
RATIO_PRIOR_NATS = 0.5 * (0.5 * np.log(RATIOS) / LOG_SIZE_STD) ** 2
SCREEN_TOLERANCE = 0.3  # nats at which learning several variances of one atom may end
TRIDIAGONAL_COLUMNS = 12  # columns of an atom from which a tridiagonal form is faster than eigenvectors

Allowed = Callable[[Atom], bool]
Begun = dict[tuple[str, int], np.ndarray]
Looked = tuple[list[Atom], np.ndarray, np.ndarray]  # atoms of one width w, what a set leaves of them (a, w, w), (a, w)


@dataclass(frozen=True)
class Gain:
    """What an atom would add to the total beside a state, its own variances optimised alone.

    Attributes:
        nats: added to the total.
        key: of the atom.
        variances: its variances, (g,).
    """

    nats: float
    key: str
    variances: np.ndarray


@dataclass(frozen=True)
class Basis:
    """The set that atoms are set beside.

    Attributes:
        columns: indices in the system, (p,).
        posterior: of these.
        memory: of the noise; the sums are asked for where they are needed, since those of a long run fill gigabytes.
    """

    columns: np.ndarray
    posterior: Posterior
    memory: Memory


class Screen:
    """All atoms that are open to one set; each is looked at once, and only if somebody asks for it."""

    def __init__(self, system: System, basis: Basis, is_open: Allowed, begun: Begun) -> None:
        """Look at nothing yet.

        Args:
            system: the linearised problem.
            basis: the set.
            is_open: whether an atom may be added to it.
            begun: variances that were last learned for atoms of several, by their name and number; kept up to date.
        """
        self.system, self.basis, self.begun = system, basis, begun
        self.gains: dict[str, Gain] = {}
        alike = {atom.name: atom for family, _ in system.families for atom in family}  # all shapes of a name or none
        names = {name for name, atom in alike.items() if is_open(atom)}
        self.open = [
            (family, columns, [place for place, atom in enumerate(family) if atom.name in names])
            for family, columns in system.families
        ]

    def best(self, allowed: Allowed) -> list[Gain]:
        """What each allowed atom would add, the best shape of each name; best first."""
        best: dict[str, Gain] = {}
        for atom, gain in self.each(allowed):
            if atom.name not in best or gain.nats > best[atom.name].nats:
                best[atom.name] = gain
        return sorted(best.values(), key=lambda gain: -gain.nats)

    def each(self, allowed: Allowed) -> list[tuple[Atom, Gain]]:
        """What each allowed atom would add, in every shape."""
        wanted = [(family, columns, [i for i in open_ if allowed(family[i])]) for family, columns, open_ in self.open]
        self._work_out(wanted)
        return [(family[i], self.gains[family[i].key]) for family, _, places in wanted for i in places]

    def _work_out(self, wanted: Sequence[tuple[tuple[Atom, ...], np.ndarray, list[int]]]) -> None:
        """Work out what all those atoms add that nobody has asked for before."""
        known = self.gains
        new = [(family, columns, [i for i in some if family[i].key not in known]) for family, columns, some in wanted]
        new = [item for item in new if item[2]]
        if not new:
            return
        posterior, sums = self.basis.posterior, self.system.sums(self.basis.memory)
        every = 2 * sum(columns[places].size for _, columns, places in new) > len(sums.side)
        own = np.concatenate([columns[places].ravel() for _, columns, places in new])
        # C of all of them at once, solved from the right: so it lies in memory as the products below want it.
        root = posterior.cholesky
        solved = sums.across(self.basis.columns[posterior.order], slice(None) if every else own)
        side = sums.side[slice(None) if every else own] - posterior.values[posterior.order] @ solved
        if len(root):
            solved = blas.dtrsm(1.0, root, solved.T, side=1, lower=1, trans_a=1, overwrite_b=1).T
        first, looked = 0, list[Looked]()
        for family, columns, places in new:
            place = columns[places].ravel() if every else np.arange(first, first + columns[places].size)
            first += len(place)
            half = solved[:, run_of(place)].reshape(len(root), len(places), columns.shape[1]).transpose(1, 2, 0)
            gram = sums.own(columns) if len(places) == len(family) else sums.own(columns)[places]
            looked.append(([family[i] for i in places], left_beside(gram, half), side[place].reshape(len(places), -1)))
        self._keep(looked)

    def _keep(self, looked: Sequence[Looked]) -> None:
        """Keep what atoms add, from what a set leaves of their columns: those of one variance all at once."""
        alone, wide = list[Atom](), list[tuple[Atom, np.ndarray, np.ndarray]]()
        taken, spread = list[np.ndarray](), list[np.ndarray]()
        for atoms, gram, side in looked:
            places = [place for place, atom in enumerate(atoms) if atom.groups == 1]
            for place in sorted(set(range(len(atoms))).difference(places)):
                self.gains[atoms[place].key] = self._learned(atoms[place], gram[place], side[place])
            if gram.shape[1] >= TRIDIAGONAL_COLUMNS:
                wide += [(atoms[place], gram[place], side[place]) for place in places]
            elif places:
                some = slice(None) if len(places) == len(atoms) else places
                both = _at_ratios(gram[some], side[some])
                alone += [atoms[place] for place in places]
                taken.append(both[0])
                spread.append(both[1])
        if wide:
            some, grams, sides = zip(*wide, strict=True)
            both = _at_ratios_of_wide(grams, sides)
            alone += some
            taken.append(both[0])
            spread.append(both[1])
        if alone:
            nats = self._noise_gain(np.concatenate(taken), np.concatenate(spread))
            nats -= np.array([atom.effect is not None for atom in alone])[:, None] * RATIO_PRIOR_NATS
            for atom, at, most in zip(alone, nats.argmax(axis=1).tolist(), nats.max(axis=1).tolist(), strict=True):
                self.gains[atom.key] = Gain(most - atom.odds, atom.key, RATIOS[at : at + 1])
        for atoms, gram, side in looked:
            for place, atom in enumerate(atoms):
                if atom.joint is not None:
                    self._at_few_joints(atom, atom.joint, gram[place], side[place])

    def _at_few_joints(self, atom: Atom, joint: np.ndarray, gram: np.ndarray, side: np.ndarray) -> None:
        """Keep what an atom adds at no more joints than show it, if that is more.

        Args:
            atom: of one value for each joint.
            joint: of its columns, (w,) int.
            gram: of what the set leaves of them, (w, w).
            side: (w,).
        """
        prior = np.full(len(gram), float(self.gains[atom.key].variances[0]))
        spread = inverse(gram + np.diag(1.0 / prior))
        idle = idle_joints(joint, spread @ side, spread, prior, self.basis.posterior.phi)
        if idle is not None:
            few = gram[np.ix_(~idle.columns, ~idle.columns)][None], side[~idle.columns][None]
            nats = self._noise_gain(*_at_ratios(*few))[0] - RATIO_PRIOR_NATS - idle.odds - atom.odds
            best = int(nats.argmax())
            if nats[best] > self.gains[atom.key].nats:
                self.gains[atom.key] = Gain(float(nats[best]), atom.key, RATIOS[best : best + 1])

    def _noise_gain(self, taken: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """Nats that a smaller sum of squares is worth, the white variance being learned, less half of the spread."""
        left, nats = self.basis.posterior.penalised_square, self.system.nats_of_noise
        return nats(np.maximum(left - taken, 1e-9)) - nats(left) - 0.5 * spread

    def _learned(self, atom: Atom, gram: np.ndarray, side: np.ndarray) -> Gain:
        """The same where an atom has several variances."""
        left, system = self.basis.posterior.penalised_square, self.system
        work_out = partial(
            maximise, square=left, count=system.spare, group=atom.group, freedom=system.freedom,
            least_phi=system.least_phi, tolerance=SCREEN_TOLERANCE, start=self.begun.get((atom.name, atom.groups)),
            ceiling=atom.most, log_size_std=LOG_SIZE_STD if atom.effect else np.inf,
        )  # fmt: skip
        try:
            own = work_out(gram, side)
        except np.linalg.LinAlgError:  # rounding left more than that below zero
            strength, ways = np.linalg.eigh(gram)
            seen = ways[:, strength > np.abs(strength[0])]
            own = work_out(seen @ (seen.T @ gram @ seen) @ seen.T, seen @ (seen.T @ side))
        self.begun[atom.name, atom.groups] = own.group_variances
        return Gain(own.total - float(system.nats_of_noise(left)) - atom.odds, atom.key, own.group_variances)


def left_beside(whole: np.ndarray, half: np.ndarray) -> np.ndarray:
    """What a set leaves of the columns of atoms of one width w, (a, w, w).

    Args:
        whole: Z^T Z of each, (a, w, w).
        half: C^T of each, (a, w, p).
    """
    gram = whole - half @ half.transpose(0, 2, 1)
    # What is left of a column that the set spans is rounding, of either sign: no less than that counts as left.
    every = np.arange(whole.shape[1])
    gram[:, every, every] += np.finfo(float).eps * (1 + half.shape[2]) * whole[:, every, every] * len(every)
    return np.asarray(gram)


def _at_ratios(gram: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What atoms of one width take of the sum of squares at each ratio, and log|1 + ratio G|, (atoms, ratios) each."""
    strength, ways = np.linalg.eigh(gram)
    strength, along = np.maximum(strength, 0.0), np.einsum("aij,ai->aj", ways, side) ** 2
    spread = 1.0 + RATIOS[:, None] * strength[:, None, :]  # shape: (atoms, ratios, width)
    return (along[:, None, :] * RATIOS[:, None] / spread).sum(axis=2), np.log(spread).sum(axis=2)


def _at_ratios_of_wide(grams: Sequence[np.ndarray], sides: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The same of atoms of many columns, by tridiagonal forms, which are a fifth of the work.

    Reflections that turn the gram G bordered by the side s into a tridiagonal T turn s into |s| times the first unit
    vector, so s^T (G + 1/ratio)^-1 s is |s|^2 over the last pivot of T + 1/ratio worked out from below.
    """
    width = np.array([len(side) for side in sides])
    room = int(lapack.dsytrd_lwork(int(width.max()) + 1, lower=1)[0])
    bands = [
        lapack.dsytrd(_bordered(*both), lower=1, lwork=room, overwrite_a=1)[1:3]
        for both in zip(grams, sides, strict=True)
    ]
    # All behind each other, with nothing in between, are one tridiagonal matrix: at each ratio, and all ratios' too.
    level = np.concatenate([level[:0:-1] for level, _ in bands])
    beside, last = np.concatenate([beside[::-1] for _, beside in bands]), np.cumsum(width) - 1
    square, beside[last] = beside[last] ** 2, 0.0
    off = np.tile(beside, len(RATIOS))[:-1]
    pivots, _, failed = lapack.dpttrf((level + 1.0 / RATIOS[:, None]).ravel(), off)
    if failed:  # where rounding spoils one
        found = [_at_ratios(gram[None], side[None]) for gram, side in zip(grams, sides, strict=True)]
        return np.concatenate([one for one, _ in found]), np.concatenate([two for _, two in found])
    pivots = pivots.reshape(len(RATIOS), -1)
    spread = np.add.reduceat(np.log(pivots), last + 1 - width, axis=1) + width * np.log(RATIOS)[:, None]
    return (square / pivots[:, last]).T, spread.T


def _bordered(gram: np.ndarray, side: np.ndarray) -> np.ndarray:
    whole = np.zeros((len(side) + 1,) * 2, order="F")
    whole[1:, 0], whole[1:, 1:] = side, gram
    return whole
