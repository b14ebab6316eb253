"""`ptt fleet`: many machines, many months: a store of runs, and what became of each."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import (
    Also,
    Anyway,
    Effects,
    Json,
    Map,
    ReadOptions,
    Set,
    Targets,
    note,
    progress,
    read_rows,
    show,
)

if TYPE_CHECKING:
    from ptt.fleet.store import Store

app = typer.Typer(
    help="Keep the runs of many machines, process new ones, and see which machines are getting worse.",
    no_args_is_help=True,
    add_completion=False, rich_markup_mode=None,
)  # fmt: skip

StorePath = Annotated[Path, typer.Argument(metavar="STORE", help="Folder of the store.")]
Machine = Annotated[
    str,
    typer.Argument(metavar="MACHINE", help="Name of the machine, any text; or its machine.toml or compensator folder."),
]
Runs = Annotated[list[Path], typer.Argument(metavar="RUN.csv...", help="Tracker runs of this machine.")]
Date = Annotated[
    str | None,
    typer.Option(
        "--date", metavar="D", help="Date of measurement, 2026-03-15 (default: from the file's name or date)."
    ),
]
Drawing = Annotated[
    Path | None,
    typer.Option("--model", metavar="M.toml", help="Drawing of the machine, needed with its first run of a name."),
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Address of a running dask scheduler, as tcp://host:8786."),
]
Workers = Annotated[int | None, typer.Option("--workers", min=1, metavar="N", help="Worker processes on this machine.")]
LogFile = Annotated[
    Path, typer.Argument(metavar="LOG", help="One run in travel order, column names as in docs/files.md.")
]
LogModel = Annotated[Path, typer.Option("--model", metavar="M.toml", help="The model whose effects are refitted.")]
LogOut = Annotated[Path, typer.Option("--out", metavar="M2.toml", help="The refitted model.")]
Again = Annotated[bool, typer.Option("--again", help="Retry runs that failed.")]
Out = Annotated[Path, typer.Option("--out", metavar="R.html", help="The HTML file to write.")]
WhichRun = Annotated[
    str | None, typer.Argument(metavar="[RUN]", help="File name, date or SHA-256 of the run; the last one by default.")
]
ThisRun = Annotated[str, typer.Argument(metavar="RUN", help="File name, date or SHA-256 of the run.")]
OneMachine = Annotated[str | None, typer.Argument(metavar="[MACHINE]", help="Show one machine only, run by run.")]


@app.command()
def init(store: StorePath, json: Json = False) -> None:
    """Make an empty store."""
    from ptt.fleet.store import create_store

    made = create_store(store)
    show({"store": str(made.folder), "file": str(made.file)}, f"{made.folder}: an empty store", json)


@app.command()
def add(
    store: StorePath,
    machine: Machine,
    run: Runs,
    date: Date = None,
    model: Drawing = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Add runs of a machine; runs already in the store are left as they are."""
    from ptt.door.model import load
    from ptt.errors import InputError, PttError
    from ptt.files import sha256
    from ptt.fleet.called import machine_called
    from ptt.fleet.store import add_machine, add_run, drawing_of, is_there, open_store, read_date
    from ptt.run.conditions import settle_conditions

    opened, when, files = open_store(store), None if date is None else read_date(date), _files(effects)
    run = [*run, *(also or ())]  # each file is a run of its own
    if model is None:
        machine, model = _told(*machine_called(opened, machine), machine)
    if model is not None:
        load(model, effects=files)  # refused here: an unknown effect would fail in every run
    file = drawing_of(opened, machine, model)
    reading = ReadOptions(None, targets, set_, map_, None, json)
    ordered = any(text.startswith("order=") for text in set_ or ())
    added, refused = [], list[PttError | OSError]()
    for path in run:
        try:
            table = read_rows(path, file, reading, checked=True)
            for line in settle_conditions(table)[1]:  # done anew whenever the run is worked on
                note(line)
            is_there(opened, machine, sha256(path), path)
            add_machine(opened, machine, model)  # only with its first run: a machine without runs is no use
            added.append(add_run(opened, machine, path, table, when, ordered=ordered, units_said=reading.states_units))
        except (PttError, OSError) as error:
            if len(run) == 1:
                raise
            refused.append(error)
    lines = [
        f"{each.file}: {each.rows} rows, {each.date}{'' if each.new else '; already in the store'}" for each in added
    ]
    if added or not refused:
        show({"machine": machine, "runs": [vars(each) for each in added]}, "\n".join(lines), json)
    if refused:
        what = f"{len(refused)} of {len(run)} files were not added{'; the others were' if added else ''}"
        raise InputError(f"{what}: {'; '.join(map(_in_words, refused))}")


