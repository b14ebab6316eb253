"""Learn: the verdict, the ranked candidates, the card of an effect, what could not be tested, what to measure next."""

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui

from ptt.show.studio.controller import Studio
from ptt.show.studio.figures import sign_figure
from ptt.show.studio.session import key_of

Go = Callable[[str], None]
VERDICTS = {
    "missing": ("Physics is missing, and it has a name", "lightbulb"),
    "nothing-missing": ("Nothing is missing", "check_circle"),
    "unknown": ("Something is missing that no known effect describes", "help"),
}
HEADS = ("effect", "would take", "held-out error", "p-value", "cannot be told from", "")


class LearnView:
    """The view's parts."""

    def __init__(self, studio: Studio, go: Go) -> None:
        """Build it."""
        self.studio, self.go, self.shown = studio, go, ""
        self.left: tuple[str, ...] = ()
        with ui.element("div").classes("st-two st-wide-left"):
            with ui.element("div").classes("st-col"):
                with ui.element("div").classes("st-box"):
                    self._build_verdict()
                with ui.element("div").classes("st-box st-scroll").style("flex: 1 1 0").props("tabindex=0"):
                    self.findings = ui.element("div").classes("w-full")
            with ui.element("div").classes("st-box st-col st-scroll").props("tabindex=0"):
                self.card = ui.element("div").classes("w-full").mark("card")
        studio.on("session", self.show)
        studio.on("busy", self._enable)
        self.show()

    def _build_verdict(self) -> None:
        with ui.element("div").classes("st-tools").style("flex-wrap: nowrap"):
            self.icon = ui.icon("search", size="28px", color="primary")
            self.verdict = ui.label().classes("st-verdict").mark("verdict").props("role=status aria-live=polite")
            self.verdict.style("flex: 1 1 0; min-width: 0")
            self.all = ui.button("Add all steps", icon="add", on_click=self._add_all).props("no-caps")
            self.find = ui.button("Find what is missing", icon="search", on_click=self.studio.learn).props("no-caps")
        self.words = ui.label().classes("st-note st-scroll").style("max-height: 22vh").mark("words")

    def _enable(self) -> None:
        idle = self.studio.session.ready and self.studio.busy is None
        for button in (self.find, self.all):
            button.set_enabled(idle)

    def show(self) -> None:
        """Take over a changed session; after a step the findings of the model before stay, and say so."""
        self._enable()
        session = self.studio.session
        lesson, stale = session.lesson, False
        if lesson is None:
            before = (snapshot.active for snapshot in reversed(session.past))
            lesson, stale = next((session.lessons[text] for text in before if text in session.lessons), None), True
        self.findings.clear()
        self.left = () if lesson is None else self._left(lesson.data)
        self.all.set_visibility(len(self.left) > 1)
        if lesson is None:
            self.verdict.set_text("Not looked yet")
            self.words.set_text("" if session.ready else "Load a run and its machine first.")
            self.icon.set_name("search")
            self.card.clear()
            return
        data = lesson.data
        text, icon = VERDICTS[data["verdict"]]
        self.verdict.set_text("The model has changed since: look again" if stale else text)
        self.words.set_text(data["words"])
        self.icon.set_name("update" if stale else icon)
        with self.findings:
            self._fill(data, lesson.measure_next)
        first = next((item["effect"] for item in data["candidates"]), "")
        if first and not stale and self.studio.busy is None:
            ui.timer(0.01, lambda: self.show_card(first), once=True)

    def _left(self, data: Mapping[str, Any]) -> tuple[str, ...]:
        """Steps of the path that are not in the model yet."""
        there = {key_of(entry) for entry in self.studio.session.effects}
        return tuple(step[0] for step in data["suggested"] if step[0] not in there)

    async def _add_all(self) -> None:
        self.go("Add")
        await self.studio.change("add", *self.left)

    def _fill(self, data: Mapping[str, Any], measure_next: str) -> None:
        if data["candidates"]:
            ui.label("What would explain it, best first").classes("st-head")
            self._candidates(data)
        rest = [_depends(item) for item in data["depends_on"]]
        if rest:
            ui.label("What is left depends on").classes("st-head").style("margin-top: 8px")
            for line in rest:
                ui.label(line).classes("st-note")
        self._measure_next(data["measure_next"], measure_next)
        if data["not_testable"]:
            ui.label("Could not be tested on this run").classes("st-head").style("margin-top: 8px")
            with ui.element("div").classes("st-grid").style("grid-template-columns: max-content 1fr"):
                for item in data["not_testable"]:
                    self._name(item["effect"])
                    ui.label(f"needs {item['needs']}").classes("st-note")
        noise = data["noise_um"]
        left = f", {len(data['outlier_rows'])} left out as gross errors" if data["outlier_rows"] else ""
        ui.label(
            f"Noise floor {noise['total']:.2f} \N{MICRO SIGN}m from {noise['source']}; {data['rows']} readings{left}."
        ).classes("st-note").style("margin-top: 8px")

    def _candidates(self, data: Mapping[str, Any]) -> None:
        steps = [step[0] for step in data["suggested"]]
        there = {key_of(entry) for entry in self.studio.session.effects}
        columns = "max-content max-content max-content max-content minmax(60px, 1fr) max-content"
        with ui.element("div").classes("st-grid").style(f"grid-template-columns: {columns}").mark("candidates"):
            for head in HEADS:
                ui.label(head).classes("st-h")
            for item in data["candidates"]:
                self._name(item["effect"], suggested=item["effect"] in steps)
                ui.label(f"{item['explained_share']:.1%}").classes("st-right")
                before, after = item["heldout_rms_um"]["before"], item["heldout_rms_um"]["after"]
                ui.label(f"{before:.1f} \N{RIGHTWARDS ARROW} {after:.1f} \N{MICRO SIGN}m").classes("st-right")
                ui.label("< 1e-300" if item["p_value"] == 0 else f"{item['p_value']:.1e}").classes("st-right")
                ui.label(", ".join(item["indistinguishable_from"]) or "\N{EN DASH}").classes("st-note")
                if item["effect"] in there:
                    ui.label("in the model").classes("st-note")
                    continue
                add = ui.button("Add", icon="add", on_click=lambda _, key=item["effect"]: self._add(key))
                add.props("dense no-caps size=sm").props["aria-label"] = f"add {item['effect']}"
                add.style("padding: 0 8px").props("outline" if item["effect"] not in steps else "")
        others = len(data["candidates"]) > len(steps)
        ui.label("Would take: the share of the squared error that the effect takes by itself.").classes("st-note")
        ui.label(
            ("Filled buttons are the steps that together explain the run" if steps else "None of these is enough")
            + ("; the others explain a part of the same, on the model as it is." if others else ".")
        ).classes("st-note")

    def _name(self, key: str, suggested: bool = False) -> None:
        button = ui.button(key, on_click=lambda: self.show_card(key)).props("flat dense no-caps align=left")
        button.style(f"font-weight: {600 if suggested else 400}; padding: 0 4px")
        button.props["aria-label"] = f"card of {key}"

    def _measure_next(self, lines: list[str], csv: str) -> None:
        if not lines and not csv:
            return
        with ui.element("div").classes("st-tools").style("margin-top: 8px"):
            ui.label("Measure next").classes("st-head")
            if csv:
                ui.button(
                    "Download the poses (CSV)", icon="download",
                    on_click=lambda: ui.download.content(csv, "measure_next.csv"),
                ).props("dense no-caps outline size=sm")  # fmt: skip
        for line in lines:
            ui.label(line).classes("st-note")

    async def _add(self, key: str) -> None:
        self.go("Add")
        await self.studio.change("add", key)

    async def show_card(self, key: str) -> None:
        """Show the card of an effect."""
        source = self.studio.session.source
        files = () if source is None else source.effect_files
        self.shown = key
        card = await self.studio.work(f"card of {key}", "card", key, self.studio.session.kind, files, quiet=True)
        if card is not None and self.shown == key:
            self.card.clear()
            with self.card:
                self._fill_card(card)

    def _fill_card(self, card: Mapping[str, Any]) -> None:
        lesson = self.studio.session.lesson
        items = lesson.data["candidates"] if lesson else []
        own = next((item for item in items if item["effect"] == card["effect"]), None)
        ui.label(card["effect"]).classes("st-verdict")
        if own and own["words"]:
            ui.label(own["words"]).style("font-size: 14px")
        if own:
            for each in own["parameters"][:9]:
                error = "" if each["std"] is None else f" \N{PLUS-MINUS SIGN} {each['std']:.2g}"
                ui.label(f"{each['name']} = {each['value']:.4g}{error}").classes("st-mono")
        plot = ui.plotly(sign_figure(card["sign"])).style("width: 100%; height: 250px")
        plot.props("role=img").props["aria-label"] = f"sign of {card['effect']}"
        ui.label("Its sign at usual size on the sample machine, no noise").classes("st-note")
        for title, key in (
            ("Cause", "cause"), ("Shows as", "fingerprint"), ("Equation", "equation"), ("Usual size", "size"),
            ("Mended by", "remedy"), ("Needs", "needs"), ("Source", "source"),
        ):  # fmt: skip
            if card[key] not in ("-", ""):
                ui.label(title).classes("font-medium").style("font-size: 13px; margin-top: 4px")
                ui.label(card[key]).classes("st-note")
        if card["confused_with"]:
            ui.label("Confused with").classes("font-medium").style("font-size: 13px; margin-top: 4px")
            for other, test in card["confused_with"]:
                ui.label(f"{other}: {test}").classes("st-note")


def build_learn(studio: Studio, go: Go) -> None:
    """Build the view.

    Args:
        studio: of this tab.
        go: shows another view.
    """
    LearnView(studio, go)


def _depends(item: Mapping[str, Any]) -> str:
    period = f", period {item['period_mm']:.3g} mm" if item["period_mm"] else ""
    return (
        f"{item['residual']} on {item['on']}: {item['share']:.0%} of its variance (p = {item['p_value']:.1g}{period})"
    )
