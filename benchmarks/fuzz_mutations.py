"""What the fuzzer does to sound inputs: each mutation says what it did, and whether the result must be refused.

`verdict` of a mutation: 'refuse' where the file format forbids what was written, 'same' where nothing that matters was
changed, '' where both are sensible.
"""

import hashlib
import json
import random
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fuzz_odd import odd_file

BAD_NUMBERS = (
    "abc", "nan", "NaN", "inf", "-inf", "1e400", "1e150", "1e308", "-1e200", "--", "0x10", "1_000", "1e5e5", "True",
    "+-3", "1.2.3", "null", "#N/A", "=1+1", "9" * 400, "1 2", "1e", "e5", ".", "-", "1/2", "x" * 5000, "NULL", "N/A",
)  # fmt: skip
ODD_NUMBERS = ("0", "-0", "1E2", "1e-300", "5e-324", "-7", "1e5", "+4.5", "", "1e9", "000012", "1.50000000000000000001")
TOML_VALUES = (
    "nan", "inf", "-inf", "-1.0", "0", "1e308", "1e-308", "1e150", "9" * 400, "true", '"text"', '""', "[]", "{}",
    "[1]", "[1, 2, 3, 4]", "[nan, 0, 0]", '["a", "b", "c"]', "[[1, 2], [3, 4]]", "2020-01-01", "07:32:00", "1e400",
    "-0.0", "0x7fffffffffffffffff", "[1e308, -1e308, 1e308]", "{ a = 1 }", "1979-05-27T07:32:00Z", "1e9", "1e-9",
    "[" * 3000 + "]" * 3000, '"' + "x" * 30000 + '"', "'" + "\\u0000" + "'", "[[], []]", "100000000000000000000",
)  # fmt: skip
JSON_VALUES = (
    None, True, False, 0, -1, 1e308, 10**400, "", "text", [], {}, [1], [None] * 3, {"a": 1}, float("nan"), "x" * 1000,
    [[1, 2], [3]], {"x": "y"}, {"total": None}, 1e150, [float("inf")] * 3, {"total": -5.0}, {"total": "7"},
)  # fmt: skip


ODD_SHARE = 0.3  # of all damage to files


@dataclass(frozen=True)
class Mutation:
    """What was done: words, and 'refuse', 'same' or ''."""

    words: str
    verdict: str = ""


def mutate_file(path: Path, rng: random.Random) -> Mutation:
    """Change one input in place.

    Args:
        path: a CSV, TOML, Python, JSON file or a compensator folder.
        rng: where chance comes from.

    Returns:
        What was done.
    """
    if path.is_dir():
        return _folder(path, rng) if (path / "compensator.json").exists() else _store(path, rng)
    if rng.random() < ODD_SHARE:
        words, verdict = odd_file(path, rng)
        return Mutation(f"{path.name} odd: {words}", verdict)
    kinds: dict[str, tuple[Callable[[Path, random.Random], Mutation], ...]] = {
        ".csv": (_cells,) * 8 + (_rows,) * 5 + (_titles,) * 4 + (_harmless,) * 3 + (_bytes,) * 3,
        ".toml": (_toml_value,) * 8 + (_toml_lines,) * 4 + (_bytes,) * 2,
        ".py": (_own,),
        ".json": (_json_text, _json_text, _bytes),
        ".ngc": (_gcode,) * 5 + (_bytes,),
    }
    return rng.choice(kinds[path.suffix])(path, rng)


def _read(path: Path) -> list[list[str]]:
    return [line.split(",") for line in path.read_text().splitlines()]


def _write(path: Path, rows: list[list[str]], end: str = "\n") -> None:
    path.write_text("".join(",".join(row) + end for row in rows), newline="")


def _is_number(cell: str) -> bool:
    return re.fullmatch(r"-?\d+(\.\d+)?(e-?\d+)?", cell) is not None


# Columns of numbers that every reader of the file looks at.
READ = re.compile(r"[xyz]_(cmd|meas)|scale_mm|command_turns|target_mm|measured_mm")


def _cells(path: Path, rng: random.Random) -> Mutation:
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


