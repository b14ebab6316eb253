"""What the fuzzer does to a file or a folder of sound inputs, drawn by chance."""

import hashlib
import json
import random
from collections.abc import Callable
from pathlib import Path

from fuzz_documents import damage_json, damage_program, damage_tensors, damage_toml_lines, damage_toml_value
from fuzz_mutation import Mutation
from fuzz_odd import odd_file
from fuzz_own import damage_code
from fuzz_tables import damage_cells, damage_rows, damage_titles, write_otherwise

ODD_SHARE = 0.3  # of all damage to files


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
        ".csv": (damage_cells,) * 8
        + (damage_rows,) * 5
        + (damage_titles,) * 4
        + (write_otherwise,) * 3
        + (_bytes,) * 3,
        ".toml": (damage_toml_value,) * 8 + (damage_toml_lines,) * 4 + (_bytes,) * 2,
        ".py": (damage_code,),
        ".json": (damage_json, damage_json, _bytes),
        ".ngc": (damage_program,) * 5 + (_bytes,),
    }
    return rng.choice(kinds[path.suffix])(path, rng)


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


def _folder(path: Path, rng: random.Random) -> Mutation:
    names = ("model.toml", "rbf.safetensors", "compensator.json")
    kind = rng.choice(("json", "json", "json", "toml", "toml", "tensors", "tensors", "gone", "raw", "deep", "folder"))
    name = rng.choice(names)
    if kind == "json":
        done = damage_json(path / names[2], rng)
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
        done = rng.choice((damage_toml_value, damage_toml_lines))(path / names[0], rng)
        _rehash(path)
        return Mutation(f"{path.name}/{done.words}")
    words = damage_tensors(path / names[1], rng)
    _rehash(path)
    return Mutation(f"{path.name}/{names[1]} {words}")


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


def _rehash(place: Path) -> None:
    """Digests that fit what was damaged, so that more than digests has to find it."""
    notes = json.loads((place / "compensator.json").read_text())
    for name in notes["sha256"]:
        notes["sha256"][name] = hashlib.sha256((place / name).read_bytes()).hexdigest()
    (place / "compensator.json").write_text(json.dumps(notes))
