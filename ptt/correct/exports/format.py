"""Interface of every export: options in; files written, effects held and remaining error out."""

import datetime
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self

from ptt.progress import Progress, unwatched
from ptt.record import Record

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator
    from ptt.run.table import Table

THREE_PTT, SERIAL = "three-ptt", "serial"
GAIN, LEAST_UM = 1.2, 1.0  # ratio to the error of the whole model, and excess in um, from which that is recommended
NOTHING_TO_GAIN = "this file is no better than the drawing; there is nothing to gain by loading it"
USELESS = "this file corrects almost nothing, so do not use it"
MORE = 0.95  # share of the drawing's error from which a file counts as correcting nothing


@dataclass(frozen=True)
class CannotHold:
    """An effect of the model that a format cannot represent.

    Attributes:
        effect: its key.
        why: in words.
    """

    effect: str
    why: str


@dataclass(frozen=True)
class ErrorLeft:
    """Remaining error of the tool over the workspace, root mean square length in um.

    Attributes:
        drawing: with commands by the drawing alone.
        format: with the commands of a controller that uses the export.
        model: with commands by the whole model: its uncertainty and the residual of its solution.
    """

    drawing: float
    format: float
    model: float

    @classmethod
    def told(cls, figures: Mapping[str, float | None]) -> Self:
        """From the figures of `to_dict` of an export; unknown ones are NaN."""
        return cls(**{key: math.nan if value is None else value for key, value in figures.items()})

    @property
    def corrects(self) -> bool:
        """Whether the export corrects a noticeable part of the drawing's error."""
        return self.format < MORE * self.drawing

    @property
    def gains(self) -> bool:
        """Whether the whole model would do noticeably better than the export."""
        return self.format >= max(GAIN * self.model, self.model + LEAST_UM)


def said_held(holds: Sequence[str], cannot: Sequence[str], left: ErrorLeft, *, network: bool = False) -> str:
    """The part of the model that a file holds, in words.

    Args:
        holds: keys of the effects that are in it.
        cannot: keys of the others.
        left: its remaining error.
        network: whether a network is in it.

    Returns:
        Their names, or a phrase where it holds none completely.
    """
    if holds or network:
        return ", ".join([*holds, *(["the network"] if network else [])])
    if not cannot and not left.corrects:
        return "the drawing, for the model has no effects"
    if left.corrects:
        return f"no effect completely; its figures include what they can of the {'others' if cannot else 'network'}"
    if math.isnan(left.format) or math.isnan(left.drawing):
        return "no effect completely"
    return "no effect completely; it is hardly better than the drawing"


@dataclass(frozen=True)
class Written(Record):
    """Result of an export.

    Attributes:
        written: files, in the order of writing.
        holds: keys of the effects that are in them.
        cannot_hold: the others that commands of `ptt predict` compensate, and why.
        error_um: remaining error.
        notes: further notes for the user, one line each.
        network: whether the model's network is in them.
    """

    written: tuple[Path, ...]
    holds: tuple[str, ...]
    cannot_hold: tuple[CannotHold, ...]
    error_um: ErrorLeft
    notes: tuple[str, ...] = ()
    network: bool = False


@dataclass(frozen=True)
class Options:
    """Options of an export.

    Attributes:
        model_path: machine file or compensator folder that the model came from; None where it came from neither.
        step: distance of table entries, mm of axis or workspace, deg of an arm's joint; None takes the format's own.
        table: a run; where one is given, errors are judged at the payloads, temperatures and speeds of its rows.
        date: of the export, for the head of the files.
        progress: told what is done, how much of how much.
    """

    model_path: Path | None = None
    step: float | None = None
    table: "Table | None" = None
    date: datetime.date = field(default_factory=datetime.date.today)
    progress: Progress = unwatched


# Signature of every format's `write`: model with network, output path, options -> result.
Write = Callable[["Compensator", Path, Options], Written]


@dataclass(frozen=True)
class Format:
    """An export format.

    Attributes:
        name: after --to.
        module: where its `write` is.
        mechanisms: which machines it is for.
        about: one line.
        stepped: whether --step applies to it.
    """

    name: str
    module: str
    mechanisms: tuple[str, ...]
    about: str
    stepped: bool = False