def _told(name: str, drawing: Path | None, given: str) -> tuple[str, Path | None]:
    """Name and drawing of a machine, with a note on the name where it was given by its file."""
    from ptt.fleet.store import shown

    if drawing is not None:
        note(f"{shown(given)}: machine '{shown(name)}'")
    return name, drawing


def _named(store: "Store", machine: str) -> str:
    """The name of a machine that may be given by its file."""
    from ptt.fleet.called import machine_called

    return machine_called(store, machine)[0]


def _files(effects: list[Path] | None) -> tuple[str, ...]:
    """Absolute paths of effect files, for worker processes; one that cannot be loaded is refused here."""
    files = tuple(str(path.absolute()) for path in effects or ())
    if files:
        from ptt.effects import library

        library(*files)
    return files


def _in_words(error: Exception) -> str:
    return f"{error.filename}: {error.strerror}" if isinstance(error, OSError) else str(error)


@app.command()
def run(
    store: StorePath,
    scheduler: Scheduler = None,
    workers: Workers = None,
    again: Again = False,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Check, diagnose or recheck every run that is new."""
    from functools import partial

    from ptt.errors import InputError
    from ptt.fleet.queue import requeue_failed
    from ptt.fleet.run import run_all
    from ptt.fleet.store import open_store
    from ptt.fleet.work import work

    if scheduler is not None and workers is not None:
        raise InputError("--scheduler and --workers exclude each other", fix="leave one out")
    opened, files = open_store(store), _files(effects)
    do = partial(work, effects=files) if files else None
    if again:
        note(f"{requeue_failed(opened)} failed runs will be retried")
    with progress() as tell:
        if scheduler is None and workers is None:
            done = run_all(opened, tell, do)
        else:
            from ptt.fleet.workers import run_on_workers

            done = run_on_workers(opened, scheduler, workers, tell, do)
    show(done.to_dict(), str(done), json)


@app.command()
def accept(
    store: StorePath, machine: Machine, run: WhichRun = None, effects: Effects = None, json: Json = False
) -> None:
    """Use the model fitted to a run as the machine's from that run on, after a repair or a lasting change."""
    from functools import partial

    from ptt.fleet import work
    from ptt.fleet.accept import accept as take
    from ptt.fleet.store import open_store

    files = _files(effects)
    do = partial(work.refit, effects=files) if files else None
    opened = open_store(store)
    with progress() as tell:
        found = take(opened, _named(opened, machine), run, lambda what: tell(what, 0, 0), do)
    show(found.to_dict(), str(found), json)


@app.command()
def remove(store: StorePath, machine: Machine, run: ThisRun, json: Json = False) -> None:
    """Remove a run that was wrongly measured or is another machine's, with all results based on it."""
    from ptt.fleet.remove import remove as take_out
    from ptt.fleet.store import open_store

    opened = open_store(store)
    found = take_out(opened, _named(opened, machine), run)
    show(found.to_dict(), str(found), json)


@app.command()
def fit(
    log: LogFile,
    model: LogModel,
    out: LogOut,
    scheduler: Scheduler = None,
    workers: Workers = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Refit a model to a log of any length (Parquet or CSV), read in parts, here or by workers."""
    from ptt.fleet.fit_log import fit_file

    with progress() as tell:
        found = fit_file(log, model, out, scheduler, workers, tell, anyway=anyway, effects=_files(effects), note=note)
    show({**found.to_dict(), "written": str(out)}, f"{found}\n{out} is written", json)


@app.command(name="show")
def show_(store: StorePath, machine: OneMachine = None, json: Json = False) -> None:
    """Show the state of each machine, what drifts, and what needs attention."""
    from ptt.fleet.overview import overview
    from ptt.fleet.store import open_store
    from ptt.fleet.words import machine_in_words

    opened = open_store(store)
    found = overview(opened, None if machine is None else _named(opened, machine))
    text = str(found) if machine is None else machine_in_words(found.machines[0])
    show(found.to_dict(), text, json)


@app.command()
def report(store: StorePath, out: Out, json: Json = False) -> None:
    """Write one self-contained page on the whole fleet."""
    from ptt.fleet.overview import overview
    from ptt.fleet.store import open_store
    from ptt.show.fleet.page import write_page

    found = overview(open_store(store))
    write_page(found, out)
    count = len(found.machines)
    show({"written": str(out), "machines": count}, f"{out}: {count} machine{'' if count == 1 else 's'}", json)