def _rows(path: Path, rng: random.Random) -> Mutation:
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


def _titles(path: Path, rng: random.Random) -> Mutation:
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


def _harmless(path: Path, rng: random.Random) -> Mutation:
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


def _bytes(path: Path, rng: random.Random) -> Mutation:
    data = bytearray(path.read_bytes())
    kind = rng.choice(("flip", "insert", "zeros", "latin", "drop", "binary", "empty"))
    for _ in range(rng.choice((1, 3, 20))):
        at = rng.randrange(len(data))
        if kind == "flip":
            data[at] ^= 1 << rng.randrange(8)
        elif kind == "insert":
            data[at:at] = rng.choice(
                (b'"', b"\n", b"\r", b",", b"\xff", b"\0", b"[", b"]", b"=", b"\xe2\x80\xa8", b"#")
            )
        elif kind == "drop":
            del data[at]
    if kind == "zeros":
        at = rng.randrange(len(data))
        data[at : at + 40] = bytes(40)
    elif kind == "latin":
        data += b"\n\xb0\xe4\xf6"
    elif kind == "binary":
        data = bytearray(rng.randbytes(rng.choice((10, 3000))))
    elif kind == "empty":
        data = bytearray(rng.choice((b"", b"\n", b"\xef\xbb\xbf", b" ", b"\0\0")))
    path.write_bytes(bytes(data))
    return Mutation(f"{path.name} bytes {kind}")


def _toml_value(path: Path, rng: random.Random) -> Mutation:
    lines = path.read_text().splitlines()
    places = [index for index, line in enumerate(lines) if re.match(r"\w+ = ", line)]
    at = rng.choice(places)
    key, old = lines[at].split(" = ", 1)
    value = rng.choice(TOML_VALUES)
    inner = re.search(r"(value|std) = (\[[^\]]*\])", old)
    if inner and rng.random() < 0.7:
        old_part = inner[2] if rng.random() < 0.5 else re.search(r"[-\d.]+", inner[2])[0]
        lines[at] = f"{key} = {old.replace(old_part, value, 1)}"
    else:
        lines[at] = f"{key} = {value}"
    path.write_text("\n".join(lines) + "\n")
    verdict = "refuse" if value[:9] in ("nan", "inf", "-inf", "9" * 9) and re.search(r"\d|\[", old) else ""
    if key in ("x", "y", "z", "total"):  # of a step's errors, where nothing could be held out
        verdict = ""
    return Mutation(f"{path.name} {key} = {value[:24]}", verdict)


def _toml_lines(path: Path, rng: random.Random) -> Mutation:
    lines = path.read_text().splitlines()
    at = rng.randrange(len(lines))
    kind = rng.choice(("drop", "twice", "unknown", "deep", "section", "swap", "effect", "history", "azimuth", "tables"))
    added = {
        "unknown": "colour = 3", "deep": "a." * 3000 + "b = 1", "section": rng.choice(("[machine]", "[x",
        "[[effect]]")),
        "history": rng.choice(("[[history]]\ndate = 5", "[[history]]\nrows = nan", "history = 3")),
        "effect": '[[effect]]\nname = ' + rng.choice(('"backlash"', '"nothing"', "3", '""', '"once-per-rev"\nlabel = 3',
                  '"windup"\n[effect.parameters]\nheight_mm = { value = [1, 2] }',
                  '"setup-jump"\nruns = ["a"]\n[effect.parameters]\nshift_mm = { value = 1e308 }')),
        "azimuth": "slider_azimuth_deg = " + rng.choice(("[0.0, 120.0, 0.0]", "[0.0, 120.0, 120.0]", "[0, 0, 0]",
                   "[0.0, 120.0, 120.0000001]", "[0.0, 120.0, 1e12]")),
        "tables": "[a]\n" + "\n".join(f"[a.{'b.' * depth}c]" for depth in range(0, 900, 30)),
    }  # fmt: skip
    if kind == "drop":
        del lines[at]
    elif kind == "twice":
        lines.insert(at, lines[at])
    elif kind == "swap":
        other = rng.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == "azimuth":
        lines.insert(3, added[kind])
    elif kind in ("effect", "history", "tables"):
        lines.append(added[kind])
    else:
        lines.insert(at, added[kind])
    path.write_text("\n".join(lines) + "\n")
    return Mutation(f"{path.name} lines {kind}")


