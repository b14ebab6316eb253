"""Candidates: effects that could be added to a model, and those that the data cannot test."""

from collections.abc import Collection, Sequence

from ptt.effects import Effect, Library
from ptt.effects.metrology import TrackerFrame
from ptt.fitting.result import FitResult
from ptt.machine_schema import key_of
from ptt.model.model import rival
from ptt.run.problem import Problem

# Labels of further sudden events: each of three sliders may slip, and a tracker be knocked, at its own time
EVENT_LABELS = ("second", "third")
# Effect -> labels of further instances, of which a machine may have several.
FURTHER_LABELS = {"once-per-rev": ("harmonic 2",), "homing-slip": EVENT_LABELS, "setup-jump": EVENT_LABELS}


def present_candidates(
    fitted: FitResult, problem: Problem, known: Library, seen: Sequence[Effect] = ()
) -> tuple[list[Effect], dict[str, str]]:
    """Effects that could be added, and those that the data cannot test.

    Args:
        fitted: the present model.
        problem: the readings.
        known: effects by name.
        seen: further instances of an effect that the residual asks for (harmonics of a turn).

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
    there = {*fitted.model.keys, *(effect.key for effect in candidates)}
    candidates += [effect for effect in seen if effect.name in known and effect.key not in there]
    return candidates, untestable


def first_of(name: str, names: Collection[str]) -> str:
    """Canonical key of an event among others: a second knock without a first is the first.

    Args:
        name: key of the effect.
        names: keys of all effects of the set, its own included.

    Returns:
        The key; of effects other than events the given one.
    """
    base = name.partition("[")[0]
    if FURTHER_LABELS.get(base) != EVENT_LABELS:
        return name
    keys = _keys(base)
    return keys[sum(key in names for key in keys[: keys.index(name)])]


def _next_label(cls: type[Effect], keys: Sequence[str]) -> Effect | None:
    """An effect of the class with the first label that is not among the keys; None where all are taken."""
    labels = ("", *FURTHER_LABELS.get(cls.name, ()))
    return next((cls(label) for label, key in zip(labels, _keys(cls.name), strict=True) if key not in keys), None)


def _keys(name: str) -> list[str]:
    """Keys of an effect and of its further instances."""
    return [name, *(key_of(name, label) for label in FURTHER_LABELS.get(name, ()))]
