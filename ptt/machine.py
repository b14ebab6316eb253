"""machine.toml <-> typed objects: one schema for a bare machine and for a fitted model."""

import json
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pydantic
import tomlkit
from pydantic import BaseModel

from ptt.documents import parse_toml
from ptt.drawing import JointSpec, MachineSpec, SerialSpec, ThreePttSpec
from ptt.errors import MachineError
from ptt.files import read_text, write_text
from ptt.history_file import HistoryStep
from ptt.machine_schema import (
    ControllerSpec,
    CovarianceSpec,
    Document,
    EffectEntry,
    ParameterEntry,
    TargetsSpec,
    TrackerSpec,
    explain,
)

__all__ = [
    "JointSpec",
    "MachineFile",
    "MachineSpec",
    "SerialSpec",
    "ThreePttSpec",
    "load_machine",
    "parse_machine",
    "save_machine",
]


@dataclass(frozen=True)
class MachineFile:
    """A machine.toml in memory.

    Attributes:
        machine: the drawing.
        controller: what the controller compensates by itself.
        tracker: how readings relate to the base frame.
        effect: fitted effects, none for a bare machine.
        history: one entry per step that led here, oldest first.
        targets: the frame in which targets are stated.
        covariance: what the last fit left uncertain.
        text: the text it was read from, so that a person's comments survive a rewrite.
        source: the file's name for messages.
    """

    machine: ThreePttSpec | SerialSpec
    controller: ControllerSpec = field(default_factory=ControllerSpec)
    tracker: TrackerSpec = field(default_factory=TrackerSpec)
    effect: tuple[EffectEntry, ...] = ()
    history: tuple[dict[str, Any], ...] = ()
    targets: TargetsSpec = field(default_factory=TargetsSpec)
    covariance: CovarianceSpec | None = None
    text: str = field(default="", repr=False, compare=False)
    source: str = field(default="machine.toml", compare=False)

    @property
    def steps(self) -> tuple[dict[str, Any], ...]:
        """The entries of the history without a person's own, which have no kind."""
        return tuple(entry for entry in self.history if "kind" in entry)


def load_machine(path: str | Path) -> MachineFile:
    """Read a machine.toml.

    Args:
        path: the file.

    Returns:
        The machine with its fitted effects and history.

    Raises:
        MachineError: the file is missing, not TOML, or not a machine.
    """
    return parse_machine(read_text(path, MachineError), str(path))


def parse_machine(text: str, where: str = "machine.toml") -> MachineFile:
    """Parse the text of a machine.toml.

    Args:
        text: TOML.
        where: name of the file for messages.

    Returns:
        The machine with its fitted effects and history.

    Raises:
        MachineError: not TOML, a key that is unknown or missing, a value out of bounds.
    """
    raw = parse_toml(text, where, MachineError, "is this a machine file?")
    past = raw.get("history", [])
    steps = [{} if isinstance(row, dict) else row for row in past] if isinstance(past, list) else past
    try:
        # As JSON: a list may stand for a tuple there, but a text or `true` never for a number.
        plain = json.dumps(raw | {"history": steps}, default=lambda value: {type(value).__name__: str(value)})
        document = Document.model_validate_json(plain, strict=True)
    except pydantic.ValidationError as error:
        raise explain(error, where) from None
    for number, row in enumerate(past, 1):
        if row.keys() & {"kind", "added"}:  # else it is a person's own
            try:
                HistoryStep.model_validate(row)
            except pydantic.ValidationError as error:
                raise explain(error, f"{where} history entry {number}") from None
    return MachineFile(
        document.machine, document.controller, document.tracker, document.effect, tuple(past), document.targets,
        document.covariance, text, where,
    )  # fmt: skip


def format_machine(file: MachineFile) -> str:
    """Write a machine as TOML, a person's comments in the head kept.

    Args:
        file: the machine.

    Returns:
        TOML text that `parse_machine` reads back to an equal value.
    """
    document = tomlkit.parse(file.text) if file.text else _bare(file)
    for key in ("effect", "covariance", "history"):
        document.pop(key, None)
    told = Document.model_validate(tomllib.loads(file.text)) if file.text else None
    if told is not None and file.machine.moves != told.machine.moves:  # all that is ever learned of a drawing
        document["machine"]["moves"] = file.machine.moves
    if told is not None and file.targets != told.targets:
        document.pop("targets", None)
        if file.targets != TargetsSpec():
            document["targets"] = _section(file.targets)
    if file.effect:
        document["effect"] = _effects(file.effect)
    if file.covariance is not None:
        document["covariance"] = _section(file.covariance)
    if file.history:
        document["history"] = _tables(file.history)
    return tomlkit.dumps(document)


def save_machine(file: MachineFile, path: str | Path) -> None:
    """Write a machine.toml whole or not at all.

    Args:
        file: the machine.
        path: where to.
    """
    write_text(path, format_machine(file))


def _bare(file: MachineFile) -> tomlkit.TOMLDocument:
    document = tomlkit.document()
    for key in ("machine", "controller", "tracker", "targets"):
        values = _section(getattr(file, key))
        if key == "machine":
            values = {"kind": file.machine.kind, **values}
        if values:
            document[key] = values
    return document


def _section(spec: BaseModel) -> dict[str, Any]:
    return spec.model_dump(mode="json", exclude_defaults=True, exclude_none=True)


def _effects(entries: tuple[EffectEntry, ...]) -> Any:
    tables = tomlkit.aot()
    for entry in entries:
        table = tomlkit.table()
        table["name"] = entry.name
        if entry.label:
            table["label"] = entry.label
        if entry.runs:
            table["runs"] = list(entry.runs)
        parameters = tomlkit.table()
        for name, parameter in entry.parameters.items():
            inline = tomlkit.inline_table()
            inline.update(_inline(parameter))
            parameters[name] = inline
        table["parameters"] = parameters
        tables.append(table)
    return tables


def _inline(parameter: ParameterEntry) -> dict[str, Any]:
    values = parameter.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    std = values.get("std")
    if isinstance(std, list) and any(item is None for item in std):
        # TOML knows no null: a deviation that was never found is written as nan by nobody, so the list is left out.
        values.pop("std")
    return {"value": values.pop("value"), **values}


def _tables(rows: tuple[dict[str, Any], ...]) -> Any:
    tables = tomlkit.aot()
    for row in rows:
        table = tomlkit.table()
        table.update(row)
        tables.append(table)
    return tables
