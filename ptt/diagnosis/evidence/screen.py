"""Screen: what each atom would add to the score of a set, the set's own prior variances held.

Let X be the columns of the set, D their prior variances, L L^T = X^T X + D^-1 and b the posterior mean. The evidence of
X together with an atom's columns Z is the evidence of X plus that of Z alone with

    Z^T Z - C^T C,  C = L^-1 X^T Z,   in the place of Z^T Z,   and   Z^T (y - X b)   in the place of Z^T y,

because the determinant of a block matrix is |A| |S| with S the Schur complement of A, and the quadratic form splits in
the same way.
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
LastVariances = dict[tuple[str, int], np.ndarray]
# Atoms of w columns each, their Gram matrices beside a set (Schur complements), (a, w, w), and Z^T (y - X b), (a, w).
Beside = tuple[list[Atom], np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Gain:
    """What an atom would add to the total of a set, only the atom's own prior variances being optimised.

    Attributes:
        nats: added to the total, the atom's prior odds included.
        key: of the atom.
        variances: its prior variances there, (g,).
    """

    nats: float
    key: str
    variances: np.ndarray


@dataclass(frozen=True)
class Basis:
    """The set beside which atoms are screened.

    Attributes:
        columns: indices in the system, (p,).
        posterior: of these.
        memory: of the noise; the sums are asked for where they are needed, since those of a long run fill gigabytes.
    """

    columns: np.ndarray
    posterior: Posterior
    memory: Memory


class Screen:
    """The atoms that may be added to one set, each screened once and only when asked for."""

    def __init__(self, system: System, basis: Basis, is_open: Allowed, last_variances: LastVariances) -> None:
        """Screen nothing yet.

        Args:
            system: the linearised problem.
            basis: the set.
            is_open: whether an atom may be added to it.
            last_variances: (name, number of variances) -> variances last learned for such an atom; kept up to date.
        """
        self.system, self.basis, self.last_variances = system, basis, last_variances
        self.gains: dict[str, Gain] = {}
        by_name = {atom.name: atom for family, _ in system.families for atom in family}  # all shapes of a name or none
        names = {name for name, atom in by_name.items() if is_open(atom)}
        self.open = [
            (family, columns, [place for place, atom in enumerate(family) if atom.name in names])
            for family, columns in system.families
        ]

    def best(self, allowed: Allowed) -> list[Gain]:
        """What each allowed atom would add, only the best shape of each name; best first."""
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
        """Screen those of the wanted atoms that were not screened before."""
        known = self.gains
        new = [(family, columns, [i for i in some if family[i].key not in known]) for family, columns, some in wanted]
        new = [item for item in new if item[2]]
        if not new:
            return
        posterior, sums = self.basis.posterior, self.system.sums(self.basis.memory)
        every = 2 * sum(columns[places].size for _, columns, places in new) > len(sums.side)
        own = np.concatenate([columns[places].ravel() for _, columns, places in new])
        # C of all of them at once, solved from the right, which gives the memory layout that the products below need.
        root = posterior.cholesky
        solved = sums.across(self.basis.columns[posterior.order], slice(None) if every else own)
        side = sums.side[slice(None) if every else own] - posterior.values[posterior.order] @ solved
        if len(root):
            solved = blas.dtrsm(1.0, root, solved.T, side=1, lower=1, trans_a=1, overwrite_b=1).T
        first, beside = 0, list[Beside]()
        for family, columns, places in new:
            place = columns[places].ravel() if every else np.arange(first, first + columns[places].size)
            first += len(place)
            half = solved[:, run_of(place)].reshape(len(root), len(places), columns.shape[1]).transpose(1, 2, 0)
            gram = sums.own(columns) if len(places) == len(family) else sums.own(columns)[places]
            beside.append(
                ([family[i] for i in places], schur_complement(gram, half), side[place].reshape(len(places), -1))
            )
        self._keep(beside)

    def _keep(self, beside: Sequence[Beside]) -> None:
        """Work out and keep the gains of atoms; those with one variance all at once on a grid of variances."""
        alone, wide = list[Atom](), list[tuple[Atom, np.ndarray, np.ndarray]]()
        explained, log_dets = list[np.ndarray](), list[np.ndarray]()
        for atoms, gram, side in beside:
            places = [place for place, atom in enumerate(atoms) if atom.groups == 1]
            for place in sorted(set(range(len(atoms))).difference(places)):
                self.gains[atoms[place].key] = self._learned(atoms[place], gram[place], side[place])
            if gram.shape[1] >= TRIDIAGONAL_COLUMNS:
                wide += [(atoms[place], gram[place], side[place]) for place in places]
            elif places:
                some = slice(None) if len(places) == len(atoms) else places
                both = _at_ratios(gram[some], side[some])
                alone += [atoms[place] for place in places]
                explained.append(both[0])
                log_dets.append(both[1])
        if wide:
            some, grams, sides = zip(*wide, strict=True)
            both = _at_ratios_of_wide(grams, sides)
            alone += some
            explained.append(both[0])
            log_dets.append(both[1])
        if alone:
            nats = self._gain(np.concatenate(explained), np.concatenate(log_dets))
            nats -= np.array([atom.effect is not None for atom in alone])[:, None] * RATIO_PRIOR_NATS
            for atom, at, most in zip(alone, nats.argmax(axis=1).tolist(), nats.max(axis=1).tolist(), strict=True):
                self.gains[atom.key] = Gain(most - atom.odds, atom.key, RATIOS[at : at + 1])
        for atoms, gram, side in beside:
            for place, atom in enumerate(atoms):
                if atom.joint is not None and atom.groups == 1:
                    self._at_few_joints(atom, atom.joint, gram[place], side[place])

    def _at_few_joints(self, atom: Atom, joint: np.ndarray, gram: np.ndarray, side: np.ndarray) -> None:
        """Keep an atom's gain at only the joints that show it, if that is larger.

        Args:
            atom: with values of single joints and one variance.
            joint: joint of each of its columns, (w,) int.
            gram: Schur complement of its columns beside the set, (w, w).
            side: Z^T (y - X b), (w,).
        """
        prior = np.full(len(gram), float(self.gains[atom.key].variances[0]))
        covariance = inverse(gram + np.diag(1.0 / prior))  # in units of phi
        idle = idle_joints(joint, covariance @ side, covariance, prior, self.basis.posterior.phi)
        if idle is not None:
            few = gram[np.ix_(~idle.columns, ~idle.columns)][None], side[~idle.columns][None]
            nats = self._gain(*_at_ratios(*few))[0] - RATIO_PRIOR_NATS - idle.odds - atom.odds
            best = int(nats.argmax())
            if nats[best] > self.gains[atom.key].nats:
                self.gains[atom.key] = Gain(float(nats[best]), atom.key, RATIOS[best : best + 1])

    def _gain(self, explained: np.ndarray, log_det: np.ndarray) -> np.ndarray:
        """Log evidence gained where so much more is explained, at the cost of half a log-determinant, (..) each."""
        before, nats = self.basis.posterior.penalised_square, self.system.nats_of_noise
        return nats(np.maximum(before - explained, 1e-9)) - nats(before) - 0.5 * log_det

    def _learned(self, atom: Atom, gram: np.ndarray, side: np.ndarray) -> Gain:
        """The gain of an atom with several variances, which are learned by ascent."""
        before, system = self.basis.posterior.penalised_square, self.system
        work_out = partial(
            maximise, square=before, count=system.restricted_count, group=atom.group, freedom=system.freedom,
            least_phi=system.least_phi, tolerance=SCREEN_TOLERANCE, ceiling=atom.most,
            start=self.last_variances.get((atom.name, atom.groups)),
            log_size_std=LOG_SIZE_STD if atom.effect else np.inf,
        )  # fmt: skip
        try:
            own = work_out(gram, side)
        except np.linalg.LinAlgError:  # rounding made the matrix indefinite: only its positive part counts
            eigenvalues, vectors = np.linalg.eigh(gram)
            seen = vectors[:, eigenvalues > np.abs(eigenvalues[0])]
            own = work_out(seen @ (seen.T @ gram @ seen) @ seen.T, seen @ (seen.T @ side))
        self.last_variances[atom.name, atom.groups] = own.group_variances
        return Gain(own.total - float(system.nats_of_noise(before)) - atom.odds, atom.key, own.group_variances)


def schur_complement(whole: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Z^T Z - C^T C of atoms of w columns each beside a set, (a, w, w), with rounding kept positive.

    Args:
        whole: Z^T Z of each, (a, w, w).
        half: C^T of each, (a, w, p).
    """
    gram = whole - half @ half.transpose(0, 2, 1)
    # Of a column that the set spans only rounding of either sign remains; the diagonal is raised by as much.
    every = np.arange(whole.shape[1])
    gram[:, every, every] += np.finfo(float).eps * (1 + half.shape[2]) * whole[:, every, every] * len(every)
    return np.asarray(gram)


