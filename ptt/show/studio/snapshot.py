"""A model at one time of a session, with the ladder and the commands that led to it."""

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
    """One step of a ladder.

    Attributes:
        words: the step in words.
        rms_um: axis or 'total' -> rms error of training rows; of all rows where nothing was held out.
        heldout_rms_um: the same of held-out rows; None where nothing was held out.
        helped: whether the step helped.
    """

    words: str
    rms_um: Figures
    heldout_rms_um: Figures | None
    helped: bool = True


@dataclass(frozen=True)
class Snapshot:
    """A model at one time.

    Attributes:
        text: its machine.toml, effects that are switched off included.
        off: keys of effects that are switched off.
        words: the last step in words.
        rungs: the ladder that led here.
        noise_um: axis or 'total' -> noise floor of that ladder, um.
        commands: the command lines that led here.
        removed: keys of effects that those commands have removed because they were switched off.
        fitted: the active text to which the last rung belongs.
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
    """Parameter values of an effect in a machine file.

    Args:
        entry: the effect.

    Returns:
        For each value: name with its unit, value, standard error or None, and a note ('held', 'searched', ...).
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
    """A machine file, parsed once: every view asks for it whenever anything changes."""
    return parse_machine(text, START)
