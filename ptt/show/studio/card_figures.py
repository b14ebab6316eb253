"""Pictures of findings: readings with the fit of an effect, a ruler of usual sizes, an unknown's curve, a signature."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ptt.dependence.contexts import is_direction
from ptt.effects.phrases import scaled
from ptt.show.card.words import prefixed, pretty, spoken
from ptt.show.studio.figures import ABOVE, BLUE, ORANGE, PALE, Figure, across_axis, axis_of, points, whole_figure

RULER = (-2.0, 2.0)  # ends of a ruler, as powers of ten times the usual size


def fit_figure(fit: Mapping[str, Any], serial: bool) -> Figure:
    """The run's residual without one effect, and the part of it that the effect explains.

    Args:
        fit: of the effect, from `ptt.show.card.fits.fits_of`.
        serial: whether the machine is an arm.

    Returns:
        The figure.
    """
    telling, (label, name, unit) = np.asarray(fit["telling"], dtype=float), fit["labels"]
    factor, shown = prefixed([*fit["data_um"], *fit["fit_um"]], unit)
    data, through = (factor * np.asarray(fit[key], dtype=float) for key in ("data_um", "fit_um"))
    axis, telling = across_axis(label, telling, serial, bool(fit.get("steps")))
    return whole_figure(
        [
            points(telling, data, PALE, "readings, everything else taken out"),
            points(telling, through, ORANGE, "the fit", 6),
        ],
        xaxis=axis,
        yaxis=axis_of(f"{name}: error [{shown}]", zeroline=True),
        showlegend=True,
        legend=ABOVE,
        margin={"l": 62, "r": 10, "t": 30, "b": 44},
    )


def ruler_html(value: Mapping[str, Any]) -> str:
    """A value on a logarithmic ruler centred on its usual size, as SVG; beyond the ends it is put on the end.

    Args:
        value: value of a finding.

    Returns:
        HTML.
    """
    power = math.log10(max(float(value["worth"]), 1e-12))
    place = min(max((power - RULER[0]) / (RULER[1] - RULER[0]), 0.0), 1.0)
    words = ruler_words(value)
    anchors = ("start", "middle", "middle", "middle", "end")
    marks = "".join(
        f'<g transform="translate({10 + 300 * i / 4},0)"><path d="M0 14v8" stroke="currentColor"/>'
        f'<text y="36" text-anchor="{anchor}" font-size="11" fill="currentColor">{each}</text></g>'
        for i, (each, anchor) in enumerate(zip(words, anchors, strict=True))
    )
    colour = "#d55e00" if power > 1.0 else "#0072b2"
    said = f"{value['worth']:.2g} times its usual size, {words[2]}"
    return (
        f'<svg viewBox="0 0 320 42" role="img" aria-label="{said}" style="width:100%;max-width:400px;height:auto">'
        '<path d="M10 18h300" stroke="currentColor" opacity=".5" stroke-width="2"/>'
        '<path d="M85 18h150" stroke="#009e73" stroke-width="5" opacity=".55"/>'
        f'{marks}<circle cx="{10 + 300 * place:.0f}" cy="18" r="7" fill="{colour}"/></svg>'
    )


def ruler_words(value: Mapping[str, Any]) -> tuple[str, ...]:
    """Labels of the five marks of a ruler: 0.01, 0.1, 1, 10 and 100 times the usual size.

    Args:
        value: value of a finding.

    Returns:
        For example '0.5 um', '5 um', 'usual 50 um', '500 um', '5 mm' with the real sign.
    """
    worth = float(value["worth"])
    if not worth > 0.0:
        return "1 %", "10 %", "usual", "10 times", "100 times"
    words = []
    for power in (-2, -1, 0, 1, 2):
        size = float(value["size"]) / worth * 10.0**power
        factor, unit = scaled([size], str(value["unit"]))
        text = f"{float(f'{factor * size:.2g}'):g} {unit}"
        words.append(text if power else f"usual {text}")
    return tuple(words)


def unknown_figure(unknown: Mapping[str, Any], serial: bool) -> Figure:
    """The curve that an unknown follows, with the readings.

    Args:
        unknown: the leading dependence with its points, from `ptt.show.studio.jobs.diagnose`.
        serial: whether the machine is an arm.

    Returns:
        The figure.
    """
    curve, read = unknown["curve"], unknown["points"]
    angle = str(unknown["residual"]).startswith("joint")
    factor, unit = prefixed([*read["um"], *curve["mean_um"]], "urad" if angle else "um")
    mean, half = factor * np.asarray(curve["mean_um"]), factor * np.asarray(curve["half_width_um"])
    at, of = np.asarray(curve["at"], dtype=float), read.get("unit", "")
    scale, of = prefixed(read["at"], "s") if of == "s" else (1.0, of.replace("C", "\N{DEGREE SIGN}C"))
    order = np.argsort(at)
    at, mean, half = scale * at[order], mean[order], half[order]
    on = unknown["with"] or unknown["on"]
    across = "reading number" if on == "time" and not of else spoken(on, serial)
    across += (" within one period" if unknown["period_mm"] else "") + (f" [{of}]" if of else "")
    up = f"{unknown['residual']}{' times the way it came' if unknown['with'] else ''}: error [{unit}]"
    sided = is_direction(str(unknown["on"])) and not unknown["with"]
    axis, place = across_axis(across, scale * np.asarray(read["at"]), serial, sided)
    data = [points(place, factor * np.asarray(read["um"]), PALE, "readings")]
    if sided:
        data.append({**points(at, mean, ORANGE, "mean", 13), "error_y": {"type": "data", "array": half.tolist()}})
    else:
        data += _followed(at, mean, half)
    return whole_figure(
        data,
        xaxis=axis,
        yaxis=axis_of(up, zeroline=True),
        showlegend=True,
        legend=ABOVE,
        margin={"l": 66, "r": 12, "t": 30, "b": 48},
    )


def _followed(at: np.ndarray, mean: np.ndarray, half: np.ndarray) -> list[Figure]:
    """A curve with its 95 % band."""
    line = {"mode": "lines", "line": {"color": ORANGE, "width": 4}}
    band = {
        "type": "scatter", "x": [*at.tolist(), *at[::-1].tolist()],
        "y": [*(mean + half).tolist(), *(mean - half)[::-1].tolist()], "fill": "toself",
        "fillcolor": "rgba(230,159,0,0.25)", "line": {"width": 0}, "name": "95 % band", "hoverinfo": "skip",
    }  # fmt: skip
    return [{**points(at, mean, ORANGE, "what it follows"), **line}, band]


def sign_figure(sign: Mapping[str, Any]) -> Figure:
    """The signature of an effect at usual size on the sample machine.

    Args:
        sign: 'telling', 'residual', 'shade' and 'labels', as of `ptt.show.plots.atlas.Signature`.

    Returns:
        The figure.
    """
    shade, (across, up, third) = sign["shade"], sign["labels"]
    x, y = (np.asarray(sign[key], dtype=float) for key in ("telling", "residual"))
    levels = [] if shade is None else sorted(set(shade))
    if len(levels) == 2:
        sides = [(np.asarray(shade) == level, level) for level in levels]
        data = [
            points(x[own], y[own], colour, f"{third} {level:+g}", 6)
            for (own, level), colour in zip(sides, (BLUE, ORANGE), strict=True)
        ]
    else:
        data = [points(x, y, BLUE, "", 6)]
        if shade is not None:
            bar = {"title": {"text": third, "side": "right"}, "thickness": 12}
            data[0]["marker"] |= {"color": list(shade), "colorscale": "Cividis", "colorbar": bar}
    return whole_figure(
        data,
        xaxis=axis_of(across),
        yaxis=axis_of(pretty(up), zeroline=True),
        showlegend=len(levels) == 2,
        legend=ABOVE,
        margin={"l": 62, "r": 10, "t": 28, "b": 44},
    )
