"""The folder that train.py writes: model.toml, rbf.safetensors, compensator.json. Never pickle."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nets import GaussianRbf, NetsError, load_rbf, save_rbf
from ptt import __version__
from ptt.effects import Library
from ptt.errors import InputError
from ptt.files import sha256, write_text
from ptt.machine import load_machine, save_machine
from ptt.model import Model, read_model, write_model
from ptt.training.rest import Space
from ptt.training.train import Training

MODEL, NETWORK, NOTES = "model.toml", "rbf.safetensors", "compensator.json"


@dataclass(frozen=True)
class Compensator:
    """A model, and what a network adds to it.

    Attributes:
        model: the physics.
        network: the network; None for a bare model.
        notes: held-out errors, versions, training domain.
    """

    model: Model
    network: GaussianRbf | None
    notes: dict[str, Any]

    @property
    def space(self) -> Space:
        """What the network's inputs are."""
        return "joints" if self.notes.get("rbf", {}).get("inputs") == "joints" else "tool"


def save_compensator(folder: str | Path, training: Training, inputs: list[str]) -> Path:
    """Write a compensator folder.

    Args:
        folder: made where it does not exist.
        training: what was trained.
        inputs: run files it was trained on.

    Returns:
        The folder.
    """
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    save_machine(write_model(training.physics.model), place / MODEL)
    digest = save_rbf(training.rbf.network, place / NETWORK)
    domain = training.rbf.network.domain
    network = training.rbf.network
    offset, scale = network.input_mean.numpy(), network.input_scale.numpy()
    notes = {
        "format": 1,
        "ptt": __version__,
        "sha256": {MODEL: sha256(place / MODEL), NETWORK: digest},
        "trained_on": [{"file": Path(name).name, "sha256": sha256(name)} for name in inputs],
        "domain_mm" if training.space == "tool" else "domain_rad": {
            "low": (domain.low * scale + offset).tolist(),
            "high": (domain.high * scale + offset).tolist(),
            "rule": "inside the box and near a training point; rows outside get the physics alone",
        },
        "rms_um": training.rms_um,
        "heldout_rms_um": training.heldout_um,
        "protocol": training.protocol,
        "rbf": {
            "centres": training.rbf.chosen.centres,
            "spread": training.rbf.chosen.spread,
            "learned": [bool(flag) for flag in training.rbf.learned],
            "share": training.rbf_share,
            "inputs": training.space,
            "heldout_by_inputs_um": training.spaces_um,
        },
        "noise_um": training.physics.noise.to_dict(),
    }
    write_text(place / NOTES, json.dumps(notes, indent=2) + "\n")
    return place


def load_compensator(path: str | Path, known: Library | None = None) -> Compensator:
    """Read a machine.toml or a compensator folder.

    Args:
        path: file or folder.
        known: effects by name; None for the library.

    Returns:
        The compensator, without a network where a file was named.

    Raises:
        InputError: missing or damaged.
    """
    place = Path(path)
    if not place.is_dir():
        return Compensator(read_model(load_machine(place), known), None, {})
    model = read_model(load_machine(place / MODEL), known)
    try:
        notes = json.loads((place / NOTES).read_text(encoding="utf-8"))
        digest = notes["sha256"][NETWORK]
        network = load_rbf(place / NETWORK, digest)
    except (OSError, ValueError, KeyError, NetsError) as error:
        raise InputError(f"not a whole compensator: {error}", where=str(place), fix="train it again") from error
    return Compensator(model, network, notes)
