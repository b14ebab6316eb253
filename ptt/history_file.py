"""What a [[history]] of machine.toml may hold: steps as the program writes them; a person may add entries and keys."""

import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]  # text that reads as a number is none
Figures = dict[str, float | str]  # by axis, um; NaN where nothing could be held out; the noise names its source


class HistoryFile(BaseModel):
    """A run that a step was made from."""

    model_config = ConfigDict(frozen=True, extra="allow")

    file: str
    sha256: str


class HistoryStep(BaseModel):
    """One step: every key that we read is of its kind wherever it is there at all."""

    model_config = ConfigDict(frozen=True, extra="allow")

    date: str | datetime.datetime | datetime.date = ""
    command: str = ""
    kind: str = ""
    added: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    files: tuple[HistoryFile, ...] = ()
    rows: int = 0
    helped: bool = False
    ranges: dict[str, tuple[Finite, Finite]] = {}
    error_before_um: Figures = {}
    error_after_um: Figures = {}
    heldout_before_um: Figures = {}
    heldout_after_um: Figures = {}
    noise_um: Figures = {}
    parameters_before: dict[str, dict[str, Finite | tuple[Finite, ...]]] = {}
