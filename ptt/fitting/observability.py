"""Unobservable combinations of parameters, which only the prior of their usual size holds near zero, in words."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ptt.effects.phrases import listed
from ptt.fitting.indices import project_off
from ptt.fitting.layout import FRAME, FRAME_NAMES, MOUNT, MOUNT_NAMES, Layout
from ptt.fitting.patterns import Pattern, patterns
from ptt.fitting.result import FitResult
from ptt.fitting.stated import SEEN_INFORMATION
from ptt.record import Record

# cosine between an effect's part of an imitation and a pattern from which the pattern describes it
PATTERN_COSINE = 0.95
CORRELATED = 0.9  # correlation from which a pair of parameters is listed
SMALL_MOTION = 0.1  # share of the largest motion of its kind below which one is not named
NEW_LENGTH = 0.5  # length, of one, that a combination must add to those reported already
NO_PATTERN_COST = 3.0  # cost of an effect that no pattern describes; that of one with a pattern is 1 to 1.5
MOST_MEMBERS, LEAST_MEMBER = 4, 0.3  # members of a combination without a pattern, and their least share of the largest
TOGETHER = " together with "
PARTNER_PRIOR = 1e-6  # information in usual sizes on what imitates a pattern, which keeps free directions finite


@dataclass(frozen=True)
class Combination(Record):
    """One combination of parameters that the data cannot see.

    Attributes:
        effect: key of the effect that it is reported for.
        what: its pattern, as in 'offset of all sliders together'.
        partners: what it is confounded with; empty where the data show nothing of it at all.
        weights: parameter name -> weight in usual sizes, the effect's own.
    """

    keys: ClassVar[str] = "effect, what, partners, weights, text"

    effect: str
    what: str
    partners: tuple[str, ...]
    weights: dict[str, float]

    @property
    def text(self) -> str:
        """The combination as a sentence."""
        if not self.partners:
            return f"{self.effect}: {self.what} leaves no trace in this run"
        return f"{self.effect}: {self.what} cannot be told from {listed(self.partners, TOGETHER)}"


@dataclass(frozen=True)
class Correlation:
    """Two measured parameters that the data hardly separate.

    Attributes:
        first: name.
        second: name.
        value: correlation, -1 to 1.
    """

    first: str
    second: str
    value: float


def correlations(fitted: FitResult) -> tuple[Correlation, ...]:
    """Correlations of measured effect parameters, strongest first.

    Args:
        fitted: the fit.

    Returns:
        The pairs of more than `CORRELATED`, either way.
    """
    std = np.sqrt(np.diag(fitted.covariance))
    chosen = np.flatnonzero(fitted.measured & (fitted.layout.owner >= 0) & (std > 0))
    matrix = fitted.covariance[np.ix_(chosen, chosen)] / np.outer(std[chosen], std[chosen])
    names = fitted.layout.names
    pairs = [
        Correlation(names[chosen[i]], names[chosen[j]], float(matrix[i, j]))
        for i, j in zip(*np.nonzero(np.triu(np.abs(matrix) > CORRELATED, 1)), strict=True)
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair.value)))


def unobservable(fitted: FitResult) -> tuple[Combination, ...]:
    """Name the combinations that the data cannot see.

    For each effect, all other columns are projected off; directions of its own that keep less information than the
    prior of their usual size are confounded. Patterns (all together, sideways along x, ...) that lie in that space give
    the words, and the fewest columns of others that imitate them are the partners.

    Args:
        fitted: the fit.

    Returns:
        As many combinations as there are unseen directions, at most; the simplest first.
    """
    left = fitted.unseen  # (u, m), shrinks with every combination that is told
    if not left.shape[1]:
        return ()
    candidates = [_imitate(pattern, index, fitted) for index, pattern in _confounded(fitted)]
    found: list[Combination] = []
    for candidate in sorted(candidates, key=lambda item: (item.cost, -item.order)):
        within = left.T @ candidate.whole
        length = float(np.linalg.norm(within))
        if length < NEW_LENGTH:  # told already, with another effect in the lead
            continue
        found.append(candidate.combination)
        left = left @ _complement(within / length)
        if not left.shape[1]:
            return tuple(found)
    return (*found, *_rest(fitted, left))


@dataclass(frozen=True)
class _Candidate:
    combination: Combination
    whole: np.ndarray  # (u,), unit length, partners included
    cost: float  # how many words it takes
    order: int  # place of its effect in the causal chain: of two ways to say it, the later effect has the lead


def _information(fitted: FitResult) -> np.ndarray:
    """Information on the unknowns, in units of the sizes that they may have, (u, u)."""
    return fitted.information * np.outer(fitted.sizes, fitted.sizes)


def _patterns(fitted: FitResult, index: int, own: np.ndarray) -> Iterator[Pattern]:
    """Patterns of an effect's unknowns, in the same units."""
    for pattern in patterns(fitted.layout, index, own, fitted.model):
        vector = pattern.vector / fitted.sizes
        yield replace(pattern, vector=vector / np.linalg.norm(vector))


