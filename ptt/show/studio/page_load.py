"""The view Load: the purpose of the program, samples, the user's files, and what was understood of them."""

from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import partial
from importlib.resources import files

from nicegui import ui

from ptt.machine import parse_machine
from ptt.show.studio.controller import Studio
from ptt.show.studio.guard import LIMIT
from ptt.show.studio.page_columns import ColumnsView
from ptt.show.studio.page_machine import open_machine_form
from ptt.show.studio.page_recent import build_recent
from ptt.show.studio.page_setup import build_setup
from ptt.show.studio.page_understood import build_understood
from ptt.show.studio.page_upload import upload_box
from ptt.show.studio.parts import box, column, note, tools
from ptt.show.studio.results import SEAL, Source
from ptt.show.studio.samples import ARM, FIRST, LEVELS, SAMPLES, sample_files
from ptt.show.studio.uploads import keep_seal, keep_upload

LOOP = files("ptt.show.studio").joinpath("loop.svg").read_text(encoding="utf-8")
RUN, MACHINE = "Tracker run (CSV, TXT)", "Machine (machine.toml)"
PURPOSE = "Finds out why a robot misses its target, and writes the commands that hit it."


def build_load(studio: Studio) -> None:
    """Build the view."""
    with ui.element("div").classes("st-two"):
        with ui.element("div").classes("st-col st-scroll"):
            _build_hero(studio)
            _build_files(studio)
            _build_more(studio)
        with column():
            build_setup(studio)
            ColumnsView(studio)
            build_understood(studio)


def _build_hero(studio: Studio) -> None:
    """Build the box with purpose, picture and samples, which is shown until something is open."""
    with box() as hero:
        ui.html(PURPOSE, sanitize=False, tag="h2").classes("st-hero")
        ui.html(LOOP, sanitize=False).classes("w-full").style("margin: 8px 0")
        with tools():
            for name, words, look in ((FIRST, "Try a sample", "unelevated"), (ARM, "Try an arm", "outline")):
                if name in _samples():
                    sample = ui.button(words, icon="play_arrow", on_click=partial(_take_sample, studio, name))
                    sample.props(f"no-caps size=16px {look}")
            if not _samples():  # installed without samples: a challenge is drawn instead
                drawn = ui.button(
                    "Try a sample", icon="play_arrow", on_click=partial(_take_challenge, studio, "single")
                )
                drawn.props("no-caps size=16px unelevated")
            own = ui.button("Open your own files", icon="folder_open").props("no-caps size=16px outline")
            own.on(
                "click",
                js_handler="() => document.querySelector('.st-drop-run')?.closest('.st-box').scrollIntoView()",
            )
        note("Nothing leaves this computer.")

    def update() -> None:
        hero.set_visibility(not studio.session.ready)

    studio.on("session", update)
    update()


def _build_files(studio: Studio) -> None:
    with box("Your own files").classes("st-col").style("height: auto"):
        run = _drop(studio, RUN, "run", lambda name, data: _take_run(studio, name, data))
        machine = _drop(studio, MACHINE, "machine", lambda name, data: _take_machine(studio, name, data))
        with tools():
            opening = ui.button("Open", icon="play_arrow", on_click=lambda: _open(studio)).props("no-caps unelevated")
            opening.props('aria-label="open the files"')
            form = ui.button("Describe the machine here", icon="straighten", on_click=lambda: open_machine_form(studio))
            form.props("no-caps flat dense")
        waiting = note().mark("waiting")
        with ui.expansion("A further run, or targets of an export").classes("w-full").props("dense"):
            also, targets = "Further run, read together with the first", "Targets of an export that holds readings only"
            _drop(studio, also, "also", lambda name, data: _take_also(studio, name, data))
            _drop(studio, targets, "targets", lambda name, data: _take_targets(studio, name, data))

    def update() -> None:
        staged, session = studio.staged, studio.session
        source, (of, with_) = staged.source, studio.at_hand
        named = parse_machine(staged.machine, "machine.toml").machine.name or MACHINE if staged.machine else ""
        waiting.set_text(_waiting(source, with_, named, session.ready, refused=staged.refused))
        opening.set_enabled(bool(of and with_ and (source or staged.machine)) and studio.idle)
        open_ = (session.source.run, session.now.file.machine.name) if session.source and session.now else ("", "")
        for upload, label, there, used in (
            (run, RUN, source.run if source else "", open_[0]),
            (machine, MACHINE, named, open_[1]),
        ):
            refused = staged.refused and upload is run
            upload.props["label"] = dropped(label, there, used, refused=refused)
            upload.update()
            upload.classes(add="st-ready") if there and not refused else upload.classes(remove="st-ready")

    for topic in ("session", "busy", "staged"):
        studio.on(topic, update)
    update()


