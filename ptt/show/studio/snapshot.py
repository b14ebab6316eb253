"""A model at one time, and the ladder that led to it; values only."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.machine_schema import EffectEntry
from ptt.show.studio.steps import START

Figures = Mapping[str, float]


@dataclass(frozen=True)
class Rung:
    """One step of the ladder: words, RMS in um, and whether the step helped.

    The RMS is of training and of held-out rows; where nothing was held out, it is the plain one of all rows.
    """

    words: str
    rms_um: Figures
    heldout_rms_um: Figures | None
    helped: bool = True


@dataclass(frozen=True)
class Snapshot:
    """A model at one time.

    Attributes:
        text: its machine.toml.
        off: keys of effects that are switched off for now.
        words: what was done last.
        rungs: the ladder that led here.
        noise_um: noise floor of that ladder.
        commands: the commands that led here.
        removed: effects that those commands removed because they were switched off.
        fitted: the active text that the last rung describes.
        fit: the last fit in words.
    """

    text: str
    off: frozenset[str] = frozenset()
    words: str = "as given"
    rungs: tuple[Rung, ...] = ()
    noise_um: Mapping[str, Any] = field(default_factory=dict)
    commands: tuple[str, ...] = ()
    removed: frozenset[str] = frozenset()
    fitted: str = ""
    fit: str = ""

    @property
    def file(self) -> MachineFile:
        """The machine file, switched-off effects included."""
        return parsed(self.text)

    @property
    def active(self) -> str:
        """The machine.toml without the effects that are switched off."""
        if not self.off:
            return self.text
        file = self.file
        kept = tuple(entry for entry in file.effect if entry.key not in self.off)
        return format_machine(replace(file, effect=kept))


def parameter_rows(entry: EffectEntry) -> list[tuple[str, float, float | None, str]]:
    """Parameters of an effect of a machine file.

    Args:
        entry: the effect.

    Returns:
        Name with its unit, value, standard error or None, and what is to be said of it, for each number.
    """
    rows = []
    for name, item in entry.parameters.items():
        values = item.value if isinstance(item.value, tuple) else (item.value,)
        stds = item.std if isinstance(item.std, tuple) else (item.std,) * len(values)
        flags = item.measured if isinstance(item.measured, tuple) else (item.measured,) * len(values)
        for index, (value, std, seen) in enumerate(zip(values, stds, flags, strict=True), 1):
            unseen = "not measured by this data" if len(values) == 1 else "by itself not measured by this data"
            word = "held" if item.fixed else unseen if seen is False else "" if std else "searched"
            label = f"{name} {index}" if len(values) > 1 else name
            rows.append((label, value, std if seen is not False else None, word))
    return rows


@lru_cache(maxsize=64)
def parsed(text: str) -> MachineFile:
    """A machine file, read once: every view asks for it whenever anything changes."""
    return parse_machine(text, START)