def _confounded(fitted: FitResult) -> Iterator[tuple[int, Pattern]]:
    """Patterns that keep less information beside all other columns than their prior has."""
    layout, information = fitted.layout, _information(fitted)
    for index in range(len(layout.terms)):
        own = np.flatnonzero(layout.owner == index)
        if not len(own):
            continue
        kept = project_off(information, own, PARTNER_PRIOR)
        if np.linalg.eigvalsh(kept)[0] >= SEEN_INFORMATION:
            continue
        for pattern in _patterns(fitted, index, own):
            if pattern.vector[own] @ kept @ pattern.vector[own] < SEEN_INFORMATION:
                yield index, pattern


def _imitate(pattern: Pattern, index: int, fitted: FitResult) -> _Candidate:
    """Find the fewest others that imitate a pattern: all tracker motions, then effects, then less of each."""
    layout, information = fitted.layout, _information(fitted)
    groups = _groups(layout, index)
    chosen: list[str | int] = [name for name in groups if isinstance(name, str)]
    waiting = [name for name in groups if isinstance(name, int)]

    def kept(names: Sequence[str | int]) -> float:
        return _kept(information, pattern.vector, np.concatenate([_NONE, *(groups[name] for name in names)]))

    while kept(chosen) >= SEEN_INFORMATION and waiting:
        best = min(waiting, key=lambda name: kept([*chosen, name]))
        chosen.append(best)
        waiting.remove(best)
    for name in list(chosen):
        rest = [other for other in chosen if other != name]
        if kept(rest) < SEEN_INFORMATION:
            chosen = rest
    whole = pattern.vector + _imitation(
        information, pattern.vector, np.concatenate([_NONE, *(groups[name] for name in chosen)])
    )
    motions = _large([name for name in chosen if isinstance(name, str)], groups, whole)
    effects = [_effect_words(whole, owner, fitted) for owner in chosen if isinstance(owner, int)]
    key = layout.terms[index].effect.key
    weights = _weights(pattern.vector, np.flatnonzero(np.abs(pattern.vector) > 1e-9), key, fitted)
    partners = (*(words for words, _ in effects), *_frame_words(motions))
    cost = pattern.cost + sum(cost for _, cost in effects) + len(motions)
    return _Candidate(Combination(key, pattern.words, partners, weights), whole / np.linalg.norm(whole), cost, index)


def _weights(vector: np.ndarray, own: Sequence[int] | np.ndarray, key: str, fitted: FitResult) -> dict[str, float]:
    """Share of each of an effect's values `own` in a direction: name within the effect -> share, in usual sizes."""
    usual = vector[own] * fitted.sizes[own]
    shares = usual / np.linalg.norm(usual)
    return {fitted.layout.names[i].removeprefix(f"{key} "): float(part) for i, part in zip(own, shares, strict=True)}