def _at_ratios(gram: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of squares that each atom explains at each prior variance r, and log|1 + r G|, (atoms, ratios) each."""
    eigenvalues, vectors = np.linalg.eigh(gram)
    eigenvalues, along = np.maximum(eigenvalues, 0.0), np.einsum("aij,ai->aj", vectors, side) ** 2
    factors = 1.0 + RATIOS[:, None] * eigenvalues[:, None, :]  # shape: (atoms, ratios, width)
    return (along[:, None, :] * RATIOS[:, None] / factors).sum(axis=2), np.log(factors).sum(axis=2)


def _at_ratios_of_wide(grams: Sequence[np.ndarray], sides: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """As `_at_ratios` for atoms of many columns, by tridiagonal forms, which are a fifth of the work.

    The Householder reflections that make the Gram matrix G, bordered by the vector s, tridiagonal (T) map s to |s|
    times the first unit vector. So s^T (G + 1/ratio)^-1 s is |s|^2 over the last pivot of T + 1/ratio, eliminated from
    below.
    """
    width = np.array([len(side) for side in sides])
    room = int(lapack.dsytrd_lwork(int(width.max()) + 1, lower=1)[0])
    bands = [
        lapack.dsytrd(_bordered(*both), lower=1, lwork=room, overwrite_a=1)[1:3]
        for both in zip(grams, sides, strict=True)
    ]
    # All atoms at all ratios form one block-diagonal tridiagonal matrix, which LAPACK factorises at once.
    level = np.concatenate([level[:0:-1] for level, _ in bands])
    beside, last = np.concatenate([beside[::-1] for _, beside in bands]), np.cumsum(width) - 1
    square, beside[last] = beside[last] ** 2, 0.0
    off = np.tile(beside, len(RATIOS))[:-1]
    pivots, _, failed = lapack.dpttrf((level + 1.0 / RATIOS[:, None]).ravel(), off)
    if failed:  # rounding made one of them indefinite
        found = [_at_ratios(gram[None], side[None]) for gram, side in zip(grams, sides, strict=True)]
        return np.concatenate([one for one, _ in found]), np.concatenate([two for _, two in found])
    pivots = pivots.reshape(len(RATIOS), -1)
    log_det = np.add.reduceat(np.log(pivots), last + 1 - width, axis=1) + width * np.log(RATIOS)[:, None]
    return (square / pivots[:, last]).T, log_det.T


def _bordered(gram: np.ndarray, side: np.ndarray) -> np.ndarray:
    whole = np.zeros((len(side) + 1,) * 2, order="F")
    whole[1:, 0], whole[1:, 1:] = side, gram
    return whole
