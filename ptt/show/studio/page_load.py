"""Load: a run and its machine, from files, a sample or a fresh challenge; and what was understood of them."""

from collections.abc import Awaitable, Callable
from dataclasses import replace

from nicegui import events, ui

from ptt.errors import PttError
from ptt.files import write_bytes
from ptt.machine import parse_machine
from ptt.show.studio.controller import LIMIT, Studio
from ptt.show.studio.results import SEAL, Source
from ptt.show.studio.samples import LEVELS, SAMPLES, sample_files

Go = Callable[[str], None]


def build_load(studio: Studio, go: Go) -> None:
    """Build the view.

    Args:
        studio: of this tab.
        go: shows another view.
    """
    with ui.element("div").classes("st-two"):
        with ui.element("div").classes("st-col st-scroll"):
            _build_files(studio)
            _build_samples(studio)
        with ui.element("div").classes("st-col"), ui.element("div").classes("st-box st-col st-scroll"):
            _build_understood(studio, go)


def _build_files(studio: Studio) -> None:
    with ui.element("div").classes("st-box st-col").style("height: auto"):
        ui.label("Your own files").classes("st-head")
        _drop(studio, "Tracker run (CSV, TXT)", "run", lambda name, data: _take_run(studio, name, data))
        _drop(studio, "Machine (machine.toml)", "machine", lambda name, data: _take_machine(studio, name, data))
        waiting = ui.label().classes("st-note").mark("waiting")
        with ui.expansion("A further run, or targets of an export").classes("w-full").props("dense"):
            also, targets = "Further run, read together with the first", "Targets of an export that holds readings only"
            _drop(studio, also, "also", lambda name, data: _take_also(studio, name, data))
            _drop(studio, targets, "targets", lambda name, data: _take_targets(studio, name, data))

    def update() -> None:
        if studio.pending is not None and not studio.machine:
            waiting.set_text(f"{studio.pending.run} is here; now the drawing of its machine (machine.toml).")
        elif studio.machine and not studio.session.ready and studio.pending is None:
            waiting.set_text("The machine is here; now a run.")
        else:
            waiting.set_text(
                f"Files stay on this computer; at most {LIMIT >> 20} MB each; nothing in them is executed."
            )

    studio.on("session", update)
    studio.on("busy", update)
    update()


def _build_samples(studio: Studio) -> None:
    with ui.element("div").classes("st-box st-col").style("height: auto"):
        ui.label("Or try it").classes("st-head")
        found = [name for name in SAMPLES if sample_files(name)]
        if found:
            with ui.element("div").classes("st-tools"):
                names = {name: SAMPLES[name] for name in found}
                which = ui.select(names, value=found[0], label="Sample").props("dense outlined").classes("w-72")
                ui.button("Load sample", on_click=lambda: _take_sample(studio, which.value)).props("no-caps")
        with ui.element("div").classes("st-tools"):
            level = ui.select(LEVELS, value="single", label="Challenge").props("dense outlined").classes("w-72")
            ui.button("Draw a fresh challenge", on_click=lambda: _take_challenge(studio, level.value)).props("no-caps")
        ui.label("A challenge is a machine with sealed faults. Finish opens the seal.").classes("st-note")


def _build_understood(studio: Studio, go: Go) -> None:
    ui.label("What was understood").classes("st-head")
    body = ui.element("div").classes("w-full").mark("understood")

    def update() -> None:
        body.clear()
        look = studio.session.look
        with body:
            if look is None:
                ui.label("Nothing is loaded yet.").classes("st-note")
                return
            for line in look.understood:
                ui.label(line).classes("st-note")
            covariates = ", ".join(look.covariates) or "none"
            runs = ", ".join(look.runs) or "one"
            left = int((~look.kept).sum())
            facts = {
                "Rows": f"{look.rows}, {int(look.kept.sum())} of them count"
                + (f" ({left} left out: base or not observed or gross errors)" if left else ""),
                "Runs": runs,
                "Besides poses": covariates,
                "Noise": _noise(look.noise),
                "Positions": "mm",
                "Commands": "rad" if look.serial else "mm",
            }
            with ui.element("div").classes("st-grid").style("grid-template-columns: max-content 1fr; margin-top: 8px"):
                for name, text in facts.items():
                    ui.label(name).classes("font-medium")
                    ui.label(text)
            with ui.element("div").classes("st-tools").style("margin-top: 12px"):
                ui.button("Look at it", icon="visibility", on_click=lambda: go("Look")).props("no-caps outline")

                async def find() -> None:
                    go("Learn")
                    await studio.learn()

                ui.button("Find what is missing", icon="search", on_click=find).props("no-caps")
            if studio.session.comparison is not None:
                ui.label("Compared with the model").classes("st-head").style("margin-top: 10px")
                ui.label(studio.session.comparison.text).classes("st-mono st-pre")

    studio.on("session", update)
    update()