def _large(motions: list[str], groups: Mapping[str | int, np.ndarray], whole: np.ndarray) -> list[str]:
    """Motions that matter: not a small part of the largest of their kind, shift or rotation."""
    size = {name: float(np.abs(whole[groups[name]]).max(initial=0.0)) for name in motions}  # no frame in a trusted one
    kinds = [[name for name in motions if ("rotation" in name) == kind] for kind in (False, True)]
    largest = [max((size[name] for name in kind), default=0.0) for kind in kinds]
    return [name for name in motions if size[name] > SMALL_MOTION * largest["rotation" in name]]


_NONE = np.zeros(0, dtype=int)


def _groups(layout: Layout, index: int) -> dict[str | int, np.ndarray]:
    """What may imitate: each motion of the tracker by its name (all frames at once), each other effect by its index."""
    frames = np.flatnonzero(layout.owner == FRAME).reshape(-1, 6).T
    mounts = np.flatnonzero(layout.owner == MOUNT).reshape(-1, 3).T
    every = " of every run" if frames.shape[1] > 1 else ""
    groups: dict[str | int, np.ndarray] = {f"{name}{every}": own for name, own in zip(FRAME_NAMES, frames, strict=True)}
    groups |= dict(zip(MOUNT_NAMES, mounts, strict=True)) if mounts.size else {}
    for other in range(len(layout.terms)):
        columns = np.flatnonzero(layout.owner == other)
        if other != index and len(columns):
            groups[other] = columns
    return groups


def _kept(information: np.ndarray, vector: np.ndarray, others: np.ndarray) -> float:
    """Information on a direction when other columns may imitate it."""
    whole = vector + _imitation(information, vector, others)
    return float(whole @ information @ whole)


def _imitation(information: np.ndarray, vector: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Values of the other columns, (u,), at which the data see least of a direction."""
    result = np.zeros_like(vector)
    if len(others):
        block = information[np.ix_(others, others)] + PARTNER_PRIOR * np.eye(len(others))
        result[others] = -np.linalg.solve(block, information[others] @ vector)
    return result


def _frame_words(motions: Sequence[str]) -> list[str]:
    """Frame motions by name; sideways shifts that only make up for a rotation's pivot are left out."""
    turned = any("rotation" in name for name in motions)
    return [name for name in motions if not (turned and name.startswith(("tracker x", "tracker y")))]


def _effect_words(whole: np.ndarray, owner: int, fitted: FitResult) -> tuple[str, float]:
    """An effect's share in an imitation, its pattern where it has one, else its name alone; and what it costs."""
    layout = fitted.layout
    key, columns = layout.terms[owner].effect.key, np.flatnonzero(layout.owner == owner)
    part = np.zeros_like(whole)
    part[columns] = whole[columns]
    length = np.linalg.norm(part)
    best = max(_patterns(fitted, owner, columns), key=lambda pattern: abs(float(pattern.vector @ part)))
    if abs(float(best.vector @ part)) > PATTERN_COSINE * length:
        return f"{key} ({best.words})", 1.0 + best.cost
    return key, NO_PATTERN_COST


def _complement(direction: np.ndarray) -> np.ndarray:
    """Orthonormal basis of what is at right angles to a unit vector, (m, m - 1)."""
    return np.linalg.svd(direction[None, :])[2][1:].T


def _rest(fitted: FitResult, left: np.ndarray) -> list[Combination]:
    """Combinations that no pattern describes, by their largest members."""
    layout, rest = fitted.layout, []
    for direction in left.T:
        order = np.argsort(-np.abs(direction))[:MOST_MEMBERS]
        big = [i for i in order if abs(direction[i]) > LEAST_MEMBER * abs(direction[order[0]])]
        lead = next((i for i in big if layout.owner[i] >= 0), None)
        if lead is None:
            continue
        key = layout.terms[layout.owner[lead]].effect.key
        weights = _weights(direction, [i for i in big if layout.owner[i] == layout.owner[lead]], key, fitted)
        what = "a combination of " + listed(list(weights), TOGETHER)
        others = [layout.names[i] for i in big if layout.owner[i] != layout.owner[lead]]
        rest.append(Combination(key, what, tuple(others), weights))
    return rest
