"""Damage to tables of numbers: cells, rows, columns, titles, and tables that are written otherwise."""

import random
import re
from pathlib import Path

from fuzz_mutation import Mutation

BAD_NUMBERS = (
    "abc", "nan", "NaN", "inf", "-inf", "1e400", "1e150", "1e308", "-1e200", "--", "0x10", "1_000", "1e5e5", "True",
    "+-3", "1.2.3", "null", "#N/A", "=1+1", "9" * 400, "1 2", "1e", "e5", ".", "-", "1/2", "x" * 5000, "NULL", "N/A",
)  # fmt: skip
ODD_NUMBERS = ("0", "-0", "1E2", "1e-300", "5e-324", "-7", "1e5", "+4.5", "", "1e9", "000012", "1.50000000000000000001")


def _read(path: Path) -> list[list[str]]:
    return [line.split(",") for line in path.read_text().splitlines()]


def _write(path: Path, rows: list[list[str]], end: str = "\n") -> None:
    path.write_text("".join(",".join(row) + end for row in rows), newline="")


def _is_number(cell: str) -> bool:
    return re.fullmatch(r"-?\d+(\.\d+)?(e-?\d+)?", cell) is not None


# Columns of numbers that every reader of the file looks at.
READ = re.compile(r"[xyz]_(cmd|meas)|scale_mm|command_turns|target_mm|measured_mm")


def damage_cells(path: Path, rng: random.Random) -> Mutation:
    rows = _read(path)
    row = rng.randrange(1, len(rows))
    column = rng.randrange(len(rows[0]))
    title, number = rows[0][column], _is_number(rows[row][column])
    if rng.random() < 0.6:
        value = rng.choice(BAD_NUMBERS)
        rows[row][column] = value
        verdict = "refuse" if number and READ.fullmatch(title) else ""
    else:
        value, verdict = rng.choice(ODD_NUMBERS), ""
        rows[row][column] = value
    _write(path, rows)
    return Mutation(f"{path.name} row {row + 1} column {title} = {value[:20]!r}", verdict)


def damage_rows(path: Path, rng: random.Random) -> Mutation:
    rows = _read(path)
    head, body = rows[0], rows[1:]
    row = rng.randrange(len(body))
    kind = rng.choice(
        ("short", "long", "cut", "shuffle", "reverse", "copies", "one", "none", "constant", "wide", "swallow", "swap",
         "scale", "double", "gap", "deep", "number", "huge column")
    )  # fmt: skip
    verdict = ""
    if kind == "short":
        gone = rng.randrange(1, len(head))
        body[row], verdict = body[row][:gone], "refuse"
    elif kind == "long":
        body[row], verdict = [*body[row], "1.0"], "refuse"
    elif kind == "cut":
        text = path.read_text()
        path.write_text(text[: rng.randrange(1, len(text))])
        return Mutation(f"{path.name} cut")
    elif kind == "shuffle":
        rng.shuffle(body)
    elif kind == "reverse":
        body.reverse()
    elif kind == "copies":
        body = [body[row]] * len(body)
    elif kind == "one":
        body = [body[row]]
    elif kind == "none":
        body, verdict = [], "refuse"
    elif kind == "wide":
        body[row][rng.randrange(len(head))] = "y" * rng.choice((30_000, 300_000))
    elif kind == "swallow":
        place = rng.randrange(len(head))
        body[row][place] = '"' + body[row][place]
    elif kind == "gap":
        for each in body:
            each[len(head) // 2] = ""
    elif kind == "double":
        body = [line for line in body for _ in range(2)]
    elif kind == "number":
        body = [[str(index)] * len(head) for index in range(len(body))]
    else:
        _columns(kind, head, body, rng)
    _write(path, [head, *body])
    return Mutation(f"{path.name} rows {kind}", verdict)


def _columns(kind: str, head: list[str], body: list[list[str]], rng: random.Random) -> None:
    """Change whole columns of numbers: constant, interchanged, times a power of ten, beyond any machine."""
    numeric = [i for i in range(len(head)) if all(_is_number(line[i]) for line in body)]
    first, second = rng.choice(numeric), rng.choice(numeric)
    factor = 1e200 if kind == "huge column" else 10.0 ** rng.randrange(-9, 10)
    constant = body[0][first]
    for line in body:
        if kind == "constant":
            line[first] = constant
        elif kind == "swap":
            line[first], line[second] = line[second], line[first]
        else:
            line[first] = repr(float(line[first]) * factor)


def damage_titles(path: Path, rng: random.Random) -> Mutation:
    rows = _read(path)
    head = rows[0]
    column = rng.randrange(len(head))
    kind = rng.choice(("double", "drop", "rename", "empty", "long", "unit", "gone", "quote", "odd", "foreign"))
    verdict = ""
    if kind == "double":
        other = rng.randrange(len(head))
        verdict = "refuse" if other != column and READ.fullmatch(head[other]) else ""
        head[column] = head[other]
    elif kind == "drop":
        rows = [row[:column] + row[column + 1 :] for row in rows]
    elif kind == "gone":
        rows = rows[1:]
    else:
        words = {
            "rename": rng.choice(("foo", "X", "q1_cmd", "b9_cmd", "time", "q1_cmd_deg", "x", "dir1", "tau2", "role")),
            "empty": "", "long": "x " * 15_000, "quote": '"' + head[column], "odd": "\u202e\x01\u0301" + head[column],
            "unit": head[column] + rng.choice(("_um", " [furlong]", "_m", " (deg)", "_k", "/mm")),
            "foreign": rng.choice(("目标X", "X实测[微米]", "Messwert X", "temps", "[[[[", "_" * 9000)),
        }  # fmt: skip
        head[column] = words[kind]
    _write(path, rows)
    return Mutation(f"{path.name} title {kind} at {column + 1}", verdict)


def write_otherwise(path: Path, rng: random.Random) -> Mutation:
    rows, text = _read(path), path.read_text()
    kinds = ["permute", "crlf", "blank", "quotes", "spaces"]
    if path.stem not in ("scale", "axis"):
        kinds += ["bom", "semicolon", "tab", "comment", "utf16", "cr"]
    kind = rng.choice(kinds)
    if kind == "permute":
        order = list(range(len(rows[0])))
        rng.shuffle(order)
        _write(path, [[row[i] for i in order] for row in rows])
    elif kind == "quotes":
        column = rng.randrange(len(rows[0]))
        _write(path, [[f'"{c}"' if i == column else c for i, c in enumerate(row)] for row in rows])
    elif kind == "spaces":
        _write(path, [[f" {cell} " for cell in row] for row in rows])
    else:
        marks = {"semicolon": ";", "tab": "\t"}
        done = {
            "crlf": text.replace("\n", "\r\n"), "cr": text.replace("\n", "\r"), "blank": text + "\n\n",
            "comment": "# a comment\n" + text, "bom": text, "utf16": text, **{k: text.replace(",", m) for k,
            m in marks.items()},
        }[kind]  # fmt: skip
        codec = {"bom": "utf-8-sig", "utf16": "utf-16"}.get(kind, "utf-8")
        path.write_bytes(done.encode(codec))
    return Mutation(f"{path.name} written otherwise: {kind}", "same")
