"""Opening a run and a model for a job, as the command line does; ambiguities become questions to the person."""

import io
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.show.studio.outcomes import QuestionError
from ptt.show.studio.results import ANSWERS, ORDER, Source

if TYPE_CHECKING:
    from ptt.door.opened import Opened

MODEL = "model.toml"  # file in the session's folder that the model of a job is written to
COMPENSATOR = "compensator"  # the same for a compensator, a folder


def open_both(source: Source, model: str) -> "Opened":
    """Open run and model as a verb does.

    Raises:
        QuestionError: something in the file is ambiguous.
    """
    from ptt.door.opened import open_run
    from ptt.errors import TableError

    place = place_of(model)
    with _order_asked():
        if source.answers:
            _read_asking(source, place)
        try:
            return open_run(Path(source.run), place, source.reading())
        except TableError:
            if not source.answers:
                _read_asking(source, place)
            raise


def with_saved_answers(source: Source, model: str, to: Path) -> Source:
    """Save the answers of a later run in a file of its own, so that those of the open run are not overwritten.

    Args:
        source: the later run.
        model: text of the model.
        to: file to write.

    Returns:
        The source that is read with that file; unchanged where nothing was answered.

    Raises:
        QuestionError: something has not been answered yet.
    """
    if not source.answers:
        return source
    with _order_asked():
        _read_asking(source, place_of(model), to)
    return replace(source, map_=str(to), answers=())


@contextmanager
def _order_asked() -> Iterator[None]:
    """Turn the error of time that goes back into a question, which replaces the option --set order=."""
    from ptt.run.readers.order import ORDERS, OrderError

    try:
        yield
    except OrderError as error:
        restarted = "Where the clock was restarted, number the runs in a column 'run' instead."
        raise QuestionError(f"{error.where}: {error.what}. {restarted}", ORDERS, ORDER) from error


def _read_asking(source: Source, place: Path, to: Path = Path(ANSWERS)) -> None:
    """Read with the answers given so far and save them as a file for --map; raise QuestionError for the next one."""
    from ptt.door.options import parse_settings
    from ptt.machine import load_machine
    from ptt.run.readers import save_mapping
    from ptt.run.reading import read_table
    from ptt.show.studio.answers import merge_mappings

    answers = dict(source.answers)

    def ask(question: str, choices: Any) -> str:
        if question not in answers:
            raise QuestionError(question, tuple(choices))
        return answers[question]

    spec = load_machine(place).machine
    understood = [
        read_table(
            run,
            spec.joints,
            joint_prefix=spec.letter,
            targets=source.targets or None,
            set_values=parse_settings(source.set_),
            mapping=source.map_ or None,
            ask=ask,
            ends=spec.travel_ends,
        ).understood
        for run in (source.run, *source.also)
    ]
    if source.answers:
        save_mapping(merge_mappings([each.mapping for each in understood]), to)


def place_of(model: str | bytes) -> Path:
    """Write a model (text) to `MODEL`, or a compensator (zip) to `COMPENSATOR`, and return its path."""
    from ptt.files import write_text

    if isinstance(model, bytes):
        place = Path(COMPENSATOR)
        place.mkdir(exist_ok=True)
        with zipfile.ZipFile(io.BytesIO(model)) as archive:
            for name in archive.namelist():
                (place / Path(name).name).write_bytes(archive.read(name))
        return place
    write_text(MODEL, model)
    return Path(MODEL)


def zipped(files: Iterable[Path], within: Path) -> bytes:
    """Files as a zip, by their paths within a folder."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(files):
            archive.write(file, file.relative_to(within))
    return content.getvalue()
