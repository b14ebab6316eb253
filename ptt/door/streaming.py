"""`ptt predict` of a list of any length: read, inverted and written in parts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from operator import add
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ptt.correct.compensate import LIMIT_MM, Reversal, plan_of
from ptt.correct.context import Beyond, beyond_context
from ptt.correct.stream import Stream
from ptt.door.model import Model
from ptt.door.opened import check_rows
from ptt.door.options import ReadOptions
from ptt.door.outputs import is_commands, refuse_readings
from ptt.door.predicting import note_frames, note_places, require_options, warnings_of
from ptt.door.result import Note, Result, ignore_note
from ptt.door.run import Targets
from ptt.door.sliders import frame_figures, sliders_columns, summary_of, text_of_figures
from ptt.door.tally import Tally, tally
from ptt.effects.late import is_late
from ptt.files import write_parts
from ptt.fitting.chunks import CHUNK, STRETCH_ROWS, stretches
from ptt.progress import Progress, unwatched
from ptt.run.blanks import has_blanks
from ptt.run.cores import map_cores
from ptt.run.readers import Ask
from ptt.run.readers.parts import NotInParts
from ptt.run.reading import read_targets_in_parts, require_pose
from ptt.run.spool import Spool
from ptt.run.target_frame import RunFrame, target_frames
from ptt.run.wanted import placed_rows, with_places
from ptt.run.written import text_of

LONG = 4 * 1024**2  # bytes: a shorter file takes less memory than the program itself
__all__ = ["NotInParts", "Streamed", "is_long", "predict_file"]


@dataclass(frozen=True, eq=False, repr=False)
class Streamed(Result):
    """Commands that were written.

    Attributes:
        out: where.
        counted: their figures.
        network: whether a network took part.
        limit_mm: largest correction that is sent.
        frames: the frames that the targets were stated in.
        warnings: what a person should know before these are sent.
    """

    out: str
    counted: Tally
    network: bool
    limit_mm: float
    frames: tuple[RunFrame, ...]
    warnings: tuple[str, ...]

    def _figures(self) -> Mapping[str, Any]:
        return summary_of(self.counted, self.out, self.network, self.limit_mm) | frame_figures(self.frames)

    def __str__(self) -> str:
        """What the command prints."""
        return text_of_figures(self.to_dict())


def is_long(path: Path) -> bool:
    """Whether a file is worth reading in parts."""
    return path.is_file() and path.stat().st_size > LONG


def predict_file(
    model: Model,
    path: Path,
    reading: ReadOptions,
    out: Path,
    *,
    reversal: Reversal | None = None,
    limit_mm: float = LIMIT_MM,
    anyway: bool = False,
    ask: Ask | None = None,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Streamed:
    """Compute commands from file to file, as `predict` does, in constant memory.

    The set-up is checked on a sample of stretches of the travel, all else on every row.

    Args:
        model: the model.
        path: the targets.
        reading: how they are read.
        out: CSV; a file with readings is never replaced, but for earlier commands beside the targets' own.
        reversal: as `predict`.
        limit_mm: as `predict`.
        anyway: as `predict`.
        ask: who answers what the file leaves open.
        progress: told what is done, how much of how much.
        note: told what was found on the way.

    Returns:
        What was written.

    Raises:
        NotInParts: the file has to be read as a whole: for the postures of an arm, growth that is late, the targets'
            frame, its format, or its empty cells.
        InputError: as `predict`.
    """
    require_options(reversal, limit_mm)
    if not is_commands(out):
        refuse_readings(out)
    if model.compensator.network is not None and model.compensator.space == "joints":
        raise NotInParts  # the network asks for the postures of all rows
    if any(is_late(term.effect, term.theta) for term in model.physics.terms):
        raise NotInParts  # how warm a body is depends on all rows before
    with TemporaryDirectory(prefix="ptt_") as name:
        folder = Path(name)
        spool, placed = _read(model, path, reading, folder, ask, progress)
        for line in spool.understood():
            note(line)
        note_places(placed, note)
        refuse_readings(out, (spool.take(*bounds).measured for bounds in stretches(spool.rows)))
        sample = spool.sample(CHUNK, STRETCH_ROWS)
        require_pose(sample)
        if sample.rows < spool.rows:
            note(f"set-up: looked at on {sample.rows} of {spool.rows} rows, stretches of {STRETCH_ROWS}")
        check_rows(model.file, Targets(sample, (path,), reading, spool.understood()), anyway=anyway, note=note)
        frames = target_frames(model.file, sample)
        if spool.commands and {frame.source for frame in frames} - {"base", "stated"}:
            raise NotInParts  # a frame that the commands tell is found from all of them
        note_frames(frames, note)
        compensator = model.compensator
        plan = plan_of(compensator.model, reversal, limit_mm, compensator.error)
        stream = Stream(plan, spool, *compensator.network_parts(), folder)
        counted, titles, beyond = _invert(stream, model, progress)
        if not stream.sent:
            stream.find_nearest()
        texts = map_cores(partial(_text, stream, titles), range(len(stream.bounds)))
        write_parts(out, texts)
        warnings = warnings_of(model, sample, counted, beyond)
    return Streamed(str(out), counted, compensator.network is not None, limit_mm, tuple(frames), warnings)


def _read(
    model: Model, path: Path, reading: ReadOptions, folder: Path, ask: Ask | None, progress: Progress
) -> tuple[Spool, int]:
    """The rows on disk, and how many got their target from the drawing."""
    spool, machine, placed = Spool(folder), model.file.machine, 0
    parts = read_targets_in_parts(
        path, machine.joints, joint_prefix=machine.letter, set_values=reading.values, mapping=reading.map_, ask=ask
    )
    for part in parts:
        if part.command is not None and model.file.machine.kind == "serial":
            raise NotInParts  # they are postures, of all rows or of none
        if has_blanks(part) or (part.role == "base").any():
            raise NotInParts  # what stands in an empty cell, rows of another part may tell
        whole = with_places(model.file, part)
        count = placed_rows(part, whole)
        if count and count < part.rows:
            raise NotInParts  # the others tell in which frame the target is stated
        placed += count
        spool.add(whole)
        progress("read", 0, 1)
    return spool, placed


def _invert(stream: Stream, model: Model, progress: Progress) -> tuple[Tally, list[str], list[tuple[Beyond, ...]]]:
    """Figures of all commands, the titles of their file, and what goes beyond the model's run, part by part."""
    figures, titles, beyond = list[Tally](), list[str](), list[tuple[Beyond, ...]]()
    for index, part in enumerate(stream.invert(progress)):
        table = stream.table(index)
        figures.append(tally(table, part.commands))
        beyond.append(beyond_context(model.physics, table, part.contexts))
        titles = merged(titles, list(sliders_columns(table, part.commands, sent=True)))
    if not stream.sent:
        table, part = stream.table(0), stream.part(0)
        titles = merged(titles, list(sliders_columns(table, part.commands, sent=False)))
    return reduce(add, figures), titles, beyond


def merged(titles: Sequence[str], more: Sequence[str]) -> list[str]:
    """Merge two lists of titles, keeping the order of both."""
    done, rest = list[str](), list(titles)
    for title in more:
        if title in rest:
            place = rest.index(title) + 1
            done, rest = done + rest[:place], rest[place:]
        else:
            done.append(title)
    return done + rest


def _text(stream: Stream, titles: Sequence[str], index: int) -> bytes:
    table = stream.table(index)
    columns = sliders_columns(table, stream.part(index).commands, sent=stream.sent)
    blank = {"name": table.name, "role": table.role}
    empty = np.full(table.rows, np.nan)
    return text_of({title: columns.get(title, blank.get(title, empty)) for title in titles}, titles=index == 0)
