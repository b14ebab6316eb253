"""The folder that train.py writes: model.toml, rbf.safetensors, compensator.json. Never pickle."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from nets import GaussianRbf, NetsError, load_rbf, save_rbf
from ptt.correct.doubt import NetworkError
from ptt.correct.training.machine_of import MODEL, NOTES, read_notes, require_own_model
from ptt.correct.training.rest import Space, correction_of
from ptt.correct.training.train import Training
from ptt.documents import format_json
from ptt.effects import Library
from ptt.effects.dated import unplaced
from ptt.errors import InputError
from ptt.files import sha256, write_text
from ptt.fitting.kept import keep_covariance
from ptt.folders import recover_folder, require_own, write_folder
from ptt.machine import format_machine, load_machine, parse_machine, save_machine
from ptt.machine_schema import TargetsSpec
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model
from ptt.version import __version__

NETWORK = "rbf.safetensors"
OWN = frozenset({MODEL, NETWORK, f"{NETWORK}.sha256", NOTES})  # older folders have a file with its digest too
OfTargets = Callable[[np.ndarray, np.ndarray], np.ndarray]  # of wanted positions, (n, 3) mm, and joint values, (n, k)
TRIES = 3  # attempts at reading a folder, which another process may replace meanwhile


@dataclass(frozen=True)
class Compensator:
    """A model and the network that corrects its residual.

    Attributes:
        model: the physics.
        network: the network; None for a bare model.
        notes: held-out errors, versions, training domain.
    """

    model: Model
    network: GaussianRbf | None
    notes: dict[str, Any]

    @property
    def error(self) -> NetworkError | None:
        """Held-out error with and without the network; None without a network, or if it learned no axis."""
        held = self.notes.get("heldout_rms_um", {})
        learned = any(self.notes.get("rbf", {}).get("learned", ()))
        if self.network is None or not learned or not {"physics", "rbf"} <= set(held):
            return None
        return NetworkError(1e-3 * float(held["rbf"]["total"]), 1e-3 * float(held["physics"]["total"]))

    @property
    def space(self) -> Space:
        """The network's inputs: tool positions or joint commands."""
        return "joints" if self.notes.get("rbf", {}).get("inputs") == "joints" else "tool"

    def network_parts(self) -> tuple[OfTargets | None, OfTargets | None]:
        """Correction and domain of the network, arguments of `ptt.correct.compensate.compensate`.

        Returns:
            Wanted position, nominal joint values -> position to ask the model for; the same -> whether it is in the
            training domain. None without a network.
        """
        network, space = self.network, self.space
        if network is None:
            return None, None
        return correction_of(network, space), lambda wanted, q: network.inside(wanted if space == "tool" else q)

    def in_base(self) -> "Compensator":
        """A compensator for targets in the base frame, whatever frame the targets of its runs were stated in."""
        file = replace(self.model.file, targets=TargetsSpec(frame="base"))
        return replace(self, model=replace(self.model, file=file))


def save_compensator(folder: str | Path, training: Training, inputs: list[str]) -> Path:
    """Write a compensator folder, whole or not at all: physics and network of one training, never of two.

    Args:
        folder: made where it does not exist; a compensator that is there is replaced.
        training: what was trained.
        inputs: run files it was trained on.

    Returns:
        The folder.

    Raises:
        InputError: the folder holds other files too, or cannot be written.
    """
    write_compensator(folder, compensator_of(training, inputs))
    return Path(folder)


def write_compensator(folder: str | Path, compensator: Compensator) -> None:
    """Write a compensator that was read or trained before, whole or not at all.

    Args:
        folder: made where it does not exist; a compensator that is there is replaced.
        compensator: with a network.

    Raises:
        InputError: there is no network, the folder holds other files too, or it cannot be written.
    """
    if compensator.network is None:
        raise InputError("no network to write", where=str(folder), fix="train one, or write the physics as a file")
    with write_folder(folder, OWN) as place:
        save_machine(write_model(compensator.model), place / MODEL)
        digests = {MODEL: sha256(place / MODEL), NETWORK: save_rbf(compensator.network, place / NETWORK, beside=False)}
        write_text(place / NOTES, format_json(compensator.notes | {"sha256": digests}))


def require_folder(folder: str | Path) -> None:
    """Refuse a folder that a compensator cannot be written to, before anything is trained.

    Args:
        folder: it need not be there.

    Raises:
        InputError: it is a file, or holds other files, which would be lost.
    """
    require_own(folder, OWN)


def compensator_of(training: Training, inputs: Sequence[str]) -> Compensator:
    """The compensator of a training, as it would be read from the folder it is written to.

    Args:
        training: what was trained.
        inputs: run files it was trained on.
    """
    fitted = training.physics.fitted
    covariance = None if fitted is None else keep_covariance(fitted, 1e-3 * training.heldout_um["physics"]["total"])
    written = write_model(training.physics.model, [sha256(name) for name in inputs])
    terms = (*training.physics.model.terms, *training.physics.model.aside)
    known = {term.effect.name: unplaced(term.effect) for term in terms}
    file = parse_machine(format_machine(replace(written, covariance=covariance)), written.source)
    model = read_model(file, known, checked=True)
    return Compensator(model, training.rbf.network, _notes(training, inputs))


def _notes(training: Training, inputs: Sequence[str]) -> dict[str, Any]:
    domain = training.rbf.network.domain
    network = training.rbf.network
    offset, scale = network.input_mean.numpy(), network.input_scale.numpy()
    return {
        "format": 1,
        "ptt": __version__,
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
    if not place.exists():
        recover_folder(place)
    if not place.is_dir():
        return Compensator(read_model(load_machine(place), known), None, {})
    for _ in range(TRIES - 1):
        with suppress(InputError):
            return _load(place, known)
    return _load(place, known)


def _load(place: Path, known: Library | None) -> Compensator:
    """Read a folder whose three files are of one training."""
    try:
        notes = read_notes(place)
        network = load_rbf(place / NETWORK, notes["sha256"][NETWORK])
        model = read_model(load_machine(place / MODEL), known)
        require_own_model(place, notes)
    except (OSError, ValueError, KeyError, TypeError, NetsError) as error:
        raise InputError(f"not a whole compensator: {error}", where=str(place), fix="train it again") from error
    return Compensator(model, network, notes)
