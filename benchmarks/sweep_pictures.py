"""Pictures of sweeps: how often a fault is found by its size, what is taken for what, what a probability is worth."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from ptt.effects import library

Rows = list[dict[str, Any]]
NOTHING = "nothing"
GOOD = ("exact", "declared", "fair")
BINS = np.array([0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0])


def draw_reliability(said: list[tuple[float, bool]], place: Path) -> None:
    """Stated probability against how often it was so."""
    import matplotlib.pyplot as plt

    chance, hit = (np.array(values, dtype=float) for values in zip(*said, strict=True))
    figure, axes = plt.subplots(figsize=(5.0, 4.6), layout="constrained")
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linestyle="--", linewidth=1)
    for low, high in itertools.pairwise(BINS):
        here = (chance >= low) & (chance < high) if high < 1.0 else chance >= low
        if here.any():
            right, count = hit[here].mean(), int(here.sum())
            bars = _bars(hit[here])
            axes.errorbar(chance[here].mean(), right, yerr=bars, fmt="o", color="#1f5a96", capsize=3)
            last = high == 1.0  # stands close to the others: its number is above it
            end = (chance[here].mean(), right + bars[1][0] if last else right - bars[0][0])
            aside = (0, 5 if last else -12)
            axes.annotate(str(count), end, textcoords="offset points", xytext=aside, ha="center", fontsize=8)
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.07), xlabel="probability stated", ylabel="share that was so")
    axes.set_title(f"{len(said)} statements")
    axes.grid(alpha=0.3)
    figure.savefig(place, dpi=150)
    plt.close(figure)


def draw_detection(rows: Rows, path: Path) -> None:
    """How often a fault is named against the size that it leaves."""
    import matplotlib.pyplot as plt

    size = np.array([next(iter(row["hidden"].values())) for row in rows])
    hit = np.array([row["outcome"] in GOOD for row in rows], dtype=float)
    edges = np.array([0.1, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 8.0, 16.0, 1000.0])
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for low, high in itertools.pairwise(edges):
        here = (size >= low) & (size < high)
        if here.any():
            share, count = hit[here].mean(), int(here.sum())
            middle = np.exp(np.log(size[here]).mean())
            axes.errorbar(middle, share, yerr=_bars(hit[here]), fmt="o", color="#1f5a96", capsize=3)
            aside = (6, -12 if share > 0.1 else 6)  # above the axis
            axes.annotate(str(count), (middle, share), textcoords="offset points", xytext=aside, fontsize=8)
    axes.axvline(2.0, color="0.6", linestyle="--", linewidth=1)
    axes.annotate("counts from here on", (2.0, 0.05), textcoords="offset points", xytext=(4, 0), fontsize=8)
    axes.set(xscale="log", ylim=(-0.03, 1.05), xlabel="what the fault leaves, frame out / noise of one reading (rms)")
    axes.set(ylabel="share named right, and nothing else", title=f"One hidden effect, {len(rows)} rigs")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def draw_confusion(rows: Rows, path: Path) -> None:
    """Hidden effect against the effect that was named first."""
    import matplotlib.pyplot as plt

    first = [_base(row["named"][0][0]) if row["named"] else NOTHING for row in rows]
    truth = [next(iter(row["hidden"])) for row in rows]
    seen = [name for name in library() if name in truth]  # in the order of the causal chain
    across = seen + sorted(set(first) - set(seen) - {NOTHING}) + [NOTHING]
    table = pd.crosstab(pd.Categorical(truth, seen), pd.Categorical(first, across), dropna=False).to_numpy()
    share = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    figure, axes = plt.subplots(figsize=(0.42 * len(across) + 3.0, 0.36 * len(seen) + 2.6), layout="constrained")
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (line, column), count in np.ndenumerate(table):
        if count:
            dark = share[line, column] > 0.5
            axes.text(column, line, count, ha="center", va="center", fontsize=8, color="w" if dark else "k")
    axes.set_xticks(range(len(across)), across, rotation=60, ha="right", rotation_mode="anchor", fontsize=8)
    axes.set_yticks(range(len(seen)), seen, fontsize=8)
    axes.set_xticks(np.arange(len(across)) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(seen)) - 0.5, minor=True)
    axes.grid(which="minor", color="0.85", linewidth=0.6)
    axes.tick_params(which="both", length=0)
    axes.set(xlabel="named first", ylabel="hidden", title=_title(rows))
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _bars(hit: np.ndarray) -> list[list[float]]:
    """Lengths below and above the share of hits, (2, 1): the 95 % interval of a proportion (Wilson), within 0 and 1."""
    share = float(hit.mean())
    ends = binomtest(int(hit.sum()), len(hit)).proportion_ci(method="wilson")
    return [[max(share - ends.low, 0.0)], [max(ends.high - share, 0.0)]]


def _title(rows: Rows) -> str:
    large = sum(bool(row["counted"]) for row in rows)
    return f"{len(rows)} rigs with one hidden effect; {large} leave at least 2 x noise"


def _base(key: str) -> str:
    return key.partition("[")[0]
