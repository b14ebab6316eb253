"""Draw what benchmarks/ur10.py found: `python benchmarks/ur10_picture.py FIGURES.json [MORE.json] --out ur10.png`.

Bars are the error of readings held out, um: full colour by blocks of the run (for A + B -> C the other series), pale by
a random 30 %.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

MODELS = (
    ("drawing, frame fitted", "drawing", "#9aa0a6"),
    ("full DH fit", "dh-offsets", "#4c78a8"),
    ("DH + Gaussian process", "dh-offsets + Gaussian process", "#72b7b2"),
    ("DH + gradient boosting", "dh-offsets + gradient boosting", "#eeca3b"),
    ("DH + joints that yield", "dh-offsets + axis-compliance", "#f58518"),
    ("... + joints that turn unevenly", "dh-offsets + axis-compliance + joint-error-map", "#d1495b"),
)


def find(rows: Sequence[dict[str, Any]], series: str, model: str) -> tuple[float, float]:
    """Error by blocks and by random rows; a transfer has one figure only. NaN where it was not tried."""
    for row in rows:
        if row["series"] == series and row["model"] == model and "random" in row:
            return float(row.get("blocks", row["random"])), float(row["random"])
    return float("nan"), float("nan")


def draw(axis: Axes, rows: Sequence[dict[str, Any]]) -> None:
    """Bars of every model for each series."""
    series = list(dict.fromkeys(row["series"] for row in rows))
    width = 0.8 / len(MODELS)
    for index, (label, model, colour) in enumerate(MODELS):
        found = np.array([find(rows, name, model) for name in series])
        place = np.arange(len(series)) + (index - (len(MODELS) - 1) / 2) * width
        axis.bar(place, found[:, 0], 0.95 * width, color=colour, label=label)
        axis.bar(place, found[:, 1], 0.5 * width, color="white", alpha=0.45)
        for x, value in zip(place, found[:, 0], strict=True):
            if np.isfinite(value):
                axis.text(x, value * 1.02, f"{value:.0f}", ha="center", va="bottom", fontsize=8)
    axis.set_xticks(range(len(series)), [name.replace("->", "\u2192") for name in series])
    axis.set(yscale="log", ylabel="held-out error, um", ylim=(50, 2500))
    axis.set_yticks([50, 100, 200, 500, 1000], ["50", "100", "200", "500", "1000"])
    axis.minorticks_off()
    axis.grid(axis="y", alpha=0.3)
    axis.legend(ncols=3, fontsize=9, loc="upper center", frameon=False)
    axis.set_title("A real UR10: error of readings that nothing was fitted on (wide: by blocks; pale: random 30 %)")


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("figures", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    figure = Figure(figsize=(11.0, 5.2), layout="constrained")
    draw(figure.subplots(), [row for path in asked.figures for row in json.loads(path.read_text())])
    with asked.out.open("wb") as file:
        FigureCanvasAgg(figure).print_png(file, metadata={"Software": None})


if __name__ == "__main__":
    main()
