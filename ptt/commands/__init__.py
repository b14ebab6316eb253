"""The verbs of the command line: arguments in, a frozen result out as text or JSON."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ptt.commands import main as main


def __getattr__(name: str) -> Any:
    """Load `main` when it is asked for: `ptt.commands.main.run([...])` needs no import but that of ptt."""
    if name == "main":
        return importlib.import_module("ptt.commands.main")
    raise AttributeError(f"module 'ptt.commands' has no attribute '{name}'")