def _places(value: object, path: tuple = ()) -> list[tuple]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(found for key, item in items for found in _places(item, (*path, key)))]


def _changed(value: object, rng: random.Random) -> tuple[object, str]:
    """A JSON value with one item of it, however deep, replaced or gone."""
    at = rng.choice(_places(value)[1:])
    holder = value
    for key in at[:-1]:
        holder = holder[key]
    new = rng.choice((*JSON_VALUES, "gone"))
    if new == "gone":
        del holder[at[-1]]
    else:
        holder[at[-1]] = new
    return value, f"{'.'.join(map(str, at))} = {str(new)[:20]}"


def _json_text(path: Path, rng: random.Random) -> Mutation:
    value, words = _changed(json.loads(path.read_text()), rng)
    path.write_text(json.dumps(value))
    return Mutation(f"{path.name} {words}")


def _folder(path: Path, rng: random.Random) -> Mutation:
    names = ("model.toml", "rbf.safetensors", "compensator.json")
    kind = rng.choice(("json", "json", "json", "toml", "toml", "tensors", "tensors", "gone", "raw", "deep", "folder"))
    name = rng.choice(names)
    if kind == "json":
        done = _json_text(path / names[2], rng)
        return Mutation(f"{path.name}/{done.words}")
    if kind == "deep":
        (path / names[2]).write_text(rng.choice(('{"a":' * 9000, "[" * 9000 + "]" * 9000, "3", "null", '"a"', "[]")))
        return Mutation(f"{path.name}/{names[2]} deep", "refuse")
    if kind == "gone":
        (path / name).unlink()
        return Mutation(f"{path.name}/{name} gone", "refuse")
    if kind == "folder":
        (path / name).unlink()
        (path / name).mkdir()
        return Mutation(f"{path.name}/{name} is a folder", "refuse")
    if kind == "raw":
        (path / name).write_bytes(rng.randbytes(rng.choice((1, 8, 300))))
        return Mutation(f"{path.name}/{name} random bytes", "refuse")
    if kind == "toml":
        done = rng.choice((_toml_value, _toml_lines))(path / names[0], rng)
        _rehash(path)
        return Mutation(f"{path.name}/{done.words}")
    words = _tensors(path / names[1], rng)
    _rehash(path)
    return Mutation(f"{path.name}/{names[1]} {words}")


GCODE_WORDS = (
    "Xnan", "X", "X1e400", "X" + "9" * 400, "X--3", "G", "G999", "G1.5", "G2 X1 Y1 R0", "G2 X1 Y1 I1e308", "F0", "F-5",
    "Fnan", "G20", "G91 X9999", "G17 G18 G19", "#1=3", "[1+1]", "X[1/0]", "(", ")", "((", "/X3", "%", "O100 sub",
    "M98 P100", "G41 D1", "G43 H1", "G33 X1 K1", "G81 R1 Z-3", "G38.2 Z-1", "G92 X0", "G10 L2 P1 X0", "A3", "X1 X2",
    "G0 G1 X3", "G2 I1 J0 K0 P1e9", "G3 I1e-9 J0", "G2 X30 Y0 R1e12", "N1e9", "X" + "1" * 300, "\u202eX3", "; x\x00",
    "G5 I0 J3 P0 Q-3 X1 Y1", "G93 F1", "G95 F1", "G64 P0.01", "G53 X0", "G28", "T1 M6", "G4 P1e308", "g1x3y", "U3",
)  # fmt: skip


