"""A model: the nominal mechanism plus effects with their parameters, and how both are kept in a machine file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ptt.effects import Effect, Library, Parameter, library
from ptt.effects.base import STAGES, flatten, sizes, total_size
from ptt.effects.dated import is_dated
from ptt.effects.registry import make_effect, parse_key
from ptt.errors import ModelError, shown
from ptt.machine import MachineFile
from ptt.machine_schema import EffectEntry, ParameterEntry
from ptt.run.view import View

ONE_THING = (frozenset({"homing-offset", "dh-offsets"}),)  # pairs that cannot both be in a model


@dataclass(frozen=True, eq=False)
class Term:
    """One effect of a model with its parameters.

    Attributes:
        effect: the effect.
        theta: all parameters, flat, in declared order; empty where they are not known yet.
        std: standard deviations, NaN where none was found; None where the term was never fitted.
        measured: (P,) bool, False where a prior, not the data, decides; None where the term was never fitted.
        fixed: stems of parameters that the user holds.
        runs: SHA-256 of the run files that it belongs to, in their order; empty where it is the machine's.
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
        aside: effects of other runs, kept for them and left out here.
    """

    file: MachineFile
    terms: tuple[Term, ...] = ()
    aside: tuple[Term, ...] = ()

    def __add__(self, effect: Effect | Term) -> "Model":
        """Add an effect, at zero unless a term with parameters is given.

        Raises:
            ModelError: it is there already, does not fit the mechanism, or is one thing with another.
        """
        term = effect if isinstance(effect, Term) else Term(effect, torch.zeros(0, dtype=torch.float64))
        _check_fits(self, term.effect)
        return replace(self, terms=tuple(sorted((*self.terms, term), key=_place)))

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


def read_model(file: MachineFile, known: Library | None = None) -> Model:
    """Turn a machine file into a model.

    Args:
        file: the machine, bare or fitted.
        known: effects by name; None for the library.

    Returns:
        The model.

    Raises:
        ModelError: an unknown effect, the same twice, an unknown parameter or one of the wrong size.
    """
    known = library() if known is None else known
    model = Model(file)
    for entry in file.effect:
        try:
            model = model + _read_term(entry, make_effect(known, entry.name, entry.label), model)
        except ModelError as error:
            raise ModelError(error.what, where=f"{file.source} [[effect]] {shown(entry.name)}", fix=error.fix) from None
    return model


def write_model(model: Model, runs: Sequence[str] = ()) -> MachineFile:
    """Turn a model into a machine file.

    Args:
        model: the model.
        runs: SHA-256 of the run files that it was fitted on, in their order; effects of a run belong to them.

    Returns:
        The file with the model's effects in it, those of other runs too.
    """
    terms = [
        replace(term, runs=tuple(runs)) if is_dated(term.effect) and len(term.theta) and not term.runs else term
        for term in model.terms
    ]
    taken = {term.effect.key for term in terms}
    for term in model.aside:
        if term.effect.key in taken:  # this run has one of its own by that name
            term = replace(term, effect=replace(term.effect, label=f"{term.effect.label} {term.runs[0][:8]}".strip()))
        taken.add(term.effect.key)
        terms.append(term)
    return replace(model.file, effect=tuple(_write_term(term, model) for term in sorted(terms, key=_place)))


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


def rival(effect: Effect, keys: Sequence[str]) -> str | None:
    """Find the effect that is in part the same thing.

    Args:
        effect: about to be added.
        keys: of the effects that are there.

    Returns:
        Its key; None where there is none.
    """
    for pair in ONE_THING:
        if effect.name in pair:
            return next((key for key in keys if parse_key(key)[0] in pair - {effect.name}), None)
    return None


def start_term(effect: Effect, view: View, shape: Mapping[str, Tensor] | None = None) -> Term:
    """Put an effect at zero amplitude.

    Args:
        effect: the effect.
        view: the rows it will be fitted on.
        shape: searched and given parameters; None takes the first trial.

    Returns:
        The term.
    """
    chosen = effect.search(view)[0] if shape is None else shape
    return Term(effect, flatten(effect, chosen, view.joints))


def _place(term: Term) -> tuple[int, str]:
    return STAGES.index(term.effect.stage), term.effect.key


def _check_fits(model: Model, effect: Effect) -> None:
    kind = model.file.machine.kind
    if kind not in effect.mechanisms:
        raise ModelError(f"effect '{effect.name}' does not apply to a {kind} machine", fix="leave it out")
    if effect.key in model.keys:
        raise ModelError(f"effect '{effect.key}' is in the model already", fix="give the second one a [label]")
    other = rival(effect, model.keys)
    if other is not None:
        turn, zero = sorted((effect.name, other))  # dh-offsets, homing-offset
        raise ModelError(f"'{zero}' and the dtheta of '{turn}' are one thing", fix="keep one of them")


def _read_term(entry: EffectEntry, effect: Effect, model: Model) -> Term:
    kind, joints = model.file.machine.kind, model.joints
    specs = {parameter.on(kind).name: parameter for parameter in effect.parameters}
    unknown = [name for name in entry.parameters if name not in specs]
    if unknown:
        raise ModelError(f"parameter '{unknown[0]}' is not one of its own", fix=f"it has: {', '.join(specs)}")
    if not entry.parameters:
        return Term(effect, torch.zeros(0, dtype=torch.float64))
    values, stds, measured = [], [], []
    renewed = _renewed(entry, effect, specs, joints)
    for name, parameter in specs.items():
        size = parameter.size(joints)
        given = entry.parameters.get(name)
        if given is None and parameter.role != "linear":
            raise ModelError(f"parameter '{name}' is missing", fix="add it, or leave all parameters out and fit")
        if parameter.stem in renewed:
            values.append(_spread(renewed[parameter.stem], size, name))
            given = None  # standard errors were of the older form
        else:
            values.append(_spread(given.value if given else 0.0, size, name))
        stds.append(_spread(torch.nan if given is None or given.std is None else given.std, size, name))
        measured.append(_spread(True if given is None or given.measured is None else given.measured, size, name).bool())
    fixed = frozenset(p.stem for name, p in specs.items() if name in entry.parameters and entry.parameters[name].fixed)
    return Term(effect, torch.cat(values), torch.cat(stds), torch.cat(measured), fixed, _runs_of(entry, effect, model))


def _runs_of(entry: EffectEntry, effect: Effect, model: Model) -> tuple[str, ...]:
    """Runs that an effect belongs to; where the entry does not say, those of the step that brought it in."""
    if entry.runs or not is_dated(effect):
        return entry.runs
    steps = [row for row in model.file.history if effect.key in row.get("added", ())]
    return tuple(item["sha256"] for item in steps[-1].get("files", ())) if steps else ()


def _renewed(entry: EffectEntry, effect: Effect, specs: Mapping[str, Parameter], joints: int) -> dict[str, Tensor]:
    """Values, by stem, that the file has in an older form."""
    found = {
        parameter.stem: torch.as_tensor(entry.parameters[name].value, dtype=torch.float64).reshape(-1)
        for name, parameter in specs.items()
        if name in entry.parameters
    }
    new = effect.renew(found, joints)
    return {stem: value for stem, value in new.items() if value is not found.get(stem)}


def _spread(value: object, size: int, name: str) -> Tensor:
    tensor = torch.as_tensor(value, dtype=torch.float64).reshape(-1)
    if len(tensor) not in (1, size):
        raise ModelError(f"parameter '{name}' has {len(tensor)} values", fix="give one" + f", or {size}" * (size > 1))
    return tensor.expand(size).clone()


def _write_term(term: Term, model: Model) -> EffectEntry:
    kind, joints = model.file.machine.kind, model.joints
    effect = term.effect
    entries: dict[str, ParameterEntry] = {}
    if len(term.theta) == total_size(effect, joints):
        start = 0
        for parameter, size in zip(effect.parameters, sizes(effect, joints), strict=True):
            part = slice(start, start + size)
            start += size
            fitted = term.std is not None and parameter.role != "given" and parameter.stem not in term.fixed
            entries[parameter.on(kind).name] = ParameterEntry(
                value=_plain(term.theta[part]),
                std=_plain(term.std[part]) if fitted and term.std is not None and _known(term.std[part]) else None,
                measured=_plain_flags(term.measured[part]) if fitted and term.measured is not None else None,
                fixed=parameter.stem in term.fixed,
            )
    return EffectEntry(name=effect.name, label=effect.label, runs=term.runs, parameters=entries)


def _known(values: Tensor) -> bool:
    return bool(torch.isfinite(values).all())


def _plain(values: Tensor) -> float | tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    return numbers[0] if len(numbers) == 1 else numbers


def _plain_flags(values: Tensor) -> bool | tuple[bool, ...]:
    flags = tuple(bool(value) for value in values)
    return flags[0] if len(flags) == 1 else flags
