"""What else people hand in: files of other kinds, packed, in other encodings and digits, out of spreadsheets."""

import gzip
import io
import json
import os
import random
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

ENCODINGS = (
    "utf-16-le", "utf-16-be", "utf-32", "utf-7", "cp037", "shift_jis", "gb18030", "big5", "koi8-r", "cp1252",
    "utf-8-sig",
)  # fmt: skip
DIGITS = (
    "１２．５", "１２", "٣٤", "१२", "²", "½", "\u221212.5", "12\u00a0000", "1’000.5", "1 234.5", "Ⅻ", "1\u200b2",
    "1\u20602", "\ufeff12", "12\u0301", "1\u00b710\u00b2", "12.5\x00", "\x0012.5", "12\x0b", "12\u2028", "12\x85",
    "12,5", '"12', '12"', "'12.5", "=12", "12e", "12.5.", "1e+0005", "0b101", "0o17", "1j", "12mm", "12 um", "12°",
    "1d3", "1.e3", ".5", "5.", "-.5e-3", "+12.5", "--12", "(12.5)", "$12", "12%", "NaN(ind)", "1.#QNAN", "-1.#IND",
    "1.#INF", "#VALUE!", "#DIV/0!", "#REF!", "<12", ">12", "~12", "12±1", "TRUE", "false", "2026-01-02", "12:30",
    "9223372036854775808", "-9223372036854775809", "18446744073709551616", "340282366920938463463374607431768211456",
    "1" + "0" * 308, "0." + "0" * 400 + "1", "-0.0", "1e-400",
)  # fmt: skip
FOREIGN_JSON = (
    {"type": "FeatureCollection", "features": [{"geometry": {"coordinates": [1, 2]}}]},
    {"name": "app", "version": "1.0.0", "dependencies": {"left-pad": "*"}}, [1, 2, 3], "text", 7, None, True, [[]],
    [{}], {"depends_on": {}}, {"depends_on": [[]]}, {"depends_on": [None]}, {"depends_on": "b2"},
    {"depends_on": [{"on": []}]},
    {"depends_on": [{"residual": "slider 9", "on": "b99", "share": 7, "p_value": -1, "shape": "period",
    "period_mm": 0}]},
    {"": {"": {"": 0}}}, {"sha256": {}}, {"format": 10**30}, {"rows": -1, "domain": {"points": []}},
)  # fmt: skip
TOML = (
    "machine.kind = 3", "[machine.kind]", "[[machine]]", "[effect]", "effect = []", "effect = 3", "machine = {}",
    "[tracker.frame]", "tracker.sigma_mm = 1.0", "[[tracker.base_point]]",
    '[[tracker.base_point]]\nname = "a"\nxyz_mm = [1, 2]\nsigma_mm = 0', '"machine" = 1', '"mach\\u0069ne".x = 1',
    "é = 1", '"" = 1', "a.b.c.d = {e.f = 1}", 'x = """\nmany\nlines\n"""', "x = 0xff", "y = 1_000",
    "[targets]\norigin_mm = [0, 0]", "[targets]\nturn_deg = [nan, 0, 0]", "[targets]\norigin_mm = [1e12, 0, 0]",
    "[covariance]", "[covariance]\nkeys = []", '[covariance]\nkeys = ["a"]\nvalues = [[1, 2], [3, 4]]',
    "[controller]", 'compensates = ["backlash", "backlash"]', "compensates = [3]", 'compensates = "backlash"',
    "[[history]]\nfiles = 3", "[[history]]\nfiles = [{}]", "[a]\nb = " + "[" + "1, " * 50_000 + "]", "\tkind = 1",
    "kind = 'a\\b'", "# \x00", "x = \x7f", "[machine]\rkind = 1", "x = [1, 'a', {b = 2}]", "x = 9999-99-99",
    "x = 12:00", "x = +inf", "x = 1e", "x =", "= 1", "[]", "[[]]", "[ machine ]", "machine",
    "slider_travel_mm = [[0, 1], [2, 3]]", "slider_travel_mm = [420.0, 150.0]", "screw_lead_mm = 1e-12",
    "screw_lead_mm = -5", "reflector_mm = [1, 2]", "reflector_mm = [1e11, 0, 0]", "platform_mass_kg = -1",
    "slider_lean_deg = [90, 90, 90]", "slider_lean_deg = [1e11, 0, 0]", 'sliders = "sideways"', 'moves = ""',
    "reference_temp_c = -1e11", "joint_height_mm = 1e11",
)  # fmt: skip
SIGNS = ("\x1f", "|", "  ", ",,", ":", "\u3000", "，")


