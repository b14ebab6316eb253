"""machine.toml <-> typed objects: one schema for a bare machine and for a fitted model."""

import difflib
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pydantic
import tomlkit
from pydantic import BaseModel, Field

from ptt.drawing import Frozen, JointSpec, MachineSpec, SerialSpec, Sigma, ThreePttSpec, Triple
from ptt.errors import MachineError, shown
from ptt.files import parse_toml, read_text, write_text
from ptt.history_file import HistoryStep

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


class ControllerSpec(Frozen):
    """What the controller corrects by itself already; the program never adds it twice."""

    compensates: tuple[str, ...] = ()


class BasePoint(Frozen):
    """A reflector fixed to the base whose place in the base frame is known."""

    name: str
    xyz_mm: Triple
    sigma_mm: Sigma = 0.005


class TrackerSpec(Frozen):
    """How readings relate to the base frame, and how well one coordinate is read."""

    frame: Literal["fitted", "trusted", "fitted-per-run", "measured"] = "fitted"
    sigma_mm: Sigma | None = None
    tool: Literal["fitted", "fitted-per-run", "trusted"] = "trusted"
    base_point: tuple[BasePoint, ...] = ()

    @pydantic.model_validator(mode="after")
    def _check_base(self) -> "TrackerSpec":
        if self.frame == "measured" and len(self.base_point) < 3:
            raise ValueError('frame = "measured" needs at least three [[tracker.base_point]] entries')
        return self


class TargetsSpec(Frozen):
    """The frame in which targets are stated: where its origin lies in the base frame, and how it is turned there.

    Found from runs that hold joint commands beside targets. `turn_deg` is a rotation vector; base = R target + origin.
    "base" says that targets are in the base frame and nothing else may be found, "unknown" that runs contradict.
    """

    frame: Literal["fitted", "base", "unknown"] = "fitted"
    origin_mm: Triple = (0.0, 0.0, 0.0)
    turn_deg: Triple = (0.0, 0.0, 0.0)

    @pydantic.model_validator(mode="after")
    def _check_frame(self) -> "TargetsSpec":
        if self.frame != "fitted" and (any(self.origin_mm) or any(self.turn_deg)):
            raise ValueError('origin_mm and turn_deg go with frame = "fitted" only')
        return self


class MaskedSpec(Frozen):
    """What a run says of effects that the model does not have; written and read by `ptt.fitting.masked`.

    Attributes:
        of: keys of the effects.
        told: packed.
    """

    of: tuple[str, ...]
    told: str


class CovarianceSpec(Frozen):
    """What a fit left uncertain, parameters and tracker frame together; written and read by `ptt.fitting.kept`.

    Attributes:
        of: names of the parameters.
        root: square root of the covariance, packed.
        values: digest of the parameter values that it belongs to.
        heldout_mm: error of rows that the fit had not seen.
        helped: whether these were foretold better than by the drawing, beyond chance; None where nobody knows.
        masked: effects that the model does not have, and what its run says of them.
    """

    of: tuple[str, ...]
    root: str
    values: str
    heldout_mm: float | None = None
    helped: bool | None = None
    masked: MaskedSpec | None = None


class ParameterEntry(Frozen):
    """A fitted parameter: value and standard deviation, a number or one per leg, joint or knot."""

    value: float | tuple[float, ...]
    std: float | tuple[float | None, ...] | None = None
    measured: bool | tuple[bool, ...] | None = None
    fixed: bool = False


class EffectEntry(Frozen):
    """One effect of a fitted model."""

    name: str
    label: str = ""
    runs: tuple[str, ...] = ()  # SHA-256 of the runs that it belongs to, in their order; none: it is the machine's
    parameters: dict[str, ParameterEntry] = Field(default_factory=dict)


class _Document(Frozen):
    machine: MachineSpec
    controller: ControllerSpec = ControllerSpec()
    tracker: TrackerSpec = TrackerSpec()
    targets: TargetsSpec = TargetsSpec()
    effect: tuple[EffectEntry, ...] = ()
    history: tuple[dict[str, Any], ...] = ()
    covariance: CovarianceSpec | None = None


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
    try:
        document = _Document.model_validate(raw)
    except pydantic.ValidationError as error:
        raise _explain(error, where) from None
    for number, row in enumerate(document.history, 1):
        if row.keys() & {"kind", "added"}:  # else it is a person's own
            try:
                HistoryStep.model_validate(row)
            except pydantic.ValidationError as error:
                raise _explain(error, f"{where} history entry {number}") from None
    return MachineFile(
        document.machine, document.controller, document.tracker, document.effect, document.history, document.targets,
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
    if file.text and file.targets != _Document.model_validate(tomllib.loads(file.text)).targets:
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


def _explain(error: pydantic.ValidationError, where: str) -> MachineError:
    """Turn the first of pydantic's findings into one line."""
    # A misspelt key is also a missing one; the misspelling is what the user can see.
    first = min(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"] if part not in ("three-ptt", "serial")]
    place = f"{where} key {'.'.join(path)}" if path else where
    if first["type"] == "extra_forbidden":
        guess = difflib.get_close_matches(path[-1], _known_keys(), n=1)
        fix = f"did you mean '{guess[0]}'?" if guess else "remove it"
        return MachineError(
            f"unknown key '{shown(path[-1])}'", where=where, fix=f"{fix} (in {'.'.join(path[:-1]) or 'top'})"
        )
    if first["type"] == "missing":
        return MachineError("missing", where=place, fix="add it; README lists the keys of a machine file")
    if first["type"].startswith("union_tag"):
        given = first["input"].get("kind") if isinstance(first["input"], dict) else first["input"]
        return MachineError(
            f"kind {shown(given)} is not known",
            where=place,
            fix='use kind = "three-ptt" or kind = "serial"',
        )
    message = first["msg"].removeprefix("Value error, ")
    found = "" if isinstance(first["input"], dict) else f" (found {shown(repr(first['input']))})"
    return MachineError(f"{message[0].lower()}{message[1:]}{found}", where=place)


def _known_keys() -> list[str]:
    models = (
        _Document,
        ThreePttSpec,
        SerialSpec,
        JointSpec,
        ControllerSpec,
        TrackerSpec,
        TargetsSpec,
        BasePoint,
        EffectEntry,
    )
    return [name for model in models for name in model.model_fields] + list(ParameterEntry.model_fields)
