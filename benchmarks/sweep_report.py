"""Figures and pictures of a sweep."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ptt.effects import library
from ptt.rig.draw import fault_names

Rows = list[dict[str, Any]]
NOTHING, UNKNOWN = "nothing", "unknown"
METROLOGY = ("tracker-scale", "tracker-drift", "setup-jump")


def report(rows: Rows, level: str, out: Path, seconds: float) -> str:
    """Write the table and the pictures of a sweep, and sum it up in words."""
    good = [row for row in rows if "error" not in row]
    lines = [f"{level}: {len(rows)} rigs in {seconds:.0f} s; diagnose {_median(good, 'seconds'):.2f} s (median)"]
    lines += [f"  BROKEN seed {row['seed']} {list(row['hidden'])} {row['error']}" for row in rows if "error" in row]
    flat = pd.DataFrame([{**row, "named": "; ".join(" = ".join(group) for group in row["named"])} for row in good])
    flat.to_csv(out / f"{level}.csv", index=False)
    if level == "none":
        return "\n".join(lines + _silence(good))
    counted = [row for row in good if _judged(row)]
    which = "the fault outside the library" if level == "unknown" else "all faults"
    lines.append(f"  {len(counted)} with {which} at 2 x noise or more, judged below")
    lines += {"single": _single, "multi": _multi, "unknown": _unknown}[level](good, counted)
    lines += _errors(counted)
    if level == "single":
        draw_detection(good, out / "detection.png")
        draw_confusion(good, out / "confusion.png")
    return "\n".join(lines + _failures(good))


def _judged(row: dict[str, Any]) -> bool:
    """Every fault counts; beside a fault outside the library small known ones may stand."""
    if row["level"] == "unknown":
        return any(name in row["counted"] for name in fault_names("unknown"))
    return set(row["hidden"]) == set(row["counted"])


def _silence(rows: Rows) -> list[str]:
    silent = [row["verdict"] == "nothing-missing" for row in rows]
    machine = [any(_base(group[0]) not in METROLOGY for group in row["named"]) for row in rows]
    drift = [{_base(group[0]) for group in row["named"]} == {"tracker-drift"} for row in rows]
    unknown = [row["verdict"] == "unknown" for row in rows]
    lines = [f"  nothing-missing {_share(silent)}; only tracker-drift {_share(drift)}"]
    lines.append(f"  a machine effect {_share(machine)}; unknown {_share(unknown)}")
    loud = [row for row in rows if row["verdict"] != "nothing-missing"]
    words = [f"{row['protocol']}: {row['verdict']} {row['named']} {row['reasons']}" for row in loud]
    return lines + [f"  seed {row['seed']} {word}" for row, word in zip(loud, words, strict=True)]


def _single(rows: Rows, counted: Rows) -> list[str]:
    first = [bool(row["named"]) and row["named"][0][0] in row["hidden"] for row in counted]
    right = [hit or row["outcome"] in ("exact", "declared") for hit, row in zip(first, counted, strict=True)]
    clean = [row["outcome"] in ("exact", "declared") for row in counted]
    apart = [row for row in counted if not row["rivals"]]
    alone = [row["named"] == [[next(iter(row["hidden"]))]] for row in apart]
    lines = [f"  right effect first {_share(first)}; or in a declared group of at most 3, confirmed {_share(right)}"]
    lines.append(f"  the same, and nothing else added {_share(clean)}")
    lines.append(f"  named alone where the truth says it can be told {_share(alone)}")
    lines.append(f"  verdict 'unknown' in spite of it {_share([row['verdict'] == 'unknown' for row in counted])}")
    lines += _by(counted, clean, "protocol")
    small = [row for row in rows if not row["counted"]]
    if small:
        words = pd.Series([row["outcome"] for row in small]).value_counts()
        lines.append(f"  below 2 x noise: {', '.join(f'{count} {word}' for word, count in words.items())}")
    return lines


def _multi(rows: Rows, counted: Rows) -> list[str]:
    exact = [row["outcome"] == "exact" for row in counted]
    right = [row["outcome"] in ("exact", "declared") for row in counted]
    fair = [row["outcome"] in ("exact", "declared", "fair") for row in counted]
    lines = [f"  all found and nothing else {_share(exact)}; declared groups of at most 3 counted {_share(right)}"]
    lines.append(f"  names that the truth confirms as fair counted, too {_share(fair)}")
    lines.append(f"  verdict 'unknown' in spite of it {_share([row['verdict'] == 'unknown' for row in counted])}")
    everyone = [row["outcome"] in ("exact", "declared", "silent") for row in rows]
    lines.append(f"  all rigs, small faults free to be named or not {_share(everyone)}")
    return lines + _by(counted, right, "protocol")


def _unknown(rows: Rows, counted: Rows) -> list[str]:
    unknown = [row["verdict"] == "unknown" for row in counted]
    place = [row["verdict"] == "unknown" and row["place"] for row in counted]
    lines = [f"  verdict 'unknown' {_share(unknown)}; and the right variable first {_share(place)}"]
    for name in fault_names("unknown"):
        hits = [hit for hit, row in zip(place, counted, strict=True) if name in row["hidden"]]
        lines.append(f"    {name} {_share(hits)}")
    return lines


def _errors(rows: Rows) -> list[str]:
    after = [row["tool"]["after"] for row in rows if row["tool"]["after"] is not None]
    lines = [
        f"  held-out error at the end / noise, median: {_median(rows, 'heldout'):.3f} of the true noise, "
        f"{_median(rows, 'heldout_seen'):.3f} of the noise reported"
    ]
    if after:
        quarter = np.percentile(after, [50, 90, 100])
        lines.append(
            f"  true tool error after compensation / noise: median {quarter[0]:.2f}, 90 % below {quarter[1]:.2f}, "
            f"worst {quarter[2]:.2f}"
        )
    return lines


def _failures(rows: Rows) -> list[str]:
    lines = ["  not right:"]
    for row in rows:
        if row["level"] == "unknown":
            wrong = row["verdict"] != "unknown" or not row["place"]
        else:
            wrong = row["outcome"] not in ("exact", "declared", "silent") or row["verdict"] == "unknown"
        if wrong:
            hidden = ", ".join(f"{name} {size:.1f}x" for name, size in row["hidden"].items())
            named = "; ".join(" = ".join(group) for group in row["named"]) or NOTHING
            counts = "" if _judged(row) else " (small)"
            extra = f" depends {row['depends'][:1]}" if "depends" in row else f" {row['reasons'][:1] or ''}"
            line = (
                f"    seed {row['seed']} {row['protocol']}: {row['outcome']}, {row['verdict']}{counts}: hidden {hidden}"
            )
            lines.append(f"{line} -> {named}; held-out {row['heldout']:.2f}{extra}")
    return lines


def draw_detection(rows: Rows, path: Path) -> None:
    """How often a fault is named against the size that it leaves."""
    import matplotlib.pyplot as plt

    size = np.array([next(iter(row["hidden"].values())) for row in rows])
    hit = np.array([row["outcome"] in ("exact", "declared") for row in rows], dtype=float)
    edges = np.array([0.1, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 8.0, 16.0, 1000.0])
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for low, high in itertools.pairwise(edges):
        here = (size >= low) & (size < high)
        if here.any():
            share, count = hit[here].mean(), int(here.sum())
            half = 1.96 * np.sqrt(max(share * (1 - share), 0.25 / count) / count)
            middle = np.exp(np.log(size[here]).mean())
            bars = [[share - max(share - half, 0.0)], [min(share + half, 1.0) - share]]
            axes.errorbar(middle, share, yerr=bars, fmt="o", color="#1f5a96", capsize=3)
            axes.annotate(str(count), (middle, share), textcoords="offset points", xytext=(6, -12), fontsize=8)
    axes.axvline(2.0, color="0.6", linestyle="--", linewidth=1)
    axes.annotate("counts from here on", (2.0, 0.05), textcoords="offset points", xytext=(4, 0), fontsize=8)
    axes.set(xscale="log", ylim=(-0.03, 1.05), xlabel="what the fault leaves, frame out / noise of one reading (rms)")
    axes.set(ylabel="share named right and alone", title=f"One hidden effect, {len(rows)} rigs")
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


def _title(rows: Rows) -> str:
    large = sum(bool(row["counted"]) for row in rows)
    return f"{len(rows)} rigs with one hidden effect; {large} leave at least 2 x noise"


def _by(rows: Rows, hits: list[bool], key: str) -> list[str]:
    groups: dict[str, list[bool]] = {}
    for row, hit in zip(rows, hits, strict=True):
        groups.setdefault(row[key], []).append(hit)
    return ["    " + ", ".join(f"{name} {_share(group)}" for name, group in groups.items())]


def _share(hits: list[bool]) -> str:
    return f"{sum(hits)}/{len(hits)} = {100.0 * sum(hits) / max(len(hits), 1):.1f} %"


def _median(rows: Rows, key: str) -> float:
    return float(np.median([row[key] for row in rows])) if rows else float("nan")


def _base(key: str) -> str:
    return key.partition("[")[0]
