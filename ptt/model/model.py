"""A model: the nominal mechanism plus effects with their parameters, and how both are kept in a machine file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ptt.effects import Effect
from ptt.effects.base import STAGES
from ptt.effects.layout import flatten, total_size
from ptt.effects.registry import parse_key
from ptt.errors import ModelError
from ptt.machine import MachineFile
from ptt.run.view import View

EQUIVALENT = (frozenset({"homing-offset", "dh-offsets"}),)  # pairs with a parameter in common: a model has one of them


@dataclass(frozen=True, eq=False)
class Term:
    """One effect of a model with its parameters.

    Attributes:
        effect: the effect.
        theta: all parameters, flat, in declared order; empty where they are not known yet.
        std: standard errors, (P,), NaN where none was found; None where the term was never fitted.
        measured: (P,) bool, False where a prior, not the data, decides; None where the term was never fitted.
        fixed: stems of the parameters that the user holds fixed in a fit.
        runs: SHA-256 of the run files that it belongs to, in their order; empty where it belongs to the machine.
    """

    effect: Effect
    theta: Tensor
    std: Tensor | None = None
    measured: Tensor | None = None
    fixed: frozenset[str] = frozenset()
    runs: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Model:
    """A machine file and the effects that were added to it.

    `model + effect` gives a new model; the order of effects does not matter.

    Attributes:
        file: drawing, controller, tracker, history.
        terms: the effects.
        aside: effects that belong to other runs than the present ones: not applied, but kept in the file.
    """

    file: MachineFile
    terms: tuple[Term, ...] = ()
    aside: tuple[Term, ...] = ()

    def __add__(self, effect: Effect | Term) -> "Model":
        """Add an effect without values, or a term with its values; trailing ones that have a default may be missing.

        Raises:
            ModelError: it is there already, does not fit the mechanism, has a parameter in common with an effect that
                is there, or has too many or too few values.
        """
        term = effect if isinstance(effect, Term) else Term(effect, torch.zeros(0, dtype=torch.float64))
        require_fits(self, term.effect)
        term = _with_defaults(term, self.joints)
        return replace(self, terms=tuple(sorted((*self.terms, term), key=by_stage)))

    def without(self, key: str) -> "Model":
        """Take an effect out.

        Args:
            key: name, with [label] where it has one.

        Returns:
            The model without it.

        Raises:
            ModelError: it is not there.
        """
        held = (*self.keys, *(term.effect.key for term in self.aside))
        if key not in held:
            raise ModelError(f"effect '{key}' is not in the model", fix=f"it has: {', '.join(held) or 'none'}")
        if key not in self.keys:
            return replace(self, aside=tuple(term for term in self.aside if term.effect.key != key))
        return replace(self, terms=tuple(term for term in self.terms if term.effect.key != key))

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the effects, with [label] where they have one."""
        return tuple(term.effect.key for term in self.terms)

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.file.machine.joints


def parameter_names(effect: Effect, kind: str, joints: int) -> list[str]:
    """Names of all values of an effect, as in 'gap_mm 2' for the second joint.

    Args:
        effect: the effect.
        kind: mechanism family.
        joints: k.

    Returns:
        One name per value.
    """
    names = []
    for parameter in effect.parameters:
        name, size = parameter.on(kind).name, parameter.size(joints)
        if size == 1:
            names.append(name)
        elif parameter.onward:
            names += [f"{name} {j + 1}.{link + 1}" for j in range(joints) for link in range(j, joints)]
        elif parameter.per_joint and parameter.count > 1:
            names += [f"{name} {i // parameter.count + 1}.{i % parameter.count + 1}" for i in range(size)]
        else:
            names += [f"{name} {i + 1}" for i in range(size)]
    return names


def told_values(effect: Effect, theta: Tensor, joints: int) -> list[bool]:
    """Which values of an effect files and lists state: all but those of a parameter that stands at its default.

    And those at beginnings that a run does not have.

    Args:
        effect: the effect.
        theta: all its parameters, flat; empty before a fit, when those with a default count as standing at it.
        joints: k.

    Returns:
        One flag per value.
    """
    told, start = list[bool](), 0
    for parameter in effect.parameters:
        size = parameter.size(joints)
        own = theta[start : start + size]
        usual = parameter.default is not None and bool((own == parameter.default).all())
        told += (own != 0.0).tolist() if parameter.at_beginnings and len(own) else [not usual] * size
        start += size
    return told


def rival(effect: Effect, keys: Sequence[str]) -> str | None:
    """Find the effect that has a parameter in common with another (`EQUIVALENT`), so that no data tell them apart.

    Args:
        effect: about to be added.
        keys: of the effects that are there.

    Returns:
        Its key; None where there is none.
    """
    for pair in EQUIVALENT:
        if effect.name in pair:
            return next((key for key in keys if parse_key(key)[0] in pair - {effect.name}), None)
    return None


def by_stage(term: Term) -> tuple[int, str]:
    """Sort key of a model's terms: stage along the causal chain, then key."""
    return STAGES.index(term.effect.stage), term.effect.key


def start_term(effect: Effect, view: View) -> Term:
    """Put an effect at zero amplitude, in the first shape that a search tries.

    Args:
        effect: the effect.
        view: the rows it will be fitted on.

    Returns:
        The term.
    """
    return Term(effect, flatten(effect, effect.search(view)[0], view.joints))


def _with_defaults(term: Term, joints: int) -> Term:
    """A term with the default of each value that it leaves out; parameters with a default are declared last."""
    size, given = total_size(term.effect, joints), len(term.theta)
    if given in (0, size):
        return term
    defaults = [p.default for p in term.effect.parameters for _ in range(p.size(joints)) if p.default is not None]
    if given + len(defaults) != size:
        raise ModelError(f"effect '{term.effect.key}' has {size} values, not {given}", fix="see docs/effects.md")
    return replace(term, theta=torch.cat([term.theta, torch.tensor(defaults, dtype=torch.float64)]))


def require_fits(model: Model, effect: Effect) -> None:
    """Refuse an effect that a model cannot be given, whatever the data are.

    Args:
        model: as it is.
        effect: about to be added.

    Raises:
        ModelError: it is there already, does not fit the mechanism, or has a parameter in common with one that is.
    """
    kind = model.file.machine.kind
    if kind not in effect.mechanisms:
        raise ModelError(f"effect '{effect.name}' does not apply to a {kind} machine", fix="leave it out")
    if effect.least_joints > model.joints:
        what = f"effect '{effect.name}' asks for {effect.least_joints} joints, and the machine has {model.joints}"
        raise ModelError(what, fix="leave it out, or mend its file")
    if effect.key in model.keys:
        raise ModelError(f"effect '{effect.key}' is in the model already", fix="give the second one a [label]")
    other = rival(effect, model.keys)
    if other is not None:
        turn, zero = sorted((effect.name, other))  # dh-offsets, homing-offset
        raise ModelError(f"'{zero}' and the dtheta of '{turn}' are one thing", fix="keep one of them")
