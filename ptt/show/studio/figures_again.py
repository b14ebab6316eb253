"""Pictures of the view Again as plotly dictionaries: two runs from above, error and values by date."""

from collections.abc import Mapping, Sequence
from datetime import date, timedelta
from typing import Any

import numpy as np

from ptt.show.card.words import length, prefixed
from ptt.show.studio.figures import ABOVE, BLUE, GREY, ORANGE, Figure, axis_of, whole_figure

WHEN = ("before", "after")
DAYS = 5  # days from the first to the last run up to which each day of a run has its own tick
MICRO = "\N{MICRO SIGN}m"
SHOWN_SHARE = 0.99  # quantile of errors at which scales end: a gross error would make all others one colour


def pair_figure(pair: Mapping[str, Any], when: str) -> Figure:
    """The tool's error in one of two runs, from above; both have the same scales of length and colour.

    Args:
        pair: 'pair' of the job `ptt.show.studio.jobs_again.again`.
        when: which of the two: 'before' or 'after'.

    Returns:
        The figure.
    """
    times = float(pair["arrows"]["times"])
    every = {each: _both(pair, each) for each in WHEN}
    top = max(float(np.quantile(_size(error), SHOWN_SHARE)) for _, error in every.values())
    reach = np.concatenate([where for place, error in every.values() for where in (place, place + times * error)])
    (place, error), (low, high) = every[when], np.quantile(reach[:, :2], (1.0 - SHOWN_SHARE, SHOWN_SHARE), axis=0)
    room = 0.08 * max(float((high - low).max()), 1e-3)
    tip = place + times * error
    lines = {axis: _parted(place[:, i], tip[:, i]) for i, axis in enumerate("xy")}
    marker = {
        "size": 7, "color": _size(error).tolist(), "cmin": 0.0, "cmax": top, "colorscale": "Cividis", "showscale": True,
        "colorbar": {"title": {"text": f"error [{MICRO}]", "side": "right"}, "thickness": 10, "outlinewidth": 0},
    }  # fmt: skip
    thin = {"color": GREY, "width": 1}
    data = [
        {"type": "scatter", "mode": "lines", **lines, "line": thin, "hoverinfo": "skip"},
        {"type": "scatter", "mode": "markers", "x": tip[:, 0].tolist(), "y": tip[:, 1].tolist(), "marker": marker,
         "text": [length(size) for size in _size(error)], "hoverinfo": "text"},
    ]  # fmt: skip
    return whole_figure(
        data,
        showlegend=False,
        xaxis={**axis_of("x [mm]"), "range": [low[0] - room, high[0] + room]},
        yaxis={**axis_of("y [mm]"), "range": [low[1] - room, high[1] + room], "scaleanchor": "x"},
        margin={"l": 54, "r": 10, "t": 8, "b": 44},
    )


def error_figure(history: Sequence[Mapping[str, Any]]) -> Figure:
    """The error of each run with the model, by date, and the noise.

    Args:
        history: runs as `ptt fleet show --json` lists them.
    """
    told = [run for run in history if run["error_um"] is not None]
    days = [str(run["date"])[:10] for run in told]
    errors = [float(run["error_um"]) for run in told]
    noisy = [(str(run["date"])[:10], float(run["noise_um"])) for run in history if run["noise_um"] is not None]
    factor, unit = prefixed([*errors, *(noise for _, noise in noisy)], "um")
    data = [
        {"type": "scatter", "mode": "lines+markers", "name": "error with the model", "x": days,
         "y": [factor * error for error in errors], "line": {"color": BLUE}, "marker": {"size": 8}},
        {"type": "scatter", "mode": "lines", "name": "noise", "x": [day for day, _ in noisy],
         "y": [factor * noise for _, noise in noisy], "line": {"color": GREY, "dash": "dash"}},
    ]  # fmt: skip
    return _dated(data, f"error [{unit}]", [str(run["date"])[:10] for run in history], legend=True)


def value_figure(value: Mapping[str, Any]) -> Figure:
    """One value by date as fitted to each run alone, with its standard errors; orange where it drifts or jumps.

    Args:
        value: one of 'months', 'values' of the job `ptt.show.studio.jobs_again.again`.
    """
    factor, unit = prefixed(value["value"], value["unit"])
    colour = ORANGE if value["moves"] else BLUE
    data = [
        {"type": "scatter", "mode": "lines+markers", "x": value["days"],
         "y": [factor * each for each in value["value"]],
         "error_y": {"type": "data", "array": [factor * each for each in value["std"]], "color": colour},
         "marker": {"size": 8, "color": colour}, "line": {"color": GREY, "width": 1}},
    ]  # fmt: skip
    return _dated(data, f"[{unit}]", value["days"])


def _both(pair: Mapping[str, Any], when: str) -> tuple[np.ndarray, np.ndarray]:
    """Positions and errors of one of two runs, (n, 3) mm each."""
    own = pair["arrows"][when]
    return np.asarray(own["place"], dtype=float), np.asarray(own["error"], dtype=float)


def _size(error: np.ndarray) -> np.ndarray:
    """Lengths of errors, um."""
    return np.asarray(1e3 * np.linalg.norm(error, axis=1))


def _parted(start: np.ndarray, end: np.ndarray) -> list[float | None]:
    """Coordinates of separate line segments as one list, with None between segments."""
    return [value for pair in zip(start.tolist(), end.tolist(), strict=True) for value in (*pair, None)]


def _dated(data: list[Figure], title: str, days: Sequence[str], legend: bool = False) -> Figure:
    """Traces by date; those with a legend, which are errors, from zero on."""
    return whole_figure(
        data,
        xaxis=axis_of("") | {"type": "date", "hoverformat": "%Y-%m-%d"} | _ticks(sorted(map(date.fromisoformat, days))),
        yaxis=axis_of(title) | ({"rangemode": "tozero"} if legend else {}),
        showlegend=legend,
        legend=ABOVE,
        margin={"l": 60, "r": 10, "t": 28 if legend else 10, "b": 32},
    )


def _ticks(days: Sequence[date]) -> Figure:
    """Ticks of an axis of dates; where runs are few days apart one a day, as plotly would add hours."""
    if not days or (days[-1] - days[0]).days > DAYS:
        return {"nticks": 6}
    ends = [(day + timedelta(days=step)).isoformat() for day, step in ((days[0], -1), (days[-1], 1))]
    return {"range": ends, "tickvals": [day.isoformat() for day in sorted(set(days))], "tickformat": "%Y-%m-%d"}
