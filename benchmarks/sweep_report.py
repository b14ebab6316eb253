"""Tables and pictures of sweeps, one folder or two beside one another: `sweep_report.py OUT [BEFORE]`."""

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from sweep_pictures import draw_confusion, draw_detection, draw_reliability

from ptt.challenge.hide import FAULTS

Row = dict[str, Any]
Rows = list[Row]
LEVELS = ("none", "single", "multi", "unknown", "dense")
NOISE_FREE = "bench"  # name of the bench's own noise
GOOD = ("exact", "declared", "fair")
SURE = 0.9  # probability from which a statement has to be right in 95 of 100
ROSY = 1.5  # times the printed expectation, held-out error and doubt of the tool together, that re-measured may be


def judged(rows: Rows) -> Rows:
    """Cases that can be judged: every fault counts; the one that nobody knows, or that stands out, where others may."""

    def fair(row: Row) -> bool:
        if not row["rows"]:
            return True  # broken before anything was drawn: it must show
        if row["level"] == "unknown":
            return bool(set(row["outside"]) & set(row["counted"]))
        if row["level"] == "dense":
            return _main(row) in row["counted"]
        return set(row["hidden"]) == set(row["counted"])

    return [row for row in rows if fair(row)]


def is_right(row: Row) -> bool:
    """Silent where nothing is hidden, 'unknown' where nobody knows it, all the names and no other elsewhere.

    Where all sizes of the drawing are off beside one fault, that one has to be named and nothing that is not there.
    """
    if "error" in row:
        return False
    if row["level"] in ("none", "unknown"):
        return bool(row["right"])
    if row["level"] == "dense":
        named = any(_main(row) in group for group in row["named"])
        return named and not wrong_names(row) and row["verdict"] == "missing"
    return row["outcome"] in GOOD and row["verdict"] == "missing"


def _main(row: Row) -> str:
    """What the library calls the fault that a rig was drawn for."""
    return FAULTS[row["faults"][0]].called


def wrong_names(row: Row) -> int:
    """Names of what is not there and does the work of nothing that is."""
    return sum(word in ("wrong", "partial") for word in row.get("words", {}).values())


def knows_noise(row: Row) -> bool:
    """Whether machine file, std columns or repeats tell the noise."""
    return bool(row["sigma_told"] or row["std_told"] or row["repeats"] != "none")


def first_right(row: Row) -> bool:
    """Whether the first name is hidden, or stands for something hidden by the truth."""
    named = row.get("named")
    return bool(named) and row["words"].get(named[0][0]) in ("right", "fair")


def leads_right(row: Row) -> bool:
    """Whether the variable that is told first is one that the fault outside the library follows, or runs with one."""
    return bool(row["leading"] and row["leading"]["near"])


def summary(level: str, rows: Rows) -> str:
    """One line on a family."""
    counted = judged(rows)
    refused = sum(row.get("refused", False) for row in rows)
    broken = sum("error" in row for row in rows) - refused
    good = [row for row in counted if "error" not in row]
    line = f"{level:<8}{len(rows):>4} rigs, {len(counted)} judged: right {share(map(is_right, counted))}"
    line += f"; wrong names {mean(map(wrong_names, good)):.2f} a run"
    if level == "single":
        line += f"; first {share(map(first_right, counted))}"
    if level == "unknown":
        told = [row for row in good if row["verdict"] == "unknown"]
        line += f"; leading variable {share(map(leads_right, good))}, where told {share(map(leads_right, told))}"
        line += f", to the letter {sum(bool(row['leading'] and row['leading']['right']) for row in good)}"
        silent = [row for row in good if row["verdict"] == "nothing-missing"]
        line += f"; nothing-missing {len(silent)}, noise stated in {sum(map(knows_noise, silent))}"
    tools = [row["tool"] for row in rows if row.get("tool")]
    line += f"; worse {sum(tool['worse'] for tool in tools)}/{len(tools)}"
    told = [tool["rosy"] for tool in tools if tool.get("rosy")]
    line += f", beyond {ROSY} x {sum(one > ROSY for one in told)}/{len(told)}"
    line += f", with sigma_um {sum(tool.get('unforeseen', 0.0) > ROSY for tool in tools)}"
    line += f"; {np.median([row['seconds'] for row in good] or [np.nan]):.2f} s; refused {refused}, broken {broken}"
    return line


def share(hits: Iterable[bool]) -> str:
    """3/4 = 75 %."""
    values = list(hits)
    return f"{sum(values)}/{len(values)} = {100.0 * sum(values) / max(len(values), 1):.0f} %"


def mean(values: Iterable[float]) -> float:
    """Mean of any number of values, 0 of none."""
    numbers = list(values)
    return sum(numbers) / max(len(numbers), 1)


