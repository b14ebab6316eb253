"""The machine file of a model, given as machine file or compensator folder, without loading torch."""

from pathlib import Path
from typing import Any

from ptt.correct.training.notes import check_notes
from ptt.documents import parse_json
from ptt.errors import InputError
from ptt.files import read_text, sha256
from ptt.machine import MachineFile, load_machine

MODEL, NOTES = "model.toml", "compensator.json"


def machine_of(path: str | Path) -> MachineFile:
    """Read a machine.toml, or that of a compensator folder; loads no torch.

    Args:
        path: file or folder.

    Returns:
        The machine file.

    Raises:
        InputError: missing, damaged, or a folder that is no compensator.
    """
    place = Path(path)
    if not place.is_dir():
        return load_machine(place)
    require_own_model(place, read_notes(place))
    return load_machine(place / MODEL)


def read_notes(place: Path) -> dict[str, Any]:
    """The notes of a compensator folder.

    Args:
        place: the folder.

    Returns:
        What compensator.json holds.

    Raises:
        InputError: there is none, or it is damaged.
    """
    return check_notes(parse_json(read_text(place / NOTES), str(place / NOTES), fix="train it again"), str(place))


def require_own_model(place: Path, notes: dict[str, Any]) -> None:
    """Refuse a compensator folder whose model is another one than its network was trained beside.

    Args:
        place: the folder.
        notes: what its compensator.json holds.

    Raises:
        InputError: it is another one.
    """
    if sha256(place / MODEL) != notes["sha256"].get(MODEL):
        raise InputError(
            f"not a whole compensator: {MODEL} is not the one that its network was trained with",
            where=str(place),
            fix=f"train it again, or take the physics alone: --model {place / MODEL}",
        )
