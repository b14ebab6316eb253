"""Expected standard errors of a plan: of each parameter, and of all parameters of one kind."""

from collections.abc import Iterable
from typing import NamedTuple


class Expected(NamedTuple):
    """Expected standard error of one parameter, None where the rows do not determine it, and its usual size.

    `combined` says whether they determine combinations of it with others, as where all joints alike act as the frame.
    """

    name: str
    unit: str
    std: float | None
    usual: float
    combined: bool = False


class ExpectedKind(NamedTuple):
    """The parameters of one kind, as the gaps of all sliders.

    `std` is the largest standard error of those that the rows determine, None without any; `unseen` says in words that
    some are not determined, '' where all are.
    """

    name: str
    std: float | None
    unseen: str


def by_kind(parameters: Iterable[Expected]) -> list[ExpectedKind]:
    """Group parameters by kind, the part of their name before the joint.

    Args:
        parameters: 'gap_mm 1', 'gap_mm 2', ...

    Returns:
        One for each kind, in order.
    """
    kinds: dict[str, list[Expected]] = {}
    for one in parameters:
        kinds.setdefault(one.name.partition(" ")[0], []).append(one)
    return [_together(name, parts) for name, parts in kinds.items()]


def _together(name: str, parts: list[Expected]) -> ExpectedKind:
    known = [one.std for one in parts if one.std is not None]
    if known:
        return ExpectedKind(name, max(known), "some unseen" if len(known) < len(parts) else "")
    combined = any(one.combined for one in parts)
    return ExpectedKind(name, None, "seen in combinations alone" if combined else "unseen")
