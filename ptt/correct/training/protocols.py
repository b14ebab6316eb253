"""Protocols: which rows are hidden, and how finely a network's settings are chosen on the others."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ptt.run.holdout import blocks, pose_groups
from ptt.run.problem import Problem

FOLDS = 5
TEST_SHARE = 20 / 180  # of the source paper's random split


@dataclass(frozen=True)
class Protocol:
    """Which rows are hidden, and how finely the network's settings are chosen on the others.

    Attributes:
        text: what is hidden, in words.
        folds: (n,) bool each, hidden one after the other.
        groups: (n,) int; rows of one group are held out together when the settings are chosen; -1 never.
    """

    text: str
    folds: tuple[np.ndarray, ...]
    groups: np.ndarray


def block_protocol(problem: Problem) -> Protocol:
    """Contiguous parts of the path, held out in turn: the error to expect at new positions of such a path."""
    groups = blocks(problem.table)
    names = np.unique(groups[groups >= 0])
    folds = tuple(np.isin(groups, part) for part in np.array_split(names, min(FOLDS, len(names))))
    text = f"{len(folds)} parts of contiguous travel held out in turn, all repeats of a pose together"
    return Protocol(text, folds, groups)


def random_protocol(problem: Problem, seed: int = 0, folds: int = 1) -> Protocol:
    """The source paper's split: poses drawn at random, one in nine, all repeats of a pose together.

    It tests interpolation between measured neighbours only.

    Args:
        problem: the readings.
        seed: of the draw.
        folds: how many disjoint draws.

    Returns:
        The protocol.
    """
    groups = pose_groups(problem.table)
    names = np.unique(groups[groups >= 0])
    order = np.random.default_rng(seed).permutation(names)
    size = max(1, round(TEST_SHARE * len(names)))
    drawn = [order[index * size : (index + 1) * size] for index in range(folds)]
    text = f"{size} of {len(names)} poses held out at random, all repeats of a pose together"
    return Protocol(text, tuple(np.isin(groups, part) for part in drawn if len(part)), groups)


PROTOCOLS: dict[str, Callable[[Problem], Protocol]] = {"blocks": block_protocol, "random": random_protocol}
