"""What compensator.json holds, so that a damaged or edited one is refused by its key."""

from typing import Annotated, Any, Literal

import pydantic
from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, NonNegativeInt

from ptt.errors import InputError, shown

Micrometres = Annotated[float, Field(ge=0.0, le=1e9)]


class _Kept(BaseModel):
    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False, strict=True)


class _Figures(_Kept):
    x: Micrometres | None
    y: Micrometres | None
    z: Micrometres | None
    total: Micrometres | None


class _Source(_Kept):
    file: str
    sha256: str


class _Network(_Kept):
    centres: NonNegativeInt
    learned: Annotated[list[bool], Field(min_length=3, max_length=3)]
    share: float
    spread: NonNegativeFloat | None = None
    inputs: Literal["tool", "joints"] = "tool"
    heldout_by_inputs_um: dict[str, Any] = {}


class _Notes(_Kept):
    format: Annotated[int, Field(ge=1, le=1)]  # a Literal would take true for one
    sha256: dict[str, str]
    trained_on: list[_Source]
    heldout_rms_um: dict[str, _Figures]
    protocol: str
    rbf: _Network
    rms_um: dict[str, _Figures] = {}
    noise_um: dict[str, Any] = {}


def check_notes(notes: Any, where: str) -> dict[str, Any]:
    """Refuse notes that this program did not write.

    Args:
        notes: what compensator.json holds.
        where: the folder, for messages.

    Returns:
        The same.

    Raises:
        InputError: a key is missing, or of the wrong kind.
    """
    try:
        _Notes.model_validate(notes)
    except pydantic.ValidationError as error:
        first = error.errors()[0]
        key = shown(".".join(map(str, first["loc"]))) or "the whole"
        why = f"{key}: {first['msg'].lower()} (found {shown(repr(first['input']))})"
        what = f"not a whole compensator: compensator.json, {why}"
        raise InputError(what, where=where, fix="train it again") from None
    return dict(notes)
