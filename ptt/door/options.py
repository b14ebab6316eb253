"""Options for reading runs; imports nothing heavy."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
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
    def words(self) -> tuple[str, ...]:
        """These options as words of a command line, `--json` and `--context` left out."""
        several = {"--also": self.also, "--set": self.set_, "--effects": self.effects}
        single = {"--targets": self.targets, "--map": self.map_}
        pairs = [(flag, each) for flag, given in several.items() for each in given or ()]
        pairs += [(flag, given) for flag, given in single.items() if given is not None]
        return (*(str(word) for pair in pairs for word in pair), *(["--anyway"] if self.anyway else []))

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


def parse_numbers(text: str, where: str, count: int | None = None) -> tuple[float, ...]:
    """Read positive numbers separated by commas.

    Args:
        text: as typed; '' for none.
        where: the option, for messages.
        count: how many there must be; None for any.

    Returns:
        The numbers.

    Raises:
        InputError: not numbers, negative, or not as many.
    """
    fix = "write them as 60,60,50" if count == 3 else "write them as 0,2.5,5"
    try:
        values = tuple(float(part) for part in text.split(",")) if text.strip() else ()
    except ValueError:
        raise InputError(f"cannot read '{text}'", where=where, fix=fix) from None
    if any(value < 0 or not isfinite(value) for value in values) or (values and count not in (None, len(values))):
        raise InputError(f"cannot use '{text}'", where=where, fix=fix)
    return values
