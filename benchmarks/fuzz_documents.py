"""Damage to machine files, notes, tensors and programs."""

import json
import random
import re
import struct
from pathlib import Path

from fuzz_mutation import Mutation
from fuzz_tables import BAD_NUMBERS, ODD_NUMBERS

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


def damage_toml_value(path: Path, rng: random.Random) -> Mutation:
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


def damage_toml_lines(path: Path, rng: random.Random) -> Mutation:
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


def damage_json(path: Path, rng: random.Random) -> Mutation:
    value, words = _changed(json.loads(path.read_text()), rng)
    path.write_text(json.dumps(value))
    return Mutation(f"{path.name} {words}")


GCODE_WORDS = (
    "Xnan", "X", "X1e400", "X" + "9" * 400, "X--3", "G", "G999", "G1.5", "G2 X1 Y1 R0", "G2 X1 Y1 I1e308", "F0", "F-5",
    "Fnan", "G20", "G91 X9999", "G17 G18 G19", "#1=3", "[1+1]", "X[1/0]", "(", ")", "((", "/X3", "%", "O100 sub",
    "M98 P100", "G41 D1", "G43 H1", "G33 X1 K1", "G81 R1 Z-3", "G38.2 Z-1", "G92 X0", "G10 L2 P1 X0", "A3", "X1 X2",
    "G0 G1 X3", "G2 I1 J0 K0 P1e9", "G3 I1e-9 J0", "G2 X30 Y0 R1e12", "N1e9", "X" + "1" * 300, "\u202eX3", "; x\x00",
    "G5 I0 J3 P0 Q-3 X1 Y1", "G93 F1", "G95 F1", "G64 P0.01", "G53 X0", "G28", "T1 M6", "G4 P1e308", "g1x3y", "U3",
)  # fmt: skip


def damage_program(path: Path, rng: random.Random) -> Mutation:
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


def damage_tensors(path: Path, rng: random.Random) -> str:
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