def _more(row: int, count: int) -> str:
    """Further columns of a line."""
    return "".join(f",c{column}" if row == 0 else ",1" for column in range(count))


# Comment, blank and unit lines, second heads, means below: what spreadsheets and measuring programs add to a table.
AROUND: tuple[Callable[[list[str], random.Random], list[str]], ...] = (
    lambda lines, rng: [f"# {number}" for number in range(60)] + lines,
    lambda lines, rng: ["Report of 2026-01-02", "", "Operator;N. N.", *lines],
    lambda lines, rng: [lines[0], ",".join(["mm"] * (lines[0].count(",") + 1)), *lines[1:]],
    lambda lines, rng: [lines[0], lines[0], *lines[1:]],
    lambda lines, rng: [*lines[: len(lines) // 2], lines[0], *lines[len(lines) // 2 :]],
    lambda lines, rng: [*lines, ",".join(["Mean"] + ["0.0"] * lines[0].count(","))],
    lambda lines, rng: [*lines, "-- end --"],
    lambda lines, rng: [f"{line}," for line in lines],
    lambda lines, rng: [f",{line}" for line in lines],
    lambda lines, rng: [*lines[:3], "", "", *lines[3:]],
    lambda lines, rng: [*lines[:3], "," * lines[0].count(","), *lines[3:]],
    lambda lines, rng: [*lines, *["," * lines[0].count(",")] * 500],
    lambda lines, rng: [lines[0].upper(), *lines[1:]],
    lambda lines, rng: [lines[0].replace("_", " "), *lines[1:]],
    lambda lines, rng: ["sep=,", *lines],
    lambda lines, rng: [line.replace(",", rng.choice(SIGNS)) for line in lines],
    lambda lines, rng: [line.replace(".", ",") for line in lines],
    lambda lines, rng: [line + _more(row, 1900) for row, line in enumerate(lines)],
    lambda lines, rng: [line + _more(row, 9000) for row, line in enumerate(lines)],
    lambda lines, rng: [lines[0], *lines[1:] * 40],
    lambda lines, rng: [line + "\t" * 9 for line in lines],
    lambda lines, rng: [line.replace(",", " , ") for line in lines],
    lambda lines, rng: [f'"{line}"' for line in lines],
    lambda lines, rng: [line.replace(",", '","') for line in lines],
)  # fmt: skip


def odd_file(path: Path, rng: random.Random) -> tuple[str, str]:
    """Put something odd in the place of a file.

    Args:
        path: a sound input.
        rng: where chance comes from.

    Returns:
        What it is, and the verdict of a mutation.
    """
    kinds: list[Callable[[Path, random.Random], tuple[str, str]]] = [_packed, _encoded, _ends, _another, _nothing]
    if path.suffix == ".csv":
        kinds += [_digits] * 4 + [_around] * 4 + [_comma] * 2
    elif path.suffix == ".toml":
        kinds += [_toml] * 6 + [_dotted]
    elif path.suffix == ".json":
        kinds += [_json] * 4
    return rng.choice(kinds)(path, rng)


def _packed(path: Path, rng: random.Random) -> tuple[str, str]:
    """Packed, or a document of another program."""
    data = path.read_bytes()
    kind = rng.choice(("gzip", "zip", "bz2", "pdf", "png", "xml", "sqlite", "elf"))
    if kind == "gzip":
        data = gzip.compress(data)
    elif kind == "zip":
        whole = io.BytesIO()
        with zipfile.ZipFile(whole, "w") as archive:
            archive.writestr("xl/worksheets/sheet1.xml", data)
        data = whole.getvalue()
    else:
        heads = {"bz2": b"BZh9", "pdf": b"%PDF-1.7\n", "png": b"\x89PNG\r\n\x1a\n", "xml": b'<?xml version="1.0"?>\n',
                 "sqlite": b"SQLite format 3\0", "elf": b"\x7fELF\2\1\1" + bytes(9)}  # fmt: skip
        data = heads[kind] + data
    path.write_bytes(data)
    return kind, "refuse" if kind in ("gzip", "zip") else ""


def _encoded(path: Path, rng: random.Random) -> tuple[str, str]:
    codec = rng.choice(ENCODINGS)
    text = path.read_text()
    if rng.random() < 0.4:
        text = text.replace("bench", "Prüfstand 测试").replace("name", rng.choice(("name", "Größe", "名称")), 1)
    path.write_bytes(text.encode(codec, "replace"))
    return f"in {codec}", ""


def _ends(path: Path, rng: random.Random) -> tuple[str, str]:
    """Line ends of all kinds, a mark in the middle, blanks that are none."""
    text = path.read_text()
    end = rng.choice(
        (
            "\n\n",
            "\r\r\n",
            "\x0b",
            "\x0c",
            "\u2028",
            "\x85",
            "\r\n\r\n",
            "\n\ufeff",
            "\n\x00",
            "\n\u200b",
            "\n\u00a0",
            "\x1e",
        )
    )
    count = rng.choice((1, 3, -1))
    path.write_bytes(text.replace("\n", end, count).encode())
    return f"{count} line ends {end!r}", ""


def _another(path: Path, rng: random.Random) -> tuple[str, str]:
    """Another input of the same folder under this one's name."""
    other = rng.choice(sorted(each for each in path.parent.iterdir() if each.is_file() and each.suffix != path.suffix))
    path.write_bytes(other.read_bytes())
    return f"holds {other.name}", "refuse" if path.suffix in (".csv", ".toml") and other.suffix in (
        ".py",
        ".ngc",
    ) else ""


def _nothing(path: Path, rng: random.Random) -> tuple[str, str]:
    """No file: a folder, a pipe, a link that leads nowhere or to a folder, 3 GB of zeros, one that may not be read."""
    kind = rng.choice(("folder", "pipe", "gone", "link to folder", "forbidden", "hole", "itself"))
    data = path.read_bytes()
    path.unlink()
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "gone":
        path.symlink_to("nowhere")
    elif kind == "itself":
        path.symlink_to(path.name)
    elif kind == "link to folder":
        path.symlink_to(".")
    elif kind == "hole":
        with path.open("wb") as file:
            file.truncate(3 * 1024**3)
    else:
        path.write_bytes(data)
        path.chmod(0)
    written = kind == "gone" and path.name == "map.toml"  # answers that are not there yet are kept there
    return kind, "" if kind == "forbidden" or written else "refuse"  # who is root may read what is forbidden


def _digits(path: Path, rng: random.Random) -> tuple[str, str]:
    lines = path.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    at, value = rng.randrange(len(rows[0])), rng.choice(DIGITS)
    chosen = range(1, len(rows)) if rng.random() < 0.2 else [rng.randrange(1, len(rows))]
    for row in chosen:
        rows[row][at] = value
    path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    return f"column {rows[0][at]}, {len(chosen)} rows: {value[:20]!r}", ""


def _around(path: Path, rng: random.Random) -> tuple[str, str]:
    number = rng.randrange(len(AROUND))
    path.write_text("\n".join(AROUND[number](path.read_text().splitlines(), rng)) + "\n")
    return f"around, kind {number}", ""


def _comma(path: Path, rng: random.Random) -> tuple[str, str]:
    """As spreadsheets of half the world write it: decimal comma, semicolon between cells; that is the same table."""
    text = path.read_text().replace(",", ";")
    path.write_text(re.sub(r"(?<=\d)\.(?=\d)", ",", text))
    return "decimal commas", "" if path.stem in ("scale", "axis") else "same"


def _toml(path: Path, rng: random.Random) -> tuple[str, str]:
    lines, words = path.read_text().splitlines(), rng.choice(TOML)
    place = rng.choice((0, len(lines), rng.randrange(len(lines)), 1, 2))
    path.write_text("\n".join([*lines[:place], words, *lines[place:]]) + "\n")
    return f"line {place + 1}: {words[:40]!r}", ""


def _dotted(path: Path, rng: random.Random) -> tuple[str, str]:
    """The same document in dotted keys, where it has no lists of tables."""
    text = path.read_text()
    if "[[" in text:
        path.write_bytes(text.replace("\n", "\r\n").encode("utf-8-sig"))
        return "with a mark and CRLF", ""
    lines, section = [], ""
    for line in text.splitlines():
        head = re.fullmatch(r"\[([\w.]+)\]", line.strip())
        section = f"{head[1]}." if head else section
        lines.append("" if head else re.sub(r"^(\w+)(\s*=)", rf"{section}\1\2", line))
    path.write_text("\n".join(lines) + "\n")
    return "dotted keys", ""


def _json(path: Path, rng: random.Random) -> tuple[str, str]:
    value = rng.choice(FOREIGN_JSON)
    text = json.dumps(value)
    text = rng.choice(
        (text, text, f"{text}\n{text}", text.replace('"', "'"), f"// a note\n{text}", text[:-1], f"[{text},]")
    )
    path.write_text(text)
    return f"JSON {text[:40]!r}", ""