def _drop(studio: Studio, label: str, key: str, take: Callable[[str, bytes], Awaitable[None]]) -> None:
    async def uploaded(event: events.UploadEventArguments) -> None:
        data = await event.file.read()
        upload.reset()
        try:
            await take(event.file.name, data)
        except PttError as error:
            studio.fail(str(error))

    def rejected() -> None:
        ui.notify(f"not taken: larger than {LIMIT >> 20} MB", type="warning")

    with ui.element("div").classes("st-tools").style("flex-wrap: nowrap"):
        upload = ui.upload(
            label=f"{label}: drop here", on_upload=uploaded, on_rejected=rejected, max_file_size=LIMIT, auto_upload=True
        )
        upload.classes(f"st-drop st-drop-{key}").props("flat hide-upload-btn")
        choose = ui.button("Choose").props(f'no-caps outline aria-label="choose {label}"')
        choose.on("click", js_handler=f"() => getElement({upload.id}).pickFiles()")


async def _take_run(studio: Studio, name: str, data: bytes) -> None:
    source = Source(_keep(studio, name, data))
    if studio.machine:
        await studio.open(source, studio.machine)
    else:
        studio.pending = source
        studio.fail("")


async def _take_machine(studio: Studio, name: str, data: bytes) -> None:
    try:
        text = data.decode("utf-8-sig")
        parse_machine(text, name)
    except UnicodeDecodeError:
        studio.fail(f"{name}: is not UTF-8 text; save it as UTF-8")
        return
    except PttError as error:
        studio.fail(str(error))
        return
    source = studio.pending or studio.session.source
    if source is None:
        studio.machine = text
        studio.fail("")
    else:
        await studio.open(source, text)


async def _take_also(studio: Studio, name: str, data: bytes) -> None:
    source = studio.session.source
    if source is None:
        studio.fail("load the first run, then further ones")
        return
    await studio.open(replace(source, also=(*source.also, _keep(studio, name, data))), studio.machine)


async def _take_targets(studio: Studio, name: str, data: bytes) -> None:
    source = studio.pending or studio.session.source
    kept = _keep(studio, name, data)
    if source is None:
        studio.fail("load the export first, then its targets")
    elif not studio.machine:
        studio.pending = replace(source, targets=kept)
        studio.fail("")
    else:
        await studio.open(replace(source, targets=kept), studio.machine)


async def _take_sample(studio: Studio, name: str) -> None:
    files = sample_files(name)
    assert files is not None
    named = {file.name: file for file in files}
    run = _keep(studio, "run.csv", named["run.csv"].read_bytes())
    write_bytes(studio.folder / SEAL, named[SEAL].read_bytes())
    await studio.open(Source(run), named["machine.toml"].read_text(encoding="utf-8"))


async def _take_challenge(studio: Studio, level: str) -> None:
    made = await studio.work("drawing a machine and measuring it", "challenge", level, None)
    if made is not None:
        run, machine = (studio.folder / name for name in made)
        await studio.open(Source(studio.keep(run.name, run.read_bytes())), machine.read_text(encoding="utf-8"))


def _keep(studio: Studio, name: str, data: bytes) -> str:
    kept = studio.keep(name, data)
    (studio.folder / SEAL).unlink(missing_ok=True)
    return kept


def _noise(noise: object) -> str:
    if not isinstance(noise, dict):
        return "not told by this run; the diagnosis works it out"
    figures = ", ".join(f"{axis} {noise[axis]:.1f}" for axis in ("x", "y", "z"))
    return f"{noise['total']:.1f} \N{MICRO SIGN}m ({figures}), from {noise['source']}"
