"""Validation of words and numbers passed as arguments, with the same messages as the options of the command line."""

import math
from collections.abc import Iterable
from numbers import Integral, Real

from ptt.documents import GREATEST
from ptt.errors import InputError, shown


def require_word(given: object, words: Iterable[str], where: str) -> None:
    """Refuse a word that an argument does not take.

    Args:
        given: the value; None is the default and always allowed.
        words: allowed words.
        where: name of the argument, for the message.

    Raises:
        InputError: it is not one of them.
    """
    known = tuple(words)
    if given is not None and not (isinstance(given, str) and given in known):
        names = ", ".join(f"'{word}'" for word in known)
        raise InputError(f"{shown(repr(given))} is not one of {names}", where=where, fix="take one of these")


def require_number(given: object, least: float, where: str, *, whole: bool = False, unlimited: bool = False) -> None:
    """Refuse a number out of range.

    Args:
        given: the value; None is the default and always allowed.
        least: smallest allowed value.
        where: name of the argument, for the message.
        whole: whether it has to be an integer.
        unlimited: whether infinity is allowed, as no limit.

    Raises:
        InputError: it is not a number, not finite, below the least, or larger than `GREATEST`.
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
    """Refuse a number that is not finite, or larger than any machine needs.

    Args:
        value: the number.
        where: the argument or option, for the message.

    Raises:
        InputError: it is not finite, or larger than `GREATEST`.
    """
    if not math.isfinite(value):
        raise InputError(f"{value} is not a finite number", where=where, fix="give a number")
    if abs(value) > GREATEST:
        raise InputError(f"{value:g} is beyond any machine", where=where, fix="correct it")