def _gcode(path: Path, rng: random.Random) -> Mutation:
    """Damage a program word by word or line by line."""
    lines = path.read_text().splitlines()
    at = rng.randrange(len(lines))
    kind = rng.choice(("word", "word", "word", "line", "drop", "swap", "number", "number", "long", "many"))
    word = rng.choice(GCODE_WORDS)
    if kind == "word":
        lines[at] = f"{lines[at]} {word}"
    elif kind == "line":
        lines.insert(at, word)
    elif kind == "drop":
        del lines[at]
    elif kind == "swap":
        other = rng.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == "number":
        word = rng.choice(BAD_NUMBERS + ODD_NUMBERS)
        lines[at] = re.sub(r"-?\d+$", lambda _: word, lines[at])
    elif kind == "long":
        lines[at] += " X1" * 20_000
    else:
        lines += ["G91 G1 X0.001"] * 2000
    path.write_text("\n".join(lines) + "\n")
    return Mutation(f"{path.name} {kind} {word[:30]!r}")


def _store(path: Path, rng: random.Random) -> Mutation:
    """Damage a fleet's store: its database, a run that it keeps, readings of it."""
    file = rng.choice(sorted(each for each in path.rglob("*") if each.is_file()))
    kind = rng.choice(("gone", "cut", "flip", "bytes", "empty", "folder"))
    data = bytearray(file.read_bytes())
    file.unlink()
    if kind == "folder":
        file.mkdir()
    elif kind == "flip":
        for _ in range(rng.choice((1, 20, 500))):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    if kind in ("flip", "cut"):
        file.write_bytes(bytes(data[: rng.randrange(len(data)) if kind == "cut" else len(data)]))
    elif kind in ("bytes", "empty"):
        file.write_bytes(rng.randbytes(3000) if kind == "bytes" else b"")
    return Mutation(f"{path.name}/{file.name[:20]} {kind}")


def _tensors(path: Path, rng: random.Random) -> str:
    """Damage header or numbers of a safetensors file; the digest is made to fit after."""
    data = bytearray(path.read_bytes())
    size = struct.unpack("<Q", data[:8])[0]
    header, body = json.loads(data[8 : 8 + size]), bytes(data[8 + size :])
    kind = rng.choice(("header", "numbers", "nan", "length", "meta"))
    if kind == "header":
        header, words = _changed(header, rng)
    elif kind == "meta":
        inner, words = _changed(json.loads(header["__metadata__"].popitem()[1]), rng)
        header["__metadata__"] = {rng.choice(("rbf", "ptt", "nets")): json.dumps(inner)}
    else:
        words = ""
        at = rng.randrange(0, max(1, len(body) - 8), 8)
        value = {"nan": float("nan"), "numbers": rng.choice((1e308, -1e200, 1e30, 0.0, -5.0))}.get(kind, 0.0)
        body = (
            body[: -rng.randrange(1, 90)] if kind == "length" else body[:at] + struct.pack("<d", value) + body[at + 8 :]
        )
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + body)
    return f"{kind} {words}"


def _rehash(place: Path) -> None:
    """Digests that fit what was damaged, so that more than digests has to find it."""
    notes = json.loads((place / "compensator.json").read_text())
    for name in notes["sha256"]:
        notes["sha256"][name] = hashlib.sha256((place / name).read_bytes()).hexdigest()
    (place / "compensator.json").write_text(json.dumps(notes))


