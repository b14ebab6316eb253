"""Find out why a 3-PTT parallel robot misses its target, name the missing physics, and correct it.

::

    model = ptt.load("machine.toml")
    run = ptt.read("run.csv", model)
    print(ptt.diagnose(model, run))

What is here is loaded when it is first asked for, so that `import ptt` costs next to nothing.
"""

import importlib
from typing import TYPE_CHECKING, Any

from ptt.threads import on_one_thread
from ptt.version import __version__ as __version__

if TYPE_CHECKING:
    from ptt import commands as commands
    from ptt import effects as effects
    from ptt import errors as errors
    from ptt.door.changing import add as add
    from ptt.door.changing import fit as fit
    from ptt.door.changing import remove as remove
    from ptt.door.checking import check as check
    from ptt.door.comparing import compare as compare
    from ptt.door.diagnosing import diagnose as diagnose
    from ptt.door.evaluating import evaluate as evaluate
    from ptt.door.exporting import export as export
    from ptt.door.model import Model as Model
    from ptt.door.model import load as load
    from ptt.door.predicting import predict as predict
    from ptt.door.rechecking import recheck as recheck
    from ptt.door.run import Run as Run
    from ptt.door.run import read as read
    from ptt.door.run import read_targets as read_targets
    from ptt.door.simulating import simulate as simulate
    from ptt.door.training import train as train


_DOOR = {
    "load": "model",
    "read": "run",
    "read_targets": "run",
    "check": "checking",
    "compare": "comparing",
    "diagnose": "diagnosing",
    "add": "changing",
    "remove": "changing",
    "fit": "changing",
    "train": "training",
    "predict": "predicting",
    "evaluate": "evaluating",
    "recheck": "rechecking",
    "export": "exporting",
    "simulate": "simulating",
    "Model": "model",
    "Run": "run",
}

_ROOMS = ("effects", "errors", "commands")

__all__ = [
    "Model", "Run", "add", "check", "compare", "diagnose", "effects", "evaluate", "export", "fit", "load", "predict",
    "read", "read_targets", "recheck", "remove", "simulate", "train",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Load a name of the front door when it is asked for."""
    if name in _ROOMS:
        return importlib.import_module(f"ptt.{name}")
    if name not in _DOOR:
        raise AttributeError(f"module 'ptt' has no attribute '{name}'")
    value = getattr(importlib.import_module(f"ptt.door.{_DOOR[name]}"), name)
    value = value if isinstance(value, type) else on_one_thread(value)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The names of the front door."""
    return sorted([*__all__, "__version__"])
