"""The form that describes a machine, with a picture that follows its numbers."""

import re
from collections.abc import Mapping
from typing import Any

from nicegui import ui

from ptt.errors import PttError
from ptt.machine import parse_machine
from ptt.show.card.words import pretty
from ptt.show.studio.controller import Studio
from ptt.show.studio.parts import box, note, tools
from ptt.show.studio.picture import Picture

NUMBERS = {  # key of the machine file ('least' and 'most': ends of travel) -> label and default
    "base_radius_mm": ("base radius [mm]", 200.0),
    "platform_radius_mm": ("platform radius [mm]", 100.0),
    "link_length_mm": ("link length [mm]", 300.0),
    "least": ("least slider height [mm]", 150.0),
    "most": ("greatest slider height [mm]", 420.0),
    "screw_lead_mm": ("screw lead [mm]", 5.0),
    "platform_mass_kg": ("platform mass [kg]", 1.0),
}
JOINT = ("a_mm", "alpha_deg", "d_mm", "theta_offset_deg")
# Name -> Denavit-Hartenberg convention, and a row for each joint in the order of `JOINT`.
PRESETS: dict[str, tuple[str, tuple[tuple[float, float, float, float], ...]]] = {
    # Nominal values published by the makers.
    "UR10": ("standard", (
        (0, 90, 127.3, 0), (-612, 0, 0, 0), (-572.3, 0, 0, 0), (0, 90, 163.941, 0), (0, -90, 115.7, 0), (0, 0, 92.2, 0),
    )),
    "UR5": ("standard", (
        (0, 90, 89.159, 0), (-425, 0, 0, 0), (-392.25, 0, 0, 0), (0, 90, 109.15, 0), (0, -90, 94.65, 0),
        (0, 0, 82.3, 0),
    )),
    "KUKA LBR iiwa 14": ("standard", (
        (0, -90, 360, 0), (0, 90, 0, 0), (0, 90, 420, 0), (0, -90, 0, 0), (0, -90, 400, 0), (0, 90, 0, 0),
        (0, 0, 126, 0),
    )),
}  # fmt: skip


def three_ptt_text(name: str, above: bool, values: Mapping[str, float | None]) -> str:
    """Text of a machine.toml for a 3-PTT.

    Args:
        name: name of the machine.
        above: whether the sliders ride above the platform.
        values: the numbers of the form, by the keys of `NUMBERS`.

    Returns:
        The text.
    """
    own = dict(values)
    travel = [own.pop("least"), own.pop("most")]
    lines = [
        "[machine]",
        'kind = "three-ptt"',
        f'name = "{_plain(name)}"',
        f'sliders = "{"above" if above else "below"}"',
    ]
    lines += [f"{key} = {_number(value)}" for key, value in own.items() if value is not None]
    ends = ", ".join(_number(end or 0.0) for end in travel)
    return "\n".join([*lines, f"slider_travel_mm = [{ends}]", ""])


def arm_text(name: str, convention: str, joints: list[Mapping[str, float]]) -> str:
    """Text of a machine.toml for a serial arm.

    Args:
        name: name of the arm.
        convention: Denavit-Hartenberg convention, 'standard' or 'modified'.
        joints: for each joint its parameters by the keys of `JOINT`.

    Returns:
        The text.
    """
    lines = ["[machine]", 'kind = "serial"', f'name = "{_plain(name)}"', f'convention = "{convention}"']
    for joint in joints:
        lines += ["", "[[machine.joint]]", *(f"{key} = {_number(joint[key])}" for key in JOINT)]
    return "\n".join([*lines, ""])


def open_machine_form(studio: Studio) -> None:
    """Open the form in a dialog; the machine that it describes is staged."""
    with ui.dialog().props("maximized") as dialog, ui.card().classes("w-full").style("background: var(--bg)"):
        MachineForm(studio, dialog)
    dialog.open()


