"""Pictures of a fleet: the error of all machines by date, and of one machine its error and its main values."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from ptt.effects.phrases import SHOWN_UNITS
from ptt.fleet.overview import Standing
from ptt.fleet.store import shown
from ptt.run.dates import days_of
from ptt.show.plots.common import BLUE, DARK, DPI, NUMBERS, ORANGE, PALE, png

MOST_VALUES = 6  # values drawn of one machine
WIDE = 5.0  # ratio of largest to least error above which ticks of a log scale are at 1, 2, 5 only, to stay apart
NAME = 28  # characters of a name that fit beside a picture
ROWS = 60  # most machines in one picture of the fleet


def draw_fleet(machines: Sequence[Standing]) -> list[bytes]:
    """Pictures (PNG) of the error of all machines: a row of coloured marks by date for each, `ROWS` to a picture."""
    told = [machine for machine in machines if _errors(machine)]
    return [_strips(told[start : start + ROWS]) for start in range(0, len(told), ROWS)]


def draw_machine(machine: Standing) -> bytes | None:
    """Picture (PNG) of one machine's error and values by date; None where fewer than two runs have an error."""
    errors = _errors(machine)
    if len(errors) < 2:
        return None
    places = _worth_drawing(machine)
    figure = Figure(figsize=(9.0, 2.2 * (1 + -(-len(places) // 2))), dpi=DPI, layout="constrained")
    grid = figure.add_gridspec(1 + -(-len(places) // 2), 2)
    _draw_error(figure.add_subplot(grid[0, :]), machine)
    for number, place in enumerate(places):
        _draw_value(figure.add_subplot(grid[1 + number // 2, number % 2]), machine, place)
    return png(figure)


def _strips(machines: Sequence[Standing]) -> bytes:
    figure = Figure(figsize=(9.0, max(2.8, 1.2 + 0.22 * len(machines))), dpi=DPI, layout="constrained")
    panel = figure.add_subplot()
    every = [(day, error, row) for row, machine in enumerate(machines) for day, error in _errors(machine)]
    days, errors, rows = (np.array(part) for part in zip(*every, strict=True))
    drawn = panel.scatter(
        days,
        rows,
        c=errors,
        s=60,
        marker="s",
        cmap="viridis",
        norm="log" if errors.min() > 0 else None,
    )
    alarmed = [(row, machine) for row, machine in enumerate(machines) if machine.alarms]
    if alarmed:
        last = [_errors(machine)[-1][0] for _, machine in alarmed]
        panel.scatter(
            last, [row for row, _ in alarmed], s=130, marker="o", facecolors="none", edgecolors=ORANGE, linewidths=2.0,
            label="alarm",
        )  # fmt: skip
        figure.legend(loc="outside lower center", frameon=False, fontsize=9)
    panel.set_yticks(range(len(machines)), [_short(machine.machine) for machine in machines], fontsize=8)
    panel.set_ylim(len(machines) - 0.5, -0.5)
    panel.grid(axis="x", alpha=0.3)
    _date_axis(panel)
    bar = figure.colorbar(drawn, label="error left with the model, um")
    if errors.min() > 0 and errors.max() > WIDE * errors.min():
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(NUMBERS)
    bar.ax.yaxis.set_minor_formatter(NUMBERS)
    return png(figure)


def _draw_error(panel: Axes, machine: Standing) -> None:
    days, errors = zip(*_errors(machine), strict=True)
    panel.plot(days, errors, "o-", color=BLUE, label="error left with the model")
    noise = [(days_of(past.date), past.noise_um) for past in machine.past if past.noise_um is not None]
    if noise:
        panel.plot([day for day, _ in noise], [each for _, each in noise], "--", color=DARK, label="noise")
    accepted = [(days_of(past.date), past.left_um) for past in machine.past if past.left_um is not None]
    if accepted:
        panel.plot(*zip(*accepted, strict=True), "D", color=ORANGE, label="with the model accepted then")
    panel.set_ylim(0.0, 1.15 * max([*errors, *(each for _, each in (*noise, *accepted))]) or 1.0)
    panel.set_ylabel("um")
    panel.legend(fontsize=8, frameon=False)
    _date_axis(panel)


def _draw_value(panel: Axes, machine: Standing, place: int) -> None:
    moves, names = machine.moves, machine.names
    assert moves is not None
    factor, unit = SHOWN_UNITS.get(names.units[place], (1.0, names.units[place]))
    factor *= float(names.usual[place])
    moving = any(movement.place == place for movement in moves.movements)
    told = np.isfinite(moves.std[:, place])
    panel.errorbar(
        machine.days[told], moves.values[told, place] * factor,
        moves.std[told, place] * factor, fmt="o", color=ORANGE if moving else BLUE, ecolor=PALE, markersize=4,
    )  # fmt: skip
    panel.plot(machine.days[told], moves.course[told, place] * factor, color=DARK, linewidth=1.0)
    panel.set_title(names.labels[place], fontsize=9)
    panel.set_ylabel(unit)
    _date_axis(panel)


def _worth_drawing(machine: Standing) -> list[int]:
    """Indices of values to draw: those with a drift or jump, then the largest in usual sizes that are significant."""
    if machine.moves is None:
        return []
    moving = list(dict.fromkeys(movement.place for movement in machine.moves.movements))
    sure = np.abs(machine.moves.values[-1]) / machine.moves.std[-1]
    size = np.where(sure > 3.0, np.abs(machine.moves.values[-1]), 0.0)
    rest = [int(place) for place in np.argsort(-size) if size[place] > 0.0 and place not in moving]
    return [*moving, *rest][:MOST_VALUES]


def _errors(machine: Standing) -> list[tuple[float, float]]:
    """Date (days since 1970) and error (um) of each run that has one."""
    return [(days_of(past.date), past.error_um) for past in machine.past if past.error_um is not None]


def _short(name: str) -> str:
    text = shown(name).replace("$", r"\$")  # matplotlib reads text between two of them as mathematics
    return text if len(text) <= NAME else f"{text[: NAME - 1]}…"


def _date_axis(panel: Axes) -> None:
    locator = AutoDateLocator(maxticks=8)
    panel.xaxis.set_major_locator(locator)
    panel.xaxis.set_major_formatter(ConciseDateFormatter(locator))
