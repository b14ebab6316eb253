"""How well a model names what is hidden in a rig: found, missed, added wrongly; and what compensation makes of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import torch

from ptt.challenge.remeasure import ToolError, remeasure
from ptt.challenge.truth import UM_PER_MM, UNDETECTABLE, HiddenFault, Truth
from ptt.correct.task import Correction
from ptt.model.model import Model, Term, parameter_names, told_values
from ptt.run.noise import Noise

Found = Literal["found", "explained", "missed", "too small"]
Named = Literal["right", "fair", "partial", "unclaimed", "wrong"]
CLAIMED = 3.0  # standard errors from zero from which a fitted value says that something is there


@dataclass(frozen=True)
class Judgement:
    """A choice of effects held against the truth.

    Attributes:
        faults: hidden fault -> 'found'; 'explained' (the named effects describe its share in the run, by a fit to the
            truth); 'missed'; 'too small' (it does not count, and was not named).
        named: effect -> 'right'; 'fair' (describes a fault under another name); 'partial' (describes a part of a fault
            outside the library); 'unclaimed' (nothing of the kind is hidden, and no value says that it is: a size of
            the drawing that stays near zero); 'wrong'.
        instead: hidden fault -> named effects that describe it under other names.
    """

    faults: dict[str, Found]
    named: dict[str, Named]
    instead: dict[str, tuple[str, ...]]

    @property
    def right(self) -> bool:
        """Whether every fault that counts is found or explained, and no effect is wrong or partial."""
        return "missed" not in self.faults.values() and not {"wrong", "partial"} & set(self.named.values())


@dataclass(frozen=True)
class Score:
    """What a model is worth, the seal opened.

    Attributes:
        judgement: effect by effect.
        faults: what was hidden.
        parameters: effect of the model -> (name, value, standard deviation or None).
        noise: of one reading.
        left_um: what the model's effects, fitted to the run without noise, leave of it.
        tool: the tool's error before and after compensation.
    """

    judgement: Judgement
    faults: tuple[HiddenFault, ...]
    parameters: dict[str, tuple[tuple[str, float, float | None], ...]]
    noise: Noise
    left_um: float
    tool: ToolError

    @property
    def worse(self) -> bool:
        """Whether the model's commands put the tool farther off than the controller's own, by more than the noise."""
        error = self.tool.to_dict()
        before, after = error["before"], error["after"]
        return (
            before is not None and after is not None and after["total"] > before["total"] + UM_PER_MM * self.noise.total
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "right": self.judgement.right and not self.worse,
            "worse": self.worse,
            "hidden": [self._hidden(fault) for fault in self.faults],
            "named": [
                {"effect": key, "is": word, "parameters": self._parameters(key)}
                for key, word in self.judgement.named.items()
            ],
            "noise_um": self.noise.to_dict(),
            "left_um": self.left_um,
            "tool_error_um": self.tool.to_dict(),
        }

    def _hidden(self, fault: HiddenFault) -> dict[str, Any]:
        return {
            "effect": fault.name,
            "is": self.judgement.faults[fault.name],
            "instead": list(self.judgement.instead.get(fault.name, ())),
            "size_um": UM_PER_MM * fault.size,
            "truth": dict(fault.values),
            "model": self._parameters(fault.name) if fault.name in self.parameters else None,
        }

    def _parameters(self, key: str) -> list[dict[str, Any]]:
        return [{"name": name, "value": value, "std": std} for name, value, std in self.parameters[key]]


def judge(keys: Sequence[str], truth: Truth) -> Judgement:
    """Compare the effects that were named with the faults that were hidden.

    Another name than the hidden one is fair where the run cannot tell them apart: the named effects are fitted to the
    run without noise with and without the hidden one, and chi-squared differs by less than UNDETECTABLE. So exact
    ambiguities (all slider zeros and the tracker's z; tracker scale and links, radius, lead and zero together) and
    those of this one run are treated alike.

    Args:
        keys: effects named, with [label] where they have one.
        truth: what was hidden.

    Returns:
        The judgement.
    """
    extra = [key for key in keys if key not in truth.hidden]
    faults: dict[str, Found] = {}
    instead: dict[str, tuple[str, ...]] = {}
    for fault in truth.faults:
        if fault.name in keys:
            faults[fault.name] = "found"
        elif not fault.counts:
            faults[fault.name] = "too small"
        elif _explained(fault, keys, truth):
            faults[fault.name] = "explained"
            instead[fault.name] = tuple(key for key in extra if _contributes(key, keys, truth))
        else:
            faults[fault.name] = "missed"
    stands_in = {key for group in instead.values() for key in group}
    open_ = [fault for fault in truth.faults if faults[fault.name] == "missed"]
    odd = any(not fault.known for fault in open_)
    named: dict[str, Named] = {}
    for key in keys:
        if key in truth.hidden:
            named[key] = "right"
        elif odd and _contributes(key, keys, truth):
            named[key] = "partial"
        else:
            named[key] = "fair" if key in stands_in and not open_ else "wrong"
    return Judgement(faults, named, instead)


def score(model: Model, truth: Truth, correction: Correction | None = None) -> Score:
    """Score a fitted model.

    Args:
        model: effects with their parameters.
        truth: what was hidden.
        correction: what a network adds to the commands; None without one.

    Returns:
        The score.
    """
    judgement = judge(model.keys, truth)
    unclaimed = {term.effect.key for term in model.terms if not _is_claimed(term)}
    named: dict[str, Named] = {
        key: "unclaimed" if word == "wrong" and key in unclaimed else word for key, word in judgement.named.items()
    }
    return Score(
        replace(judgement, named=named),
        truth.faults,
        _read_parameters(model),
        truth.noise,
        UM_PER_MM * truth.left_rms(model.keys),
        remeasure(model, truth.drawn, correction),
    )


def _is_claimed(term: Term) -> bool:
    """Whether a term says that something is there: a size of the drawing does where a value is measured as not zero."""
    if not term.effect.of_drawing or term.std is None or term.measured is None:
        return True
    known = torch.isfinite(term.std)
    beyond = term.theta.abs() > CLAIMED * term.std
    return not bool(known.any()) or bool((known & term.measured & beyond).any())


def _explained(fault: HiddenFault, keys: Sequence[str], truth: Truth) -> bool:
    """Whether the named effects describe the run as well as with the fault that was not named."""
    if fault.known:
        return truth.left(keys) - truth.left([*keys, fault.name]) < UNDETECTABLE
    return truth.left_rms(keys) < 0.5 * truth.noise.total


def _contributes(key: str, keys: Sequence[str], truth: Truth) -> bool:
    """Whether the run without noise is described detectably worse without an effect."""
    return truth.left([other for other in keys if other != key]) - truth.left(keys) >= UNDETECTABLE


def _read_parameters(model: Model) -> dict[str, tuple[tuple[str, float, float | None], ...]]:
    kind, parameters = model.file.machine.kind, {}
    for term in model.terms:
        names = parameter_names(term.effect, kind, model.joints)[: len(term.theta)]
        told = told_values(term.effect, term.theta, model.joints)
        stds = [None] * len(names) if term.std is None else [float(std) for std in term.std]
        parameters[term.effect.key] = tuple(
            (name, float(value), None if std is None or not np.isfinite(std) else std)
            for name, value, std, said in zip(names, term.theta, stds, told[: len(names)], strict=True)
            if said
        )
    return parameters
