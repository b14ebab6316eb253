"""Model <-> machine file: its effects as [[effect]] entries, and the check of what a controller compensates."""

import difflib
from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ptt.effects import Effect, Library, library
from ptt.effects.dated import has_date
from ptt.effects.layout import sizes, total_size
from ptt.effects.registry import make_effect, parse_key
from ptt.errors import ModelError, shown
from ptt.machine import MachineFile
from ptt.machine_schema import EffectEntry, ParameterEntry
from ptt.model.model import Model, Term, by_stage, told_values


def read_model(file: MachineFile, known: Library | None = None, *, checked: bool = False) -> Model:
    """Turn a machine file into a model.

    Args:
        file: the machine, bare or fitted.
        known: effects by name; None for the library.
        checked: skip the check of [controller] compensates, which needs all effects known: an earlier reading of the
            same file made it.

    Returns:
        The model.

    Raises:
        ModelError: an unknown effect (under [controller] too), the same effect twice, an unknown parameter, or one of
            the wrong size.
    """
    known = library() if known is None else known
    if not checked:
        _require_known(file, known)
    model = Model(file)
    for entry in file.effect:
        try:
            model = model + _read_term(entry, make_effect(known, entry.name, entry.label), model)
        except ModelError as error:
            raise ModelError(error.what, where=f"{file.source} [[effect]] {shown(entry.name)}", fix=error.fix) from None
    return model


def _require_known(file: MachineFile, known: Library) -> None:
    """Refuse names under [controller] compensates that are no such effect: that effect would be compensated twice."""
    for key in file.controller.compensates:
        try:
            _require_compensated(key, file, known)
        except ModelError as error:
            where = f"{file.source} key controller.compensates"
            raise ModelError(error.what, where=where, fix=error.fix) from None


def _require_compensated(key: str, file: MachineFile, known: Library) -> None:
    """Refuse one name under [controller] compensates that is no effect a controller can compensate."""
    name, label = parse_key(key)
    if name not in known and difflib.get_close_matches(name, list(known)):
        make_effect(known, name, label)  # says which one was meant
    if name in known and _can_be_compensated(known[name], file):
        return
    names = ", ".join(each for each in known if _can_be_compensated(known[each], file))
    what = f"'{shown(key)}' is no effect that a controller of this machine can compensate"
    raise ModelError(what, fix=f"name some of {names}, or your own with --effects FILE.py")


def _can_be_compensated(effect: type[Effect], file: MachineFile) -> bool:
    """Whether commands can make up for an effect: not for one of the metrology, nor for another mechanism's."""
    return effect.stage != "metrology" and file.machine.kind in effect.mechanisms


def write_model(model: Model, runs: Sequence[str] = ()) -> MachineFile:
    """Turn a model into a machine file.

    Args:
        model: the model.
        runs: SHA-256 of the run files that it was fitted on, in their order; written to the effects that belong to a
            run and name none yet.

    Returns:
        The file with the model's effects in it, those set aside for other runs (`Model.aside`) too.
    """
    terms = [
        replace(term, runs=tuple(runs)) if not term.runs and _is_told_of_run(term) else term for term in model.terms
    ]
    taken = {term.effect.key for term in terms}
    for term in model.aside:
        if term.effect.key in taken:  # this run has one of its own by that name
            term = replace(term, effect=replace(term.effect, label=f"{term.effect.label} {term.runs[0][:8]}".strip()))
        taken.add(term.effect.key)
        terms.append(term)
    return replace(model.file, effect=tuple(_write_term(term, model) for term in sorted(terms, key=by_stage)))


def _is_told_of_run(term: Term) -> bool:
    return len(term.theta) > 0 and has_date(term.effect, term.theta)


def _read_term(entry: EffectEntry, effect: Effect, model: Model) -> Term:
    """An entry's values, standard errors and flags as flat vectors in the effect's declared order."""
    kind, joints = model.file.machine.kind, model.joints
    specs = {parameter.on(kind).name: parameter for parameter in effect.parameters}
    unknown = [name for name in entry.parameters if name not in specs]
    if unknown:
        raise ModelError(f"parameter '{unknown[0]}' is not one of its own", fix=f"it has: {', '.join(specs)}")
    if not entry.parameters:
        return Term(effect, torch.zeros(0, dtype=torch.float64))
    values, stds, measured = [], [], []
    for name, parameter in specs.items():
        size = parameter.size(joints)
        given = entry.parameters.get(name)
        if given is None and parameter.role != "linear" and parameter.default is None:
            raise ModelError(f"parameter '{name}' is missing", fix="add it, or leave all parameters out and fit")
        expand = _begun if parameter.at_beginnings else _expanded
        values.append(expand(given.value if given else parameter.default or 0.0, size, name))
        low, high = parameter.lower, parameter.upper
        if not bool(((values[-1] >= low) & (values[-1] <= high)).all()):
            raise ModelError(f"parameter '{name}' is out of its bounds", fix=f"give {low:g} to {high:g}")
        std = torch.nan if given is None or given.std is None else given.std
        seen = True if given is None or given.measured is None else given.measured
        stds.append(expand(std, size, name))
        measured.append(expand(seen, size, name).bool())
    fixed = frozenset(p.stem for name, p in specs.items() if name in entry.parameters and entry.parameters[name].fixed)
    theta = torch.cat(values)
    return Term(effect, theta, torch.cat(stds), torch.cat(measured), fixed, _runs_of(entry, effect, theta, model))


def _runs_of(entry: EffectEntry, effect: Effect, theta: Tensor, model: Model) -> tuple[str, ...]:
    """Runs that an effect belongs to; where the entry does not say, those of the step that brought it in."""
    if entry.runs or not has_date(effect, theta):
        return entry.runs
    steps = [row for row in model.file.history if effect.key in row.get("added", ())]
    return tuple(item["sha256"] for item in steps[-1].get("files", ())) if steps else ()


def _begun(value: object, size: int, name: str) -> Tensor:
    """Values at the first beginnings, and zero at further ones, as a vector (size,)."""
    tensor = torch.as_tensor(value, dtype=torch.float64).reshape(-1)
    if len(tensor) > size:
        raise ModelError(f"parameter '{name}' has {len(tensor)} values", fix=f"give {size} at most")
    return torch.nn.functional.pad(tensor, (0, size - len(tensor)))


def _expanded(value: object, size: int, name: str) -> Tensor:
    """One value for all, or `size` values, as a vector (size,)."""
    tensor = torch.as_tensor(value, dtype=torch.float64).reshape(-1)
    if len(tensor) not in (1, size):
        raise ModelError(f"parameter '{name}' has {len(tensor)} values", fix="give one" + f", or {size}" * (size > 1))
    return tensor.expand(size).clone()


def _write_term(term: Term, model: Model) -> EffectEntry:
    kind, joints = model.file.machine.kind, model.joints
    effect = term.effect
    entries: dict[str, ParameterEntry] = {}
    if len(term.theta) == total_size(effect, joints):
        start, told = 0, told_values(effect, term.theta, joints)
        for parameter, size in zip(effect.parameters, sizes(effect, joints), strict=True):
            part = slice(start, start + size)
            start += size
            if not any(told[part]):
                continue
            if parameter.at_beginnings:
                part = slice(part.start, max(place for place in range(part.start, part.stop) if told[place]) + 1)
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
