"""Candidates: effects that could be added to a model, and those that the data cannot test."""

from collections.abc import Collection, Sequence

from ptt.effects import Effect, Library
from ptt.effects.metrology import TrackerFrame
from ptt.fitting.result import FitResult
from ptt.model.model import rival
from ptt.run.problem import Problem

SECOND = {"once-per-rev": "harmonic 2", "setup-jump": "second"}  # effects of which a machine may well have two


def present_candidates(fitted: FitResult, problem: Problem, known: Library) -> tuple[list[Effect], dict[str, str]]:
    """Effects that could be added, and those that the data cannot test.

    Args:
        fitted: the present model.
        problem: the readings.
        known: effects by name.

    Returns:
        Candidates, and name -> what it needs.
    """
    kind = problem.file.machine.kind
    candidates, untestable = [], {}
    for name, cls in known.items():
        effect = _next_label(cls, fitted.model.keys)
        if effect is None or kind not in cls.mechanisms:
            continue
        if cls is TrackerFrame and problem.file.tracker.frame != "trusted":
            continue
        if rival(effect, [entry.name for entry in problem.file.effect]):  # the user's choice between two of a kind
            continue
        lack = effect.needs(problem.view)
        if lack:
            if not effect.label:
                untestable[name] = lack
        else:
            candidates.append(effect)
    return candidates, untestable


def first_of(name: str, names: Collection[str]) -> str:
    """What an effect goes by among others: a second knock without a first is the first.

    Args:
        name: key of the effect.
        names: of all that are there, its own included.

    Returns:
        The key.
    """
    base = name.partition("[")[0]
    return base if base == "setup-jump" and base not in names and name == f"{base}[{SECOND[base]}]" else name


def _next_label(cls: type[Effect], keys: Sequence[str]) -> Effect | None:
    """The effect itself, or, where it is in the model, a second of its kind if it can have one."""
    if cls.name not in keys:
        return cls()
    label = SECOND.get(cls.name)
    return cls(label) if label and f"{cls.name}[{label}]" not in keys else None