def table(rows: Rows, key: Callable[[Row], str], before: Rows = ()) -> list[str]:
    """Right, wrong names and broken, group by group; the same of `before` beside it."""
    groups = sorted({key(row) for row in rows})
    lines = []
    for name in groups:
        cells = [_cell([row for row in side if key(row) == name]) for side in (rows, before) if side]
        lines.append(f"    {name:<24}" + "   before ".join(cells))
    return lines


def _cell(rows: Rows) -> str:
    return f"{share(map(is_right, rows)):<18} wrong names {mean(map(wrong_names, rows)):.2f}"


def report(rows: Rows, before: Rows = ()) -> list[str]:
    """All tables of one family."""
    level = rows[0]["level"]
    counted, earlier = judged(rows), judged(list(before))
    lines = [summary(level, rows)] + ([f"  before: {summary(level, list(before))}"] if before else [])
    lines += ["  by noise", *table(counted, lambda row: row["noise"], earlier)]
    if level != "none":
        lines += ["  by fault", *table(counted, lambda row: row["faults"][0], earlier)]
    if level == "multi":
        lines += ["  by number", *table(counted, lambda row: str(len(row["faults"])), earlier)]
    for title, key in (("by protocol", "protocol"), ("by path", "path"), ("by repeats", "repeats")):
        lines += [f"  {title}", *table(counted, lambda row, key=key: str(row.get(key)), earlier)]
    lines += ["  by rows", *table(counted, _length, earlier)]
    return [*lines, *trust(rows), *failures(counted)]


def _length(row: Row) -> str:
    edges = (24, 50, 100, 200, 400, 800, 10**6)
    low = max(edge for edge in edges if edge <= max(row["rows"], 24))
    return f"from {low:>4}"


def trust(rows: Rows) -> list[str]:
    """Whether what is printed can be believed: probabilities, deviations, held-out errors."""
    said = [statement for row in rows for statement in row.get("statements", [])]
    sure = [hit for chance, hit in said if chance >= SURE]
    pulls = np.array([value for row in rows for _, value in row.get("pulls", [])])
    rosy = [row["tool"]["rosy"] for row in rows if (row.get("tool") or {}).get("rosy")]
    lines = [f"  statements of {SURE:.0%} and more: right {share(sure)}"] if said else []
    if len(pulls):
        far = [f"{name} {value:.1f}" for row in rows for name, value in row.get("pulls", []) if abs(value) > 5.0]
        lines.append(f"  {len(pulls)} pulls: within 2 sigma {np.mean(np.abs(pulls) <= 2.0):.1%}; beyond 5: {far}")
    if rosy:
        worst = f"median {np.median(rosy):.2f}, worst {max(rosy):.2f}"
        lines.append(
            f"  re-measured / printed held-out and doubt: {worst}; above {ROSY}: {sum(one > ROSY for one in rosy)}"
        )
    after = [row["tool"]["after"] for row in rows if row.get("tool") and row["tool"]["after"] is not None]
    if after:
        quarter = np.percentile(after, [50, 90, 100])
        words = ", ".join(f"{value:.2f}" for value in quarter)
        lines.append(f"  tool error after compensation / noise: median, 90 % and worst {words}")
    return lines


def failures(rows: Rows) -> list[str]:
    """Every case that is not right, in one line."""
    lines = ["  not right:"]
    for row in rows:
        if is_right(row) and not (row.get("tool") or {}).get("worse"):
            continue
        hidden = ", ".join(f"{name} {size:.1f}x" for name, size in row["hidden"].items())
        place = f"    seed {row['seed']} {row['protocol']} {row['path']} {row['rows']} rows {row['noise']}: {hidden}"
        if "error" in row:
            lines.append(f"{place} {'REFUSED' if row.get('refused') else 'BROKEN'} {row['error']}")
            continue
        named = "; ".join(" = ".join(group) for group in row["named"]) or "nothing"
        worse = " WORSE" if (row.get("tool") or {}).get("worse") else ""
        lines.append(f"{place} -> {row['verdict']}, {row['outcome']}: {named}{worse}; depends {row['depends'][:1]}")
    return lines


def load(folder: Path) -> dict[str, Rows]:
    """Families of a folder."""
    places = {level: folder / f"{level}.json" for level in LEVELS}
    return {level: json.loads(place.read_text()) for level, place in places.items() if place.exists()}


def main() -> None:
    """Command line."""
    folder = Path(sys.argv[1])
    families = load(folder)
    before = load(Path(sys.argv[2])) if len(sys.argv) > 2 else {}
    for level, rows in families.items():
        print("\n".join(report(rows, before.get(level, []))))
    said = [tuple(one) for rows in families.values() for row in rows for one in row.get("statements", [])]
    if said:
        draw_reliability(said, folder / "reliability.png")
    if single := [row for row in families.get("single", []) if "error" not in row]:
        draw_detection(single, folder / "detection.png")
        draw_confusion(single, folder / "confusion.png")


if __name__ == "__main__":
    main()
