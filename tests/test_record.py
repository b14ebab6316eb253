"""Results tell themselves in JSON by one walk."""

import json
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
import pytest

from ptt.record import Record, plain


class Pair(NamedTuple):
    """Two figures."""

    value: float
    std: float | None


@dataclass(frozen=True)
class Inner(Record):
    """Told under its own names."""

    on: date
    file: Path
    shift: tuple[float, ...]


@dataclass(frozen=True)
class Outer(Record):
    """Told by its keys."""

    keys: ClassVar[str] = (
        "size_um: size [um], turn_deg: turn [deg], each.x: sigma.0 [um], each.y: sigma.1 [um], inner, "
        "none.at: none.on, of: inner.shift.1, pair, **: more, twice"
    )
    size: float
    turn: float
    sigma: np.ndarray
    inner: Inner
    none: Inner | None
    pair: Pair
    more: Inner

    @property
    def twice(self) -> float:
        """Reckoned, not kept."""
        return 2.0 * self.size


def test_a_record_is_told_by_its_keys_in_their_units() -> None:
    inner = Inner(date(2024, 3, 15), Path("a/b.csv"), (1.0, float("inf")))
    told = Outer(0.25, np.pi, np.array([1e-3, np.nan]), inner, None, Pair(1.0, None), inner).to_dict()
    own = {"on": "2024-03-15", "file": "a/b.csv", "shift": [1.0, None]}
    assert list(told) == ["size_um", "turn_deg", "each", "inner", "none", "of", "pair", "on", "file", "shift", "twice"]
    assert told["size_um"] == 250.0
    assert told["turn_deg"] == pytest.approx(180.0)
    assert told["each"] == {"x": 1.0, "y": None}
    assert told["inner"] == own
    assert told["none"] == {"at": None}
    assert told["of"] is None
    assert told["pair"] == {"value": 1.0, "std": None}
    assert told["twice"] == 0.5
    json.dumps(told, allow_nan=False)


def test_a_key_without_its_attribute_fails() -> None:
    class Wrong(Record):
        keys: ClassVar[str] = "rows, lines"
        rows = 3

    with pytest.raises(AttributeError, match="lines"):
        Wrong().to_dict()


def test_whole_numbers_and_truths_stay_what_they_are() -> None:
    assert plain({"n": np.int64(3), "ok": np.bool_(True), 2: {"b", "a"}}, 1e3) == {"n": 3, "ok": True, "2": ["a", "b"]}
