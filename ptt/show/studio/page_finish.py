"""The view Finish: downloads (model, compensator, report, corrected commands, exports), training, and tools."""

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui

from ptt.show.card.words import length, percent
from ptt.show.studio.controller import Studio
from ptt.show.studio.ladder_figures import before_after_figure
from ptt.show.studio.page_export import ExportView
from ptt.show.studio.page_tools import build_tools
from ptt.show.studio.page_upload import upload_box
from ptt.show.studio.parts import box, column, grid, heading, note, tools
from ptt.show.studio.picture import Picture
from ptt.show.studio.results import SEAL
from ptt.show.studio.seal_table import seal_html
from ptt.show.studio.steps import REFITS
from ptt.show.studio.uploads import keep_upload

UNTRAINED = (
    "A Gaussian RBF network learns what physics left over, as a function of position; it changes nothing away from "
    "the poses it has seen. Held-out errors show whether it helps."
)


class FinishView:
    """The view of what is taken to the machine."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        with ui.element("div").classes("st-two"):
            with column():
                self._build_downloads()
                ExportView(studio)
                self._build_commands()
            with column():
                with box():
                    self._build_train()
                build_tools(studio)
        studio.when("Finish", "session", self.show)
        studio.on("busy", self._enable)
        self.show()

    def _build_train(self) -> None:
        with tools():
            heading("Let a network learn the rest")
            ui.space()
            self.train = ui.button("Train", icon="model_training", on_click=self.studio.train).props("no-caps outline")
        self.told = note().mark("trained")
        self.plot = Picture("errors before and after").classes("w-full").style("height: 300px")

    def _build_downloads(self) -> None:
        with box("Take along"):
            with tools().style("margin-top: 6px"):
                self.model = self._button("Model (machine.toml)", self._give_model)
                self.compensator = self._button("Compensator (zip)", self._give_compensator)
                self.report = self._button("Report (HTML)", self._give_report)
            note(
                "Corrected commands for a list of targets, by the compensator where one is trained, else by the model."
            ).style("margin-top: 8px")
            with tools().style("flex-wrap: nowrap; margin-top: 4px"):
                label = "Targets (CSV): drop here"
                upload_box(self.studio, label, "predict", self._predict, choose="choose targets")
            self.predicted = note().mark("predicted")
            with tools().style("margin-top: 8px"):
                self.seal = ui.button("Open the seal", icon="lock_open", on_click=self._reveal).props("no-caps outline")
            with grid() as self.opened:
                self.revealed = ui.html("", sanitize=False).classes("w-full").mark("revealed")

    def _build_commands(self) -> None:
        with box("The same from the command line"):
            self.commands = ui.label().classes("st-mono").mark("commands")

    def _button(self, words: str, act: Callable[[], object]) -> ui.button:
        return ui.button(words, icon="download", on_click=act).props("no-caps outline")

    def _enable(self) -> None:
        session = self.studio.session
        idle = self.studio.idle and session.ready
        self.train.set_enabled(idle)
        self.model.set_enabled(session.ready)
        self.compensator.set_enabled(session.training is not None)
        self.report.set_enabled(idle)
        source = session.source
        self.seal.set_visibility(source is not None and (self.studio.folder / source.sealed / SEAL).exists())
        self.seal.set_enabled(idle)

    def show(self) -> None:
        """Take over a changed session."""
        self._enable()
        session = self.studio.session
        self.commands.set_text("\n".join(commands_of(self.studio)))
        self.revealed.set_content("")
        self.opened.set_visibility(False)
        trained = session.training
        if trained is None:
            words = "The model has changed: train again." if session.trainings else UNTRAINED
            self.told.set_text(words if session.ready else "Load a run first.")
            self.plot.set_visibility(False)
            return
        self.plot.set_visibility(True)
        data = trained.data
        self.told.set_text(trained_in_words(data))
        self.plot.show(before_after_figure(data["heldout_rms_um"], data["noise_um"]))

    def _give_model(self) -> None:
        ui.download.content(self.studio.session.text, "machine.toml")

    def _give_compensator(self) -> None:
        trained = self.studio.session.training
        if trained is not None:
            ui.download.content(trained.archive, "compensator.zip")

    async def _give_report(self) -> None:
        session = self.studio.session
        archive = session.training.archive if session.training else None
        known = [found.whole if found else b"" for found in (session.diagnosis_of_drawing, session.diagnosis)]
        page = await self.studio.work("writing the report", "report", session.source, session.text, archive, *known)
        if page is not None:
            ui.download.content(page, "report.html")

    async def _predict(self, name: str, data: bytes) -> None:
        session = self.studio.session
        if session.source is None:
            self.studio.fail("load a run and its machine first")
            return
        kept = keep_upload(self.studio.folder, name, data)
        model = session.training.archive if session.training else session.text
        found = await self.studio.work("working out commands", "predict", session.source, model, kept)
        if found is None:
            self.predicted.set_text("")
            return
        figures = found.data
        ways = ", ".join(f"{count} {status}" for status, count in figures["status"].items() if count)
        told = [f"{figures['rows']} rows ({ways}); largest correction {length(figures['largest_shift_um'])}"]
        if figures.get("largest_reversal_um"):
            told.append(f"on reversal {length(figures['largest_reversal_um'])}")
        elif figures.get("largest_reversal_urad"):
            told.append(f"on reversal {figures['largest_reversal_urad']:.1f} urad")
        self.predicted.set_text("; ".join([*told, *found.notes]))
        ui.download.content(found.content, "sliders.csv")

    async def _reveal(self) -> None:
        session = self.studio.session
        found = await self.studio.work("opening the seal", "reveal", session.source, session.text)
        if found is not None:
            self.revealed.set_content(seal_html(found))
            self.opened.set_visibility(True)


def trained_in_words(data: Mapping[str, Any]) -> str:
    """What a network learned, and the held-out error without and with it.

    Args:
        data: `Trained.data`. Its error of the model as given is not shown, as that may have been fitted to these rows.

    Returns:
        Two sentences.
    """
    learned = [axis for axis, flag in data["learned"].items() if flag]
    what = f"{data['centres']} nodes, for {', '.join(learned)}" if learned else "nothing left that it can learn"
    before, after = data["heldout_rms_um"]["physics"]["total"], data["heldout_rms_um"]["rbf"]["total"]
    return (
        f"Network: {what}; it takes {percent(max(data['share'], 0.0))} of what physics leaves. Held-out error "
        f"{length(before)} \N{RIGHTWARDS ARROW} {length(after)} ({data['protocol']})."
    )


def commands_of(studio: Studio) -> list[str]:
    """Command lines that repeat the session."""
    session = studio.session
    if session.now is None or session.source is None:
        return []
    steps, run = session.commands, session.source.words
    last = f"model{len(steps)}.toml" if steps else "machine.toml"
    lines = [f"ptt compare {run} --model machine.toml", f"ptt diagnose {run} --model machine.toml", *steps]
    if session.now.removed or len(steps) > len(session.now.commands):
        lines.append(REFITS)
    if session.training is not None:
        lines.append(f"python train.py {run} --machine {last} --out compensator")
        last = "compensator"
    return [*lines, f"ptt predict targets.csv --model {last} --out sliders.csv"]
