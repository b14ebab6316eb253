"""Models whose effects and values are written down in a test."""

from collections.abc import Sequence
from dataclasses import replace

import torch

from ptt.correct.training.compensator import Compensator
from ptt.effects import library
from ptt.machine import MachineFile
from ptt.machine_schema import EffectEntry, ParameterEntry
from ptt.model.entries import read_model
from ptt.model.model import Model, Term


def with_effects(file: MachineFile, **effects: dict[str, object]) -> Model:
    """The model of a machine file with effects by name (underscores for hyphens), their values by a file's keys."""
    entries = tuple(
        EffectEntry(
            name=name.replace("_", "-"), parameters={key: ParameterEntry(value=value) for key, value in own.items()}
        )
        for name, own in effects.items()
    )
    return read_model(replace(file, effect=entries))


def compensator(file: MachineFile, **effects: dict[str, object]) -> Compensator:
    """The same as a compensator without a network."""
    return Compensator(with_effects(file, **effects), None, {})


def term(name: str, values: Sequence[float]) -> Term:
    """An effect of the library with all its values."""
    return Term(library()[name](), torch.tensor(values, dtype=torch.float64))
