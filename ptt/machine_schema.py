"""What stands in a machine.toml, key by key: the drawing aside, which is `ptt.drawing`'s."""

import difflib
import math
from itertools import combinations
from typing import Any, Literal

import pydantic
from pydantic import Field, NonNegativeFloat

from ptt.drawing import Frozen, JointSpec, MachineSpec, SerialSpec, Sigma, ThreePttSpec, Triple
from ptt.errors import MachineError, shown

SAME_PLACE = 0.1  # mm: no two reflectors are as close


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
        for one, other in combinations(self.base_point if self.frame == "measured" else (), 2):
            if one.name == other.name:
                raise ValueError(f"two [[tracker.base_point]] are named '{shown(one.name)}'; give each its own name")
            if math.dist(one.xyz_mm, other.xyz_mm) < SAME_PLACE:
                raise ValueError(
                    f"[[tracker.base_point]] '{shown(one.name)}' and '{shown(other.name)}' are at one place; "
                    "write where each of them is"
                )
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
    """What a run says of effects that the model does not have; written and read by the modules of `ptt.fitting`.

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
        drawing: the same of the drawing.
        heldout_mm: error of rows that the fit had not seen.
        helped: whether these were predicted better than by the drawing, beyond chance; None where nobody knows.
        masked: effects that the model does not have, and what its run says of them.
        unnamed: sizes of the drawing among them, and how far they leave the model open.
        turns: travel of a wind-up of each joint that the run cannot tell from play, mm or rad.
    """

    of: tuple[str, ...]
    root: str
    values: str
    drawing: str
    heldout_mm: float | None = None
    helped: bool | None = None
    masked: MaskedSpec | None = None
    unnamed: MaskedSpec | None = None
    turns: tuple[NonNegativeFloat, ...] = ()


class ParameterEntry(Frozen):
    """A fitted parameter: value and standard deviation, a number or one per leg, joint or knot."""

    value: float | tuple[float, ...]
    std: NonNegativeFloat | tuple[NonNegativeFloat | None, ...] | None = None
    measured: bool | tuple[bool, ...] | None = None
    fixed: bool = False


def key_of(name: str, label: str) -> str:
    """What an effect goes by: its name, with the label in brackets where there is one."""
    return f"{name}[{label}]" if label else name


class EffectEntry(Frozen):
    """One effect of a fitted model."""

    name: str
    label: str = ""
    runs: tuple[str, ...] = ()  # SHA-256 of the runs that it belongs to, in their order; none: it is the machine's
    parameters: dict[str, ParameterEntry] = Field(default_factory=dict)

    @property
    def key(self) -> str:
        """Name, with the label in brackets where there is one."""
        return key_of(self.name, self.label)


class Document(Frozen):
    """The whole of a machine.toml."""

    machine: MachineSpec
    controller: ControllerSpec = ControllerSpec()
    tracker: TrackerSpec = TrackerSpec()
    targets: TargetsSpec = TargetsSpec()
    effect: tuple[EffectEntry, ...] = ()
    history: tuple[dict[str, Any], ...] = ()
    covariance: CovarianceSpec | None = None


FORMS = ("three-ptt", "serial", "float", "constrained-float")  # what pydantic puts among the keys
FIXES = {"reference_temp_c": "give it in degrees C, such as 20", "std": "give a standard deviation, zero or more"}


