"""The picture of the machine on the view Result, with controls for pose and enlargements."""

from typing import Any

import numpy as np
from nicegui import ui

from ptt.show.card.scene import POSES, usual_times
from ptt.show.card.words import length, together
from ptt.show.sizing import spread
from ptt.show.studio.arrow_figure import usual_scale
from ptt.show.studio.controller import Studio
from ptt.show.studio.looks import Look
from ptt.show.studio.machine_figure import empty_space, machine_figure
from ptt.show.studio.parts import heading, note, tools
from ptt.show.studio.picture import Picture
from ptt.show.studio.results import Diagnosed

STEP = 1.0 / 3.0  # step of the controls of enlargement, in powers of ten


class MachinePicture:
    """The picture and its controls."""

    def __init__(self, studio: Studio) -> None:
        """Build it."""
        self.studio = studio
        self.diagnosis: Diagnosed | None = None
        self.key = ""
        self.look: Look | None = None
        self.drawn: object = None
        with tools():
            heading("Where on the machine")
            ui.space()
            self.near = ui.toggle({False: "machine", True: "readings"}, value=False, on_change=self.draw)
            self.near.props('dense no-caps size=sm aria-label="what fills the picture"')
            self.arrows = ui.switch("errors", value=True, on_change=self.draw).props("dense")
            self.fault = ui.switch("fault", value=True, on_change=self.draw).props("dense")
        self.note = note().mark("picture-note")
        self.plot = Picture("the machine, its errors and its fault", empty_space()).classes("st-plot st-machine")
        with ui.element("div").style(
            "display: grid; grid-template-columns: max-content 1fr; gap: 0 12px; width: 100%; align-items: center"
        ):
            self.scale = self._slider("errors enlarged")
            self.times = self._slider("fault enlarged")
            self.pose = self._slider("along the travel", step=1.0)

    def _slider(self, words: str, step: float = STEP) -> ui.slider:
        note(words)
        slider = ui.slider(min=0, max=6, step=step, value=0, on_change=self.draw)
        slider.props("dense").props["aria-label"] = words
        slider.on("change", lambda: None, throttle=0.15)
        return slider

    def show(self, diagnosis: Diagnosed | None) -> None:
        """Take over a diagnosis, None before there is one; the errors are those with the active model."""
        look = self.studio.session.look
        if (diagnosis, look) == (self.diagnosis, self.look) and self.drawn is not None:
            return
        fresh = self.look is None or look is None or self.look.source != look.source
        self.diagnosis, self.look = diagnosis, look
        shifts = {} if diagnosis is None else diagnosis.ghosts.get("shift", {})
        if self.key not in shifts:
            self.key = next(iter(shifts), "")
        if look is None:
            return
        if fresh:
            with_scale = np.log10(usual_scale(look))
            self.scale.set_value(round(with_scale / STEP) * STEP)
            self.pose._props["max"] = len(self._rows()) - 1
            self.pose.set_value(len(self._rows()) // 2)
            self.pose.update()
        self._suit()
        self.draw()

    def point(self, key: str) -> None:
        """Show the fault of another finding, by the key of its effect."""
        self.key = key
        self.fault.set_value(True)
        self._suit()
        self.draw()

    def _suit(self) -> None:
        """Set the enlargement of the fault so that it is well seen."""
        shift = self._shift()
        if shift is not None and self.look is not None:
            lines = self.look.drawing.at(int(self._rows()[len(self._rows()) // 2]))
            self.times.set_value(round(np.log10(usual_times(lines, shift)) / STEP) * STEP)

    def _rows(self) -> np.ndarray:
        """Rows of the poses that can be chosen: those of the ghosts, else evenly spaced ones."""
        if self.diagnosis is not None and self.diagnosis.ghosts.get("rows"):
            return np.asarray(self.diagnosis.ghosts["rows"], dtype=int)
        assert self.look is not None
        kept = np.flatnonzero(self.look.kept)
        kept = kept if len(kept) else np.arange(self.look.rows)
        return np.asarray(kept[spread(len(kept), POSES)])

    def _shift(self) -> Any:
        return None if self.diagnosis is None else self.diagnosis.ghosts.get("shift", {}).get(self.key)

    def draw(self) -> None:
        """Draw it again."""
        look = self.look
        if look is None:
            return
        rows, shift = self._rows(), self._shift()
        at = min(int(self.pose.value or 0), len(rows) - 1)
        scale, times = round_figure(10.0 ** float(self.scale.value)), round_figure(10.0 ** float(self.times.value))
        finding = (
            next((one for one in self.diagnosis.card["findings"] if one["effect"] == self.key), None)
            if self.diagnosis
            else None
        )
        ghost = None
        if shift is not None and self.fault.value:
            values = finding["values"] if finding else []
            ghost = {"shift": shift, "at": min(at, len(shift["platform"]) - 1), "times": times, "values": values}
        shown = scale if self.arrows.value else 0.0
        told = [f"errors {scale:,.0f} times enlarged: 10 mm of arrow is {length(1e4 / scale)}"] if shown else []
        if ghost:
            moves = any(np.any(shift[part]) for part in ("rails", "sliders", "platform", "chain") if part in shift)
            told.append(
                f"{self.key} drawn {times:,.0f} times as large, in orange"
                if moves
                else f"{self.key} moves no part of the machine"
            )
        self.note.set_text(together("; ".join(told)) or "as drawn, nothing enlarged")
        self.plot.show(
            machine_figure(
                look, int(rows[at]), scale=shown, ghost=ghost, near=bool(self.near.value), picked=self.studio.picked
            )
        )
        self.drawn = look


def round_figure(value: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten, on a logarithmic scale."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((step * power for step in (1.0, 2.0, 5.0, 10.0)), key=lambda each: abs(np.log(each / value))))
