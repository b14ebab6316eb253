"""Serialising a look as npz with JSON: plain arrays and texts, never pickles, so that reading a file runs no code."""

import io
import json
import zipfile
from dataclasses import fields
from typing import Any

import numpy as np

from ptt.show.card.scene import MachineLines
from ptt.show.studio.looks import Look

DRAWING = "drawing."


def pack_look(look: Look) -> bytes:
    """A look as the bytes of an npz file.

    Args:
        look: the look.

    Returns:
        The bytes.
    """
    arrays: dict[str, np.ndarray] = {}
    words: dict[str, Any] = {}
    for item in fields(look):
        value = getattr(look, item.name)
        if isinstance(value, np.ndarray):
            arrays[item.name] = value
        elif item.name in ("views", "contexts"):
            words[item.name] = list(value)
            arrays |= {f"{item.name}.{number}": array for number, array in enumerate(value.values())}
        elif isinstance(value, MachineLines):
            arrays |= {f"{DRAWING}{part.name}": getattr(value, part.name) for part in fields(value)}
        else:
            words[item.name] = value
    arrays["words"] = np.frombuffer(json.dumps(words).encode(), dtype=np.uint8)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def unpack_look(data: bytes) -> Look:
    """A look from the bytes of an npz file.

    Args:
        data: from `pack_look`.

    Returns:
        The look.

    Raises:
        ValueError: it is no npz file.
        KeyError: an array is missing.
    """
    if not zipfile.is_zipfile(io.BytesIO(data)):
        raise ValueError("not the arrays of a look")
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        words = json.loads(arrays["words"].tobytes())
        drawing = MachineLines(**{item.name: arrays[f"{DRAWING}{item.name}"] for item in fields(MachineLines)})
        found: dict[str, Any] = {"drawing": drawing}
        for item in fields(Look):
            if item.name in ("views", "contexts"):
                found[item.name] = {
                    name: arrays[f"{item.name}.{number}"] for number, name in enumerate(words[item.name])
                }
            elif item.name not in found:
                value = words[item.name] if item.name in words else arrays[item.name]
                found[item.name] = tuple(map(_as_was, value)) if isinstance(value, list) else value
    return Look(**found)


def _as_was(value: Any) -> Any:
    """Turn lists back into the tuples that JSON made lists of."""
    return tuple(value) if isinstance(value, list) else value