def explain(error: pydantic.ValidationError, where: str) -> MachineError:
    """Turn the first of pydantic's findings into one line."""
    # A misspelt key is also a missing one; the misspelling is what the user can see.
    first = min(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    # Of the forms that a value may have, the one that it comes closest to: its error lies deepest.
    alike = [item for item in error.errors() if _path(item["loc"])[: len(_path(first["loc"]))] == _path(first["loc"])]
    first = max(alike, key=lambda item: len(_path(item["loc"])))
    path = _path(first["loc"])
    place = f"{where} key {'.'.join(path).replace('.[', '[')}" if path else where
    if first["type"] == "extra_forbidden":
        return MachineError(f"unknown key '{shown(path[-1])}'", where=where, fix=_instead_of(path, first["loc"]))
    if first["type"] == "missing":
        return MachineError("missing", where=place, fix="add it; docs/files.md shows a machine file with its keys")
    if first["type"].startswith("union_tag"):
        given = first["input"].get("kind") if isinstance(first["input"], dict) else first["input"]
        if given is None:
            return MachineError("key kind is missing", where=place, fix='add kind = "three-ptt" or kind = "serial"')
        return MachineError(
            f"kind {shown(given)} is not known",
            where=place,
            fix='use kind = "three-ptt" or kind = "serial"',
        )
    message = first["msg"].removeprefix("Value error, ")
    if _is_too_low(first):
        message, number = "has to be above zero", f"write a positive number{_unit_of(path)}"
    elif first["type"] in ("float_type", "int_type"):
        number = "write it as a plain number"
    else:
        number = ""
    found = "" if isinstance(first["input"], dict) else f" (found {shown(repr(first['input']))})"
    fix = next((FIXES[part] for part in reversed(path) if part in FIXES), number)
    return MachineError(f"{message[0].lower()}{message[1:]}{found}", where=place, fix=fix)


def _is_too_low(finding: Any) -> bool:
    """Whether a number is zero or below where a positive one belongs, whatever tiny size is the least."""
    least = finding.get("ctx", {}).get("gt", finding.get("ctx", {}).get("ge"))
    positive = finding["type"] == "greater_than" or (finding["type"] == "greater_than_equal" and least)
    return bool(positive) and 0.0 <= least < 1.0 and finding["input"] <= 0.0


def _unit_of(path: list[str]) -> str:
    """The unit of a number by its key, as in ' of mm'; '' where the key says none."""
    unit = next((part for part in reversed(path) if not part.startswith("[")), "").rpartition("_")[2]
    return f" of {unit}" if unit in ("mm", "kg", "rad", "deg") else ""


def _path(loc: tuple[int | str, ...]) -> list[str]:
    """Keys on the way to a finding, without the forms that a value may have."""
    kept = [part for part in loc if part not in FORMS and not str(part).startswith("tuple[")]
    return [_counted(part) for part in kept]


def _counted(part: int | str) -> str:
    """A part of a key's place; what stands in a list is counted from one, as people do."""
    return f"[{part + 1}]" if isinstance(part, int) else part


def _instead_of(path: list[str], loc: tuple[int | str, ...]) -> str:
    """What to do about a key that is not known where it stands; of another kind of machine no key is suggested."""
    here = ".".join(path[:-1]).replace(".[", "[") or "the top of the file"
    homes = [name for name, models in SECTIONS.items() if any(path[-1] in model.model_fields for model in models)]
    if homes:
        return f"it belongs in {' or '.join(homes)} (this is {here})"
    if path[0] == "effect" and len(path) == 3:
        return f"values of an effect belong in [effect.parameters] (this is {here})"
    others = {"three-ptt": (SerialSpec, JointSpec), "serial": (ThreePttSpec,)}
    foreign = next((models for kind, models in others.items() if kind in loc), ())
    guess = difflib.get_close_matches(path[-1], _known_keys(foreign), n=1)
    return f"did you mean '{guess[0]}'? (in {here})" if guess else f"remove it (in {here})"


def _known_keys(foreign: tuple[type[Frozen], ...]) -> list[str]:
    known = (model for models in SECTIONS.values() for model in models if model not in foreign)
    return [name for model in known for name in model.model_fields]


SECTIONS: dict[str, tuple[type[Frozen], ...]] = {
    "the top of the file": (Document,),
    '[machine] of kind = "three-ptt"': (ThreePttSpec,),
    '[machine] of kind = "serial"': (SerialSpec,),
    "[[machine.joint]]": (JointSpec,),
    "[controller]": (ControllerSpec,),
    "[tracker]": (TrackerSpec,),
    "[targets]": (TargetsSpec,),
    "[[tracker.base_point]]": (BasePoint,),
    "[[effect]]": (EffectEntry,),
    "a value of [effect.parameters]": (ParameterEntry,),
}
