"""Options for reading runs; imports nothing heavy."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ptt.errors import InputError


@dataclass(frozen=True)
class ReadOptions:
    """How runs are read.

    Attributes:
        also: further runs.
        targets: file with the targets of an export.
        set_: 'column=value' each.
        map_: saved answers on columns and units.
        effects: Python files with effects of the user's own.
        json: whether the result is for a program: no questions are asked then.
        anyway: whether to go on although the set-up looks mistaken.
        context: titles of columns of the user's own that the error may depend on.
    """

    also: Sequence[Path] | None = None
    targets: Path | None = None
    set_: Sequence[str] | None = None
    map_: Path | None = None
    effects: Sequence[Path] | None = None
    json: bool = False
    anyway: bool = False
    context: Sequence[str] | None = None

    @property
    def values(self) -> dict[str, float | str]:
        """Column -> one value for all rows."""
        return parse_settings(self.set_ or ())

    @property
    def ordered(self) -> bool:
        """Whether the user stated the order of the rows, which settles time stamps that go back."""
        return "order" in self.values

    @property
    def states_units(self) -> bool:
        """Whether a file of saved answers states units of columns."""
        if self.map_ is None or not Path(self.map_).exists():
            return False
        from ptt.run.readers import load_mapping

        return bool(load_mapping(self.map_).units)


def parse_settings(pairs: Sequence[str]) -> dict[str, float | str]:
    """Read `payload_kg=2`, and `order=time`.

    Args:
        pairs: as typed after --set.

    Returns:
        Column -> value.

    Raises:
        InputError: not of that form.
    """
    values: dict[str, float | str] = {}
    for pair in pairs:
        name, _, value = (part.strip() for part in pair.partition("="))
        try:
            values[name] = value if name == "order" else float(value)
        except ValueError:
            raise InputError(f"cannot read '{pair}'", where="--set", fix="write it as payload_kg=2") from None
    return values
