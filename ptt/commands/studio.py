"""`ptt studio`: the local page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import Also, Effects, Map, Set, Targets

if TYPE_CHECKING:
    from ptt.show.studio.server import Opening

PORT = 8317


def studio(
    run: Annotated[Path | None, typer.Argument(metavar="[RUN.csv]", help="Tracker run to start with.")] = None,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="M", help="machine.toml or compensator folder to start with.")
    ] = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port on 127.0.0.1; 0 takes a free one.")
    ] = PORT,
    show: Annotated[bool, typer.Option("--show/--no-show", help="Open the browser.")] = True,
    store: Annotated[
        Path | None, typer.Option("--store", metavar="DIR", help="Folder for sessions (default: in your home folder).")
    ] = None,
) -> None:
    """Open the studio, a page on this computer: look at a run, add effects, watch the error fall."""
    import importlib.util

    from ptt.errors import InputError

    if importlib.util.find_spec("nicegui") is None:
        raise InputError("the studio needs nicegui", where="ptt studio", fix="pip install 'ptt[studio]'")
    from ptt.show.studio.server import serve

    opening = read_opening(run, model, also, targets, set_, map_, effects)
    serve(
        opening,
        port,
        show,
        lambda place: typer.echo(f"ptt studio at {place} (Ctrl+C ends it)"),
        lambda words: typer.echo(words, err=True),
        store,
    )


def read_opening(
    run: Path | None, model: Path | None, also: Also, targets: Targets, set_: Set, map_: Map, effects: Effects
) -> "Opening":
    """Read the files that were named; every tab gets copies of its own, by name.

    Args:
        run: tracker CSV.
        model: machine.toml or compensator folder, whose model.toml is taken.
        also: further runs.
        targets: targets of an export.
        set_: 'column=value' each.
        map_: saved answers.
        effects: Python files of the user's own effects.

    Returns:
        What a tab starts with.

    Raises:
        InputError: a file that is not there, or a machine that cannot be used.
    """
    from ptt.correct.training.machine_of import machine_of
    from ptt.errors import InputError
    from ptt.machine import format_machine
    from ptt.show.studio.results import Source
    from ptt.show.studio.server import Opening

    groups = [[run] if run else [], also or [], [targets] if targets else [], [map_] if map_ else [], effects or []]
    files: dict[str, bytes] = {}
    for path in (path for group in groups for path in group):
        if not path.is_file():
            raise InputError("no such file", where=str(path), fix="check the path")
        if path.name in files:
            raise InputError("two files of one name", where=str(path), fix="rename one of them")
        files[path.name] = path.read_bytes()
    source = None
    if run is not None:
        source = Source(
            run.name, tuple(path.name for path in also or ()), targets.name if targets else "", tuple(set_ or ()),
            map_.name if map_ else "", tuple(path.name for path in effects or ()),
        )  # fmt: skip
    machine = "" if model is None else format_machine(machine_of(model))
    return Opening(files, source, machine)
