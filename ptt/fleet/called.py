"""How the command line names a machine: by its name, or by its machine file or compensator folder."""

import os
from pathlib import Path

from ptt.correct.training.machine_of import NOTES, machine_of
from ptt.fleet.store import Store
from ptt.fleet.store import machine_of as drawing_known


def machine_called(store: Store, text: str) -> tuple[str, Path | None]:
    """A machine's name, and the path of its drawing where that was given instead of the name.

    A name that the store knows comes before a file or folder of the same name.

    Args:
        store: the store.
        text: a name, or the path of a machine file (.toml) or of a compensator folder.

    Returns:
        The name (that under [machine] of a file, or the file's own without its ending), and the file or folder; None
        where a name was given.

    Raises:
        InputError: the file is no machine file, or the folder no whole compensator.
    """
    if drawing_known(store, text) is not None or not _is_drawing(text):
        return text, None
    path = Path(text)
    spec = machine_of(path).machine
    stated = spec.name.strip() if "name" in spec.model_fields_set else ""
    return stated or Path(os.path.abspath(path)).stem, path


def _is_drawing(text: str) -> bool:
    """Whether a text is the path of a machine file or of a compensator folder that is there."""
    return (text.lower().endswith(".toml") and os.path.isfile(text)) or os.path.isfile(os.path.join(text, NOTES))