class MachineForm:
    """The form that describes a machine."""

    def __init__(self, studio: Studio, dialog: ui.dialog) -> None:
        """Build it.

        Args:
            studio: of this session.
            dialog: the dialog that holds the form.
        """
        self.studio, self.dialog = studio, dialog
        self.numbers: dict[str, ui.number] = {}
        self.joints: list[dict[str, float]] = _rows("UR10")
        with tools():
            ui.html("The machine", sanitize=False, tag="h2").classes("st-title")
            ui.space()
            ui.button("Use this machine", icon="check", on_click=self._use).props("no-caps unelevated")
            ui.button("Close", on_click=dialog.close).props("no-caps flat")
        with ui.element("div").classes("st-two st-wide-right"):
            with box():
                self._build_numbers()
            with box():
                self.said = note().style("white-space: pre-wrap").mark("machine-said")
                self.drawn = (
                    ui.html("", sanitize=False).classes("st-svg w-full").props("tabindex=0").mark("machine-drawing")
                )
                self.arm = Picture("the arm with all joints at zero").classes("w-full").style("height: 60vh")
        ui.timer(0.01, self._kind, once=True)

    def _build_numbers(self) -> None:
        with tools():
            self.kind = ui.toggle(
                {"three-ptt": "3-PTT", "serial": "Serial arm"}, value="three-ptt", on_change=self._kind
            )
            self.kind.props('no-caps dense aria-label="kind of machine"')
            self.name = ui.input("name", value="machine", on_change=self._draw).props("dense outlined debounce=400")
        with ui.element("div").classes("w-full") as self.of_ptt:
            self.above = ui.toggle(
                {True: "sliders above the platform", False: "below"}, value=True, on_change=self._draw
            )
            self.above.props('no-caps dense aria-label="side of the sliders"').style("margin: 8px 0")
            with ui.element("div").style(
                "display: grid; grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); gap: 8px; width: 100%"
            ):
                for key, (words, value) in NUMBERS.items():
                    field = ui.number(words, value=value, on_change=self._draw).props("dense outlined debounce=400")
                    self.numbers[key] = field
        with ui.element("div").classes("w-full") as self.of_arm:
            with tools().style("margin: 8px 0"):
                preset = ui.select(
                    list(PRESETS), value="UR10", label="preset", on_change=lambda event: self._preset(event.value)
                )
                preset.props("dense outlined").classes("w-48")
                self.convention = ui.toggle(["standard", "modified"], value="standard", on_change=self._draw)
                self.convention.props('no-caps dense aria-label="Denavit-Hartenberg convention"')
            self.table = ui.element("div").classes("st-grid")

    def _preset(self, name: str) -> None:
        self.convention.set_value(PRESETS[name][0])
        self.joints = _rows(name)
        self.name.set_value(name)
        self._fill()

    def _fill(self) -> None:
        """Build the table of joints."""
        self.table.clear()
        with self.table, ui.element("table").classes("st-plain"):
            with ui.element("thead"), ui.element("tr"):
                for title in ("joint", "a [mm]", "alpha [deg]", "d [mm]", "theta [deg]"):
                    ui.html(title, sanitize=False, tag="th").props("scope=col")
            with ui.element("tbody"):
                for number, row in enumerate(self.joints, 1):
                    with ui.element("tr"):
                        ui.html(str(number), sanitize=False, tag="td")
                        for key in JOINT:
                            with ui.element("td"):
                                cell = ui.number(
                                    value=row[key], on_change=lambda event, r=row, k=key: self._set(r, k, event.value)
                                )
                                cell.props("dense debounce=400").props["aria-label"] = f"{key} of joint {number}"
        with self.table, tools():
            ui.button("Joint", icon="add", on_click=lambda: self._more(1)).props("no-caps dense flat")
            ui.button("Joint", icon="remove", on_click=lambda: self._more(-1)).props("no-caps dense flat")

    async def _set(self, row: dict[str, float], key: str, value: float | None) -> None:
        row[key] = float(value or 0.0)
        await self._draw()

    async def _more(self, count: int) -> None:
        self.joints = (
            [*self.joints, dict.fromkeys(JOINT, 0.0)] if count > 0 else self.joints[: max(1, len(self.joints) - 1)]
        )
        self._fill()
        await self._draw()

    async def _kind(self) -> None:
        arm = self.kind.value == "serial"
        self.of_ptt.set_visibility(not arm)
        self.of_arm.set_visibility(arm)
        self.drawn.set_visibility(not arm)
        self.arm.set_visibility(arm)
        if arm:
            self._fill()
        await self._draw()

    @property
    def text(self) -> str:
        """The machine.toml of the form."""
        if self.kind.value == "serial":
            return arm_text(str(self.name.value), str(self.convention.value), list(self.joints))
        return three_ptt_text(
            str(self.name.value), bool(self.above.value), {k: n.value for k, n in self.numbers.items()}
        )

    async def _draw(self) -> None:
        """Draw the machine, or show what is wrong with the numbers."""
        text = self.text
        try:
            parse_machine(text, "machine.toml")
        except PttError as error:
            self.said.set_text(str(error))
            return
        found: Mapping[str, Any] | None = await self.studio.work("drawing the machine", "describe", text, how="aside")
        if found is None or text != self.text:
            return
        self.said.set_text(pretty(found["words"]))
        self.drawn.set_content(found["svg"])
        if found["chain"]:
            from ptt.show.studio.machine_figure import chain_figure

            self.arm.show(chain_figure(found["chain"]))

    def _use(self) -> None:
        try:
            parse_machine(self.text, "machine.toml")
        except PttError as error:
            self.said.set_text(str(error))
            return
        self.studio.stage(machine=self.text)
        self.dialog.close()


def _rows(name: str) -> list[dict[str, float]]:
    return [dict(zip(JOINT, map(float, row), strict=True)) for row in PRESETS[name][1]]


def _number(value: float) -> str:
    """A number with all the digits that were entered: six would shift a machine of metres by micrometres."""
    return repr(float(value))


def _plain(name: str) -> str:
    return re.sub(r'["\\\x00-\x1f]', "", name).strip()[:60] or "machine"
