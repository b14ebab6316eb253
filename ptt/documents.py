"""TOML and JSON that a person may have written or a disk damaged: read with a clear word, within sane bounds."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from ptt.errors import InputError, shown
from ptt.record import plain

DEEPEST = 60  # levels of a TOML or JSON file; ours have 5
GREATEST = 1e12  # of any number in a TOML file: in s thirty thousand years
LONGEST = 1e7  # mm, of any `_mm` in a TOML file: ten km; beyond, doubles no longer tell a micrometre's slopes apart


def parse_toml(text: str, where: str, error: type[InputError] = InputError, fix: str = "mend it") -> dict[str, Any]:
    """Parse TOML that a person may have written.

    Args:
        text: TOML.
        where: name of the file for messages.
        error: which error to raise.
        fix: the way out where it is no TOML.

    Returns:
        The document: every number finite and below `GREATEST`, lengths below `LONGEST`, whole numbers of 64 bits, at
        most `DEEPEST` levels.

    Raises:
        InputError: it is not (as the given `error` type).
    """
    try:
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError) as failed:  # more than 4,300 digits are a plain ValueError
        raise error(f"not valid TOML: {failed}", where=where, fix=fix) from failed
    except RecursionError:
        raise error(f"more than {DEEPEST} levels of brackets", where=where, fix=fix) from None
    for key, value in walk(document, where, error):
        whole = isinstance(value, int) and not isinstance(value, bool)
        if whole and not -(2**63) <= value < 2**63:
            raise error(f"a whole number of {len(str(abs(value)))} digits", where=f"{where} key {key}", fix="mend it")
        long = any(part.endswith("_mm") for part in key.split("."))
        if isinstance(value, int | float if long else float) and abs(value) > (LONGEST if long else GREATEST):
            raise error(f"{value:g} is beyond any machine", where=f"{where} key {key}", fix="mend it")
    return document


def parse_json(text: str | bytes, where: str, *, fix: str = "mend it") -> Any:
    """Parse JSON that may have been damaged or edited.

    Args:
        text: JSON.
        where: name of the file for messages.
        fix: the way out where it is no JSON.

    Returns:
        The value, at most `DEEPEST` levels, every number finite and no whole number beyond 64 bits.

    Raises:
        InputError: it is not.
    """

    def refuse(sign: str) -> None:
        raise ValueError(f"{sign} is not a number")

    try:
        value = json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError) as failed:
        why = "too many levels of brackets" if isinstance(failed, RecursionError) else str(failed)
        raise InputError(f"not valid JSON ({why})", where=where, fix=fix) from None
    for key, item in walk(value, where, InputError):
        if isinstance(item, int | float) and not abs(item) < 2**1023:
            raise InputError("a number beyond all bounds", where=f"{where} key {key}", fix=fix)
    return value


def format_json(value: Any) -> str:
    """JSON as `parse_json` reads it; what is not finite becomes null.

    Args:
        value: of dictionaries, lists, texts, numbers, records.

    Returns:
        The text, indented.
    """
    return json.dumps(plain(value), indent=2, allow_nan=False) + "\n"


def walk(value: Any, where: str, error: type[InputError] = InputError) -> Iterator[tuple[str, Any]]:
    """Every single value of a document of tables and lists.

    Args:
        value: the document.
        where: name of the file for messages.
        error: which error to raise.

    Yields:
        Key, as in `machine.joint.0.a_mm`, and value.

    Raises:
        InputError: more than `DEEPEST` levels (as the given `error` type).
    """
    left: list[tuple[tuple[str, ...], Any]] = [((), value)]
    while left:
        path, item = left.pop()
        if len(path) > DEEPEST:
            raise error(f"more than {DEEPEST} levels", where=f"{where} key {shown('.'.join(path))}", fix="mend it")
        if isinstance(item, Mapping):
            left += [((*path, str(key)), each) for key, each in reversed(list(item.items()))]
        elif isinstance(item, list | tuple):
            left += [((*path, str(place)), each) for place, each in reversed(list(enumerate(item)))]
        else:
            yield ".".join(path), item
