"""Results as plain figures: one walk over what a result has, with the units that its keys say."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import date
from pathlib import Path
from typing import Any, ClassVar

UNITS = {"um": 1e3, "urad": 1e6, "mrad": 1e3, "deg": 180.0 / math.pi}  # from mm and rad, which the program reckons in


class Record:
    """A result that tells itself in JSON.

    `keys` lists what it tells, in order, between commas; without the list it tells its fields under their own names.
    An entry is a key, with a colon where the attribute has another name, and a unit in brackets where the key is in a
    finer one than the program's mm and rad: 'rows, sigma_um: noise.sigma [um]'. A dot in a key makes a mapping within;
    one in an attribute leads into it, by name or place; '**: moved' adds another record's own entries.
    """

    keys: ClassVar[str] = ""

    def to_dict(self) -> dict[str, Any]:
        """Its figures for JSON, keys as documented; what is not finite is None."""
        if not self.keys:
            return _fields(self)
        told: dict[str, Any] = {}
        for entry in self.keys.split(", "):
            key, _, source = entry.partition(": ")
            path, _, unit = (source or key).partition(" [")
            value = plain(_at(self, path), UNITS[unit.rstrip("]")] if unit else 1.0)
            if key == "**":
                told |= value
            else:
                _put(told, key, value)
        return told


def plain(value: Any, factor: float = 1.0) -> Any:
    """Turn records, arrays, tuples, dates and paths into what JSON knows.

    Args:
        value: of any kind.
        factor: what floating-point numbers are multiplied by.

    Returns:
        Mappings with string keys, lists, numbers, strings, None; NaN and infinities are None.
    """
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float):
        return factor * value if math.isfinite(value) else None
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {str(key): plain(item, factor) for key, item in value.items()}
    if hasattr(value, "_asdict"):
        return plain(value._asdict(), factor)
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item, factor) for item in (sorted(value) if isinstance(value, set | frozenset) else value)]
    if is_dataclass(value):
        return _fields(value)
    if isinstance(value, date):
        return value.isoformat()
    return str(value) if isinstance(value, Path) else value


def _fields(value: Any) -> dict[str, Any]:
    return {field.name: plain(getattr(value, field.name)) for field in fields(value)}


def _at(value: Any, path: str) -> Any:
    """What a path of names and places leads to; None where the way ends before."""
    for part in path.split("."):
        if value is None:
            return None
        value = value[int(part)] if part.isdigit() else getattr(value, part)
    return value


def _put(told: dict[str, Any], key: str, value: Any) -> None:
    *way, last = key.split(".")
    for part in way:
        told = told.setdefault(part, {})
    told[last] = value
