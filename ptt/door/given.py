"""Words and numbers that were handed over: one of those that there are, not below the least; as options have it."""

import math
from collections.abc import Iterable
from numbers import Integral, Real

from ptt.documents import GREATEST
from ptt.errors import InputError, shown


def require_word(given: object, words: Iterable[str], where: str) -> None:
    """Refuse a word that is none of those that an argument takes.

    Args:
        given: what was handed over; None stands for what holds without it.
        words: that there are.
        where: the argument.

    Raises:
        InputError: it is another one.
    """
    known = tuple(words)
    if given is not None and not (isinstance(given, str) and given in known):
        names = ", ".join(f"'{word}'" for word in known)
        raise InputError(f"{shown(repr(given))} is not one of {names}", where=where, fix="take one of these")


def require_number(given: object, least: float, where: str, *, whole: bool = False, unlimited: bool = False) -> None:
    """Refuse a number that nothing can be worked out with.

    Args:
        given: what was handed over; None stands for what holds without it.
        least: the smallest that has a meaning.
        where: the argument.
        whole: whether it counts something.
        unlimited: whether it is a limit, and may be none.

    Raises:
        InputError: it is no number, not finite, below the least, or beyond any machine.
    """
    fix = f"give a {'whole ' if whole else ''}number from {least:g} on"
    if given is None:
        return
    if isinstance(given, bool) or not isinstance(given, Integral if whole else Real):
        raise InputError(f"{shown(repr(given))} is not a {'whole ' if whole else ''}number", where=where, fix=fix)
    value = float(given)
    if unlimited and value == math.inf:
        return
    if not whole:
        require_finite(value, where)
    if value < least:
        raise InputError(f"{given} is below {least:g}", where=where, fix=fix)


def require_finite(value: float, where: str) -> None:
    """Refuse a number that is not finite, or beyond any machine.

    Args:
        value: the number.
        where: the argument or option.

    Raises:
        InputError: it is such a one.
    """
    if not math.isfinite(value):
        raise InputError(f"{value} is not a finite number", where=where, fix="give a number")
    if abs(value) > GREATEST:
        raise InputError(f"{value:g} is beyond any machine", where=where, fix="correct it")