MORE: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("def basis(", (
        "_seen = []\n    def basis(", "__slots__ = ()\n    def basis(", "def __init__(self, x): pass\n    def basis(",
        "def __eq__(self, other): 1 / 0\n    def basis(", "def __repr__(self): 1 / 0\n    def basis(",
        "def __getattr__(self, name): 1 / 0\n    def basis(", "@staticmethod\n    def basis(",
        "@classmethod\n    def basis(", "@property\n    def basis(", "label = 3\n    def basis(",
        "def __hash__(self): return None\n    def basis(", "key = 'backlash'\n    def basis(",
        "def shift(self, theta, view): return theta\n    def basis(", "words = 3\n    def basis(",
        "def describe(self, *_): raise ValueError\n    def basis(", "reverses = True\n    def basis(",
    )),
    ("return height", (
        "view.q.add_(1.0); return height", "return torch.rand(3, 2, 1)", "yield height", "return height.tolist()",
        "return torch.empty(10**13)", "import sys; print('x', file=sys.stderr); return height",
        "return torch.full((len(height), 3, 2), 1e300, dtype=torch.float64); height",
        "return (x for x in height); height", "raise KeyboardInterrupt if False else OSError(28, 'full'); height",
        "raise MemoryError; height", "import logging; logging.warning('look'); return height",
        "view.q = None; return height", "return torch.nn.Parameter(height)[..., None] * 0; height",
        "torch.manual_seed(0); return torch.rand(1) * height", "return height.half()",
        "raise ValueError('x' * 9000 + chr(10) + chr(0x202e)); height", "raise Exception; height",
    )),
)  # fmt: skip
OWN_CHANGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ('name = "pull"', ('name = ""', "name = 3", 'name = "Pull Me"', "name = None", 'name = "backlash"',
    'name = "x" * 99999',
                       'name = ["pull"]', 'name = "pull\\n2"', "")),
    ('stage = "structure"', ('stage = "drive"', 'stage = "geometry"', "stage = 3",
    "stage = []", 'stage = "metrology"', "")),
    ('mechanisms = ("three-ptt",)', ("mechanisms = ()",
    "mechanisms = 3", 'mechanisms = "three-ptt"', "mechanisms = (3,)",
                                     "mechanisms = None", "")),
    ("count=2", ("count=0", "count=-1", "count=2.5", 'count="2"', "count=5", "count=10**9", "count=None",
    "per_joint=True")),
    ("1e-4", ("0.0", "-1.0", 'float("nan")', "1e308", "1e-320", '"a"', "None")),
    ('"pull", "1"', ('"", "1"', '3, "1"', '"pull", "furlong"', '"pull", 3', '"pu ll", "mm"', '"a.b", "mm"')),
    ("requires = ()", ('requires = ("moon",)', "requires = 3", 'requires = "time"', 'requires = ("time",)')),
    ("torch.eye(3, 2, dtype=torch.float64)", (
        "torch.eye(3, 2, dtype=torch.float32)", "torch.eye(2, 3)", "torch.eye(3, 3, dtype=torch.float64)",
        "torch.eye(3, 2, dtype=torch.complex128)", "torch.full((3, 2), float('nan'), dtype=torch.float64)",
        "torch.zeros(3, 2, dtype=torch.float64)", "'a'", "torch.eye(3, 2, dtype=torch.float64).numpy()",
        "1e300 * torch.eye(3, 2, dtype=torch.float64)", "torch.eye(3, 2, dtype=torch.float64).to(bool)")),
    ("return height", ("return None; height", "return 3.0; height", "return [1.0]; height", "raise ValueError('no')",
                       "import sys; sys.exit()", "import sys; sys.exit(0)", "raise KeyError(3)", "exit('x')",
                       "raise SystemExit", "return height[:5]", "print('hello'); return height", "1 / 0", "return view",
                       "import warnings; warnings.warn('look'); return height", "return height.sqrt().log()",
                       "raise StopIteration", "raise RecursionError('deep')", "return torch.empty(0)", "assert False")),
    ("import torch\n", ("import sys; sys.exit(0)\n", "import no_such\n", "raise SystemExit(3)\n",
    "print('x')\nimport torch\n",
                        "import torch\ntorch.set_default_dtype(torch.float32)\n", "(\n",
                        "import torch, numpy\nnumpy.sqrt(-1.0)\n", "import os\nos.chdir('/')\nimport torch\n")),
    ("def basis(self, view, shape)", ("def basis(self)", "def base(self, view, shape)",
    "def basis(self, view, shape, more)",
                                      "basis = 3\n    def other(self, view, shape)",
                                      "async def basis(self, view, shape)")),
    *MORE,
    ("class Pull(Effect):", ("class Pull:", "class Pull(Effect, int):", "@property\nclass Pull(Effect):",
                             "def pull(): pass\nclass Q(Effect): pass\nclass Pull(Effect):")),
)  # fmt: skip


def _own(path: Path, rng: random.Random) -> Mutation:
    old, news = rng.choice(OWN_CHANGES)
    new = rng.choice(news)
    path.write_text(path.read_text().replace(old, new, 1))
    return Mutation(f"{path.name} {old[:24]!r} -> {new[:40]!r}")