def _waiting(source: Source | None, machine: str, staged: str, ready: bool, *, refused: bool = False) -> str:
    """What is staged and what comes next, in a sentence.

    Args:
        source: the staged run; None for none.
        machine: text of the machine that it would be opened with; '' for none.
        staged: name of the staged machine; '' for none.
        ready: whether a session is open.
        refused: whether the run could not be opened as it is.
    """
    here = [source.run] if source else []
    here += [f"machine '{staged}'"] if staged else []
    if source and refused:
        return f"{source.run} was not opened, for the reason above; drop another, or say what its columns hold."
    if source and machine:
        return f"{' and '.join(here)}: ready to open{'' if staged else ', on the machine that is open'}."
    if source:
        return f"{source.run} is here; now the drawing of its machine (machine.toml)."
    if staged:
        return f"{here[0]} is here; {'open it with the run as before, or drop another' if ready else 'now a run'}."
    return f"Files stay on this computer; at most {LIMIT >> 20} MB each; nothing in them is executed."


def _build_more(studio: Studio) -> None:
    with box("Or try it").classes("st-col").style("height: auto"):
        found = _samples()
        if found:
            with tools():
                names = {name: SAMPLES[name] for name in found}
                which = ui.select(names, value=found[0], label="Sample").props("dense outlined").classes("w-72")
                ui.button("Load sample", on_click=lambda: _take_sample(studio, which.value)).props("no-caps outline")
        with tools():
            level = ui.select(LEVELS, value="single", label="Challenge").props("dense outlined").classes("w-72")
            arm = sample_files(ARM)
            kinds = {"": "of a 3-PTT", **({} if arm is None else {str(arm[1]): "of a serial arm"})}
            kind = ui.select(kinds, value="", label="Machine").props("dense outlined").classes("w-40")
            ui.button(
                "Draw a fresh challenge",
                on_click=lambda: _take_challenge(studio, level.value, kind.value or None),
            ).props("no-caps outline")
        note("A challenge is a machine with sealed faults. Finish opens the seal.")
    build_recent(studio)


def dropped(label: str, there: str = "", used: str = "", *, refused: bool = False) -> str:
    """Label of a box for a file.

    Args:
        label: what belongs there.
        there: the staged file; '' for none.
        used: the open file; '' for none.
        refused: whether the staged file could not be opened as it is.

    Returns:
        The label, on the staged file, else on the open one, else on what belongs there.
    """
    if there:
        return f"{there} was not opened; drop another" if refused else f"{there} is here; or drop another"
    return f"{used} is open; or drop another" if used else f"{label}: drop here"


def _drop(studio: Studio, label: str, key: str, take: Callable[[str, bytes], Awaitable[None]]) -> ui.upload:
    with tools().style("flex-wrap: nowrap"):
        return upload_box(studio, dropped(label), key, take, choose=f"choose {label}")


async def _open(studio: Studio) -> None:
    """Open the staged run and machine; where only one is staged, with the other one of the open session."""
    source, machine = studio.at_hand
    if source is not None and machine:
        await studio.open(source, machine, "Result")


async def _take_run(studio: Studio, name: str, data: bytes) -> None:
    studio.stage(source=Source(keep_upload(studio.folder, name, data)))


async def _take_machine(studio: Studio, name: str, data: bytes) -> None:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        studio.fail(f"{name}: is not UTF-8 text; save it as UTF-8")
        return
    parse_machine(text, name)
    studio.stage(machine=text)


async def _take_also(studio: Studio, name: str, data: bytes) -> None:
    source, _ = studio.at_hand
    if source is None:
        studio.fail("load the first run, then further ones")
        return
    studio.stage(source=replace(source, also=(*source.also, keep_upload(studio.folder, name, data))))


async def _take_targets(studio: Studio, name: str, data: bytes) -> None:
    source, _ = studio.at_hand
    if source is None:
        studio.fail("load the export first, then its targets")
        return
    studio.stage(source=replace(source, targets=keep_upload(studio.folder, name, data)))


def _samples() -> list[str]:
    return [name for name in SAMPLES if sample_files(name)]


async def _take_sample(studio: Studio, name: str) -> None:
    found = sample_files(name)
    assert found is not None
    named = {file.name: file for file in found}
    run = keep_upload(studio.folder, "run.csv", named["run.csv"].read_bytes())
    if SEAL in named:
        keep_seal(studio.folder, run, named[SEAL].read_bytes())
    await studio.open(Source(run), named["machine.toml"].read_text(encoding="utf-8"), "Result")


async def _take_challenge(studio: Studio, level: str, arm: str | None = None) -> None:
    made = await studio.work("drawing a machine and measuring it", "challenge", level, None, arm)
    if made is not None:
        run, machine, seal = (studio.folder / name for name in made)
        kept = keep_upload(studio.folder, run.name, run.read_bytes())
        keep_seal(studio.folder, kept, seal.read_bytes())
        await studio.open(Source(kept), machine.read_text(encoding="utf-8"), "Result")
