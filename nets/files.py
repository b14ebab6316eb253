"""Saving a network with safetensors, whole or not at all, and loading it only if its digest is the expected one."""

import hashlib
import json
import os
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as parse_tensors
from safetensors.numpy import save as render_tensors

from nets.errors import DigestError, NetworkFileError
from nets.network import GaussianRbf
from nets.scaling import FloatArray

FORMAT = "gaussian-rbf"
VERSION = 1
METADATA_KEY = "rbf"  # the only key: the order of several is not the same in every run, and the bytes would differ

# Number of dimensions of each tensor in the file.
TENSORS = {
    "input_mean": 1,
    "input_scale": 1,
    "centres": 2,
    "widths": 1,
    "weights": 2,
    "threshold": 1,
    "slope": 2,
    "domain_points": 2,
    "domain_reach": 0,
    "domain_box": 2,
}


def save_rbf(
    network: GaussianRbf, path: str | os.PathLike[str], notes: Mapping[str, Any] | None = None, *, beside: bool = True
) -> str:
    """Write `path` and beside it `path`.sha256, in the format of the sha256sum tool.

    The same network and notes give the same bytes.

    Args:
        network: to save.
        path: usually named `rbf.safetensors`.
        notes: anything JSON can hold, kept in the metadata; read back with `read_notes`.
        beside: whether the digest gets a file of its own; without, whoever saves keeps what is returned.

    Returns:
        SHA-256 of the file, 64 hexadecimal digits.
    """
    path = Path(path)
    about = {"format": FORMAT, "version": VERSION, "notes": dict(notes or {})}
    state = network.state_dict()
    tensors = {name: np.array(state[name].numpy(), order="C") for name in TENSORS}
    content = render_tensors(tensors, metadata={METADATA_KEY: json.dumps(about, sort_keys=True, allow_nan=False)})
    digest = hashlib.sha256(content).hexdigest()
    _write_atomic(path, content)
    if beside:
        _write_atomic(digest_path(path), f"{digest}  {path.name}\n".encode())
    return digest


def load_rbf(path: str | os.PathLike[str], digest: str | None = None) -> GaussianRbf:
    """Read a network, after its SHA-256 has been checked.

    Args:
        path: written by `save_rbf`.
        digest: expected SHA-256; None takes it from `path`.sha256.

    Returns:
        The network; it predicts bit for bit what the saved one did.

    Raises:
        DigestError: another digest than expected, or none known.
        NetworkFileError: not a network file of this format.
        OSError: the file cannot be read.
    """
    path = Path(path)
    content = _verified_bytes(path, digest)
    try:
        tensors = parse_tensors(content)
    except SafetensorError as error:
        raise NetworkFileError(f"{path}: not a safetensors file ({error}); train the network again") from error
    about = _metadata(content, path)
    if about.get("format") != FORMAT or about.get("version") != VERSION:
        found = f"format {about.get('format')!r} version {about.get('version')!r}"
        raise NetworkFileError(f"{path}: {found}, expected {FORMAT!r} version {VERSION}; train the network again")
    _check_tensors(tensors, path)
    return GaussianRbf.from_tensors(tensors)


def read_notes(path: str | os.PathLike[str], digest: str | None = None) -> dict[str, Any]:
    """The notes that were saved with a network, after its SHA-256 has been checked.

    Args:
        path: written by `save_rbf`.
        digest: expected SHA-256; None takes it from `path`.sha256.

    Returns:
        The notes.

    Raises:
        DigestError: another digest than expected, or none known.
        NetworkFileError: no metadata of this format.
    """
    return dict(_metadata(_verified_bytes(Path(path), digest), Path(path)).get("notes", {}))


def digest_path(path: Path) -> Path:
    """The file beside a network that keeps its digest.

    Args:
        path: of the network.

    Returns:
        The path with `.sha256` appended.
    """
    return path.with_name(path.name + ".sha256")


def _verified_bytes(path: Path, digest: str | None) -> bytes:
    content = path.read_bytes()
    expected = digest if digest is not None else _kept_digest(path)
    found = hashlib.sha256(content).hexdigest()
    if found != expected.strip().lower():
        message = (
            f"{path}: SHA-256 is {found}, expected {expected}; the file was changed or damaged, restore or retrain"
        )
        raise DigestError(message)
    return content


def _kept_digest(path: Path) -> str:
    beside = digest_path(path)
    words = beside.read_text(encoding="utf-8").split() if beside.exists() else []
    if not words:
        raise DigestError(f"{path}: no SHA-256 is known; pass the digest or keep {beside.name} beside the file")
    return words[0]


def _metadata(content: bytes, path: Path) -> dict[str, Any]:
    # The reader from bytes gives no metadata: a file starts with the length of its JSON header, little endian.
    try:
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
        return dict(json.loads(header["__metadata__"][METADATA_KEY]))
    except (ValueError, KeyError, TypeError) as error:
        raise NetworkFileError(f"{path}: no {METADATA_KEY!r} metadata; not written by this program") from error


def _check_tensors(tensors: dict[str, FloatArray], path: Path) -> None:
    wrong = sorted(name for name, ndim in TENSORS.items() if name not in tensors or tensors[name].ndim != ndim)
    if wrong or len(tensors) != len(TENSORS):
        raise NetworkFileError(f"{path}: tensors {sorted(tensors)}, expected {sorted(TENSORS)}; train again")
    inputs, outputs = tensors["slope"].shape
    nodes = tensors["widths"].shape[0]
    expected = {
        "input_mean": (inputs,),
        "input_scale": (inputs,),
        "centres": (nodes, inputs),
        "weights": (nodes, outputs),
        "threshold": (outputs,),
        "domain_box": (2, inputs),
    }
    bad = sorted(name for name, shape in expected.items() if tensors[name].shape != shape)
    bad += sorted(name for name, each in tensors.items() if each.dtype != np.float64 or not np.isfinite(each).all())
    if bad:
        raise NetworkFileError(f"{path}: {', '.join(bad)}: not a finite float64 array of the right shape; train again")


def _write_atomic(path: Path, content: bytes) -> None:
    part = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
