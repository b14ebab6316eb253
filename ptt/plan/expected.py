"""How well a plan will tell a parameter, and all parameters of one kind together."""

from collections.abc import Iterable
from typing import NamedTuple


class Expected(NamedTuple):
    """One parameter: its standard error to be expected, None where the rows do not tell it, and its usual size.

    `combined` says whether they tell combinations of it with others, as where all joints alike are the frame.
    """

    name: str
    unit: str
    std: float | None
    usual: float
    combined: bool = False


class ExpectedKind(NamedTuple):
    """The parameters of one kind, as the gaps of all sliders.

    `std` is the largest standard error of those that the rows tell, None where they tell none; `unseen` says which
    they do not tell, '' where they tell all.
    """

    name: str
    std: float | None
    unseen: str


def by_kind(parameters: Iterable[Expected]) -> list[ExpectedKind]:
    """Put parameters of one kind together.

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
