"""A model: the nominal mechanism plus effects with their parameters, evaluated along the causal chain."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ptt.effects import Effect, Library, library
from ptt.effects.base import STAGES, flatten, linear_size, shape_of, sizes, total_size
from ptt.effects.registry import make_effect, parse_key
from ptt.errors import ModelError
from ptt.machine import EffectEntry, MachineFile, ParameterEntry
from ptt.mechanisms.sensitivity import sensitivity
from ptt.view import View

Shifts = Sequence[tuple[Effect, Tensor]]  # effects with their flat parameters
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
    """

    effect: Effect
    theta: Tensor
    std: Tensor | None = None
    measured: Tensor | None = None
    fixed: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Model:
    """A machine file and the effects that were added to it.

    `model + effect` gives a new model; the order of effects does not matter.

    Attributes:
        file: drawing, controller, tracker, history.
        terms: the effects.
    """

    file: MachineFile
    terms: tuple[Term, ...] = ()

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
        if key not in self.keys:
            raise ModelError(f"effect '{key}' is not in the model", fix=f"it has: {', '.join(self.keys) or 'none'}")
        return replace(self, terms=tuple(term for term in self.terms if term.effect.key != key))

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the effects, with [label] where they have one."""
        return tuple(term.effect.key for term in self.terms)

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return 3 if self.file.machine.kind == "three-ptt" else len(self.file.machine.joint)


@dataclass(frozen=True)
class Prediction:
    """What the model says of n rows, stage by stage.

    Attributes:
        q: actual joint values, (n, k) mm or rad.
        geometry: shift of the mechanism's slots, (n, G) or (1, G); zeros where no effect moves them.
        p: actual tool position in the base frame, structure included, (n, 3) mm.
        reading: what a tracker in the base frame would read, (n, 3) mm.
    """

    q: Tensor
    geometry: Tensor
    p: Tensor
    reading: Tensor


@dataclass(frozen=True)
class Linearised:
    """A prediction with its derivatives by all parameters.

    Attributes:
        prediction: the prediction.
        jacobian: d reading / d theta, (n, 3, P), terms in the given order.
        by_mount: d reading / d place of the reflector beside the tool point, (n, 3, 3).
    """

    prediction: Prediction
    jacobian: Tensor
    by_mount: Tensor


@dataclass(frozen=True)
class Chain:
    """The causal chain at a model's present parameters: where a small further shift of each stage would lead.

    Attributes:
        at_drive: the rows as drive effects see them.
        at_joints: as geometry effects see them.
        at_tool: as structure and metrology effects see them.
        by_joint: d reading / d joint shift, (n, 3, k).
        by_slot: d reading / d geometry slot, (n, 3, G).
        reading: (n, 3) mm.
    """

    at_drive: View
    at_joints: View
    at_tool: View
    by_joint: Tensor
    by_slot: Tensor
    reading: Tensor


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
            raise ModelError(error.what, where=f"{file.source} [[effect]] {entry.name}", fix=error.fix) from None
    return model


def write_model(model: Model) -> MachineFile:
    """Turn a model into a machine file.

    Args:
        model: the model.

    Returns:
        The file with the model's effects in it.
    """
    return replace(model.file, effect=tuple(_write_term(term, model) for term in model.terms))


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


def predict(terms: Shifts, view: View) -> Prediction:
    """Follow the causal chain: drive, geometry, forward kinematics, structure, metrology.

    Args:
        terms: effects with their flat parameters.
        view: n rows.

    Returns:
        The prediction, tracker frame left aside.
    """
    q = view.q + _total(terms, "drive", view, view.q)
    at_joints = view.at(q=q)
    geometry = _total(terms, "geometry", at_joints, view.q.new_zeros(1, len(view.mechanism.slots)))
    p = view.mechanism.forward(q, view.mounted(geometry))
    at_tool = at_joints.at(p=p)
    p = p + _total(terms, "structure", at_tool, p)
    reading = p + _total(terms, "metrology", at_tool.at(p=p), p)
    return Prediction(q, geometry, p, reading)


def components(terms: Shifts, view: View) -> dict[str, Tensor]:
    """What each effect contributes to the reading, evaluated apart.

    Args:
        terms: effects with their flat parameters.
        view: n rows.

    Returns:
        Key of the effect -> reading with all effects less reading without this one, (n, 3) mm.
    """
    whole = predict(terms, view).reading
    return {
        effect.key: whole - predict([term for term in terms if term[0].key != effect.key], view).reading
        for effect, _ in terms
    }


def linearise(terms: Shifts, view: View, *, crossed: bool = True) -> Linearised:
    """Predict, with exact derivatives by forward mode along the chain.

    Each effect is differentiated by its own parameters (its basis, or torch.func where it is not linear); what comes
    before reaches what comes after through the row-wise derivative of each stage by its input.

    Args:
        terms: effects with their flat parameters.
        view: n rows.
        crossed: also follow how a shift of one stage changes the shifts of the next, a thousandth of the whole; a
            search that only compares models goes without.

    Returns:
        The prediction and d reading / d theta.
    """
    links = terms if crossed else ()
    slots = len(view.mechanism.slots)
    drive = [differentiate(e, theta, view) if e.stage == "drive" else None for e, theta in terms]
    q = view.q + sum((item[0] for item in drive if item), torch.zeros_like(view.q))
    at_joints = view.at(q=q)
    geometry = view.q.new_zeros(1, slots)
    shaped = [differentiate(e, theta, at_joints) if e.stage == "geometry" else None for e, theta in terms]
    geometry = geometry + sum((item[0] for item in shaped if item), torch.zeros_like(geometry))
    p, by_joint, by_slot = sensitivity(view.mechanism, q, view.mounted(geometry))
    moving = _by_input(links, "geometry", q, lambda x: view.at(q=x))
    if moving is not None:
        by_joint = by_joint + by_slot @ moving
    at_tool = at_joints.at(p=p)
    carried = [differentiate(e, theta, at_tool) if e.stage == "structure" else None for e, theta in terms]
    after = _by_input(links, "structure", p, lambda x: at_joints.at(p=x))
    raised = _by_input(links, "structure", q, lambda x: at_tool.at(q=x))
    actual = p + sum((item[0] for item in carried if item), torch.zeros_like(p))
    at_target = at_joints.at(p=actual)
    read = [differentiate(e, theta, at_target) if e.stage == "metrology" else None for e, theta in terms]
    seen = _by_input(links, "metrology", actual, lambda x: at_joints.at(p=x))
    reading = actual + sum((item[0] for item in read if item), torch.zeros_like(p))
    blocks = []
    for d, g, s, m in zip(drive, shaped, carried, read, strict=True):
        block = by_joint @ d[1] if d else by_slot @ g[1] if g else s[1] if s else m[1] if m else None
        assert block is not None
        if after is not None and (d or g):
            block = block + after @ block
        if raised is not None and d:
            block = block + raised @ d[1]
        if seen is not None and not m:
            block = block + seen @ block
        blocks.append(block)
    jacobian = torch.cat(blocks, dim=-1) if blocks else reading.new_zeros(view.rows, 3, 0)
    by_mount = by_slot[..., -3:]
    for further in (after, seen):
        by_mount = by_mount if further is None else by_mount + further @ by_mount
    return Linearised(Prediction(q, geometry, actual, reading), jacobian, by_mount)


def trace(terms: Shifts, view: View) -> Chain:
    """Follow the chain and keep what each stage sees.

    Args:
        terms: effects with their flat parameters.
        view: n rows.

    Returns:
        The chain.
    """
    at = predict(terms, view)
    at_joints = view.at(q=at.q)
    _, by_joint, by_slot = sensitivity(view.mechanism, at.q, view.mounted(at.geometry))
    return Chain(view, at_joints, at_joints.at(p=at.p), by_joint, by_slot, at.reading)


def signature(chain: Chain, effect: Effect, shape: Mapping[str, Tensor]) -> Tensor:
    """Reading shift per unit of each linear parameter of an effect that is not in the model yet.

    Args:
        chain: the present model's chain.
        effect: the candidate.
        shape: its searched and given parameters.

    Returns:
        (n, 3, P) mm per unit.
    """
    if effect.stage == "drive":
        return chain.by_joint @ effect.basis(chain.at_drive, shape)
    if effect.stage == "geometry":
        return chain.by_slot @ effect.basis(chain.at_joints, shape)
    return effect.basis(chain.at_tool, shape)


def differentiate(effect: Effect, theta: Tensor, view: View) -> tuple[Tensor, Tensor]:
    """Shift of one effect and its derivative by its own parameters.

    Args:
        effect: the effect.
        theta: all its parameters, flat, (P,).
        view: n rows at the stage's input.

    Returns:
        Shift (n, out) and derivative (n, out, P); zero columns for 'given' parameters.
    """
    if type(effect).shift is not Effect.shift:
        return effect.shift(theta, view), torch.func.jacfwd(lambda x: effect.shift(x, view))(theta)
    linear = linear_size(effect, view.joints)
    shape = shape_of(effect, theta, view.joints)
    basis = effect.basis(view, shape)
    columns = [basis]
    for parameter in effect.parameters:
        if parameter.role == "linear":
            continue
        size = parameter.size(view.joints)
        if parameter.role == "given":
            columns.append(basis.new_zeros(*basis.shape[:2], size))
            continue

        def along(values: Tensor, stem: str = parameter.stem) -> Tensor:
            return effect.basis(view, {**shape, stem: values}) @ theta[:linear]

        columns.append(torch.func.jacfwd(along)(shape[parameter.stem]))
    return basis @ theta[:linear], torch.cat(columns, dim=-1)


def _total(terms: Shifts, stage: str, view: View, like: Tensor) -> Tensor:
    shifts = [effect.shift(theta, view) for effect, theta in terms if effect.stage == stage]
    return sum(shifts, torch.zeros_like(like))


def _by_input(terms: Shifts, stage: str, x: Tensor, see: Callable[[Tensor], View]) -> Tensor | None:
    """Derivative of a stage's total shift by its input, row by row, (n, out, m); None where the stage is empty."""
    here = [(effect, theta) for effect, theta in terms if effect.stage == stage]
    if not here or all(not bool(theta.any()) for _, theta in here):
        return None

    def total(value: Tensor) -> Tensor:
        return torch.stack([effect.shift(theta, see(value)) for effect, theta in here]).sum(dim=0)

    count = x.shape[1]
    directions = torch.eye(count, dtype=x.dtype)[:, None, :].expand(count, *x.shape)
    columns = torch.func.vmap(lambda t: torch.func.jvp(total, (x,), (t,))[1])(directions)
    return columns.permute(1, 2, 0)


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
        raise ModelError(f"'{effect.name}' and the dtheta of '{other}' are one thing", fix="keep one of them")


def _read_term(entry: EffectEntry, effect: Effect, model: Model) -> Term:
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
        if given is None and parameter.role != "linear":
            raise ModelError(f"parameter '{name}' is missing", fix="add it, or leave all parameters out and fit")
        values.append(_spread(given.value if given else 0.0, size, name))
        stds.append(_spread(torch.nan if given is None or given.std is None else given.std, size, name))
        measured.append(_spread(True if given is None or given.measured is None else given.measured, size, name).bool())
    fixed = frozenset(p.stem for name, p in specs.items() if name in entry.parameters and entry.parameters[name].fixed)
    return Term(effect, torch.cat(values), torch.cat(stds), torch.cat(measured), fixed)


def _spread(value: object, size: int, name: str) -> Tensor:
    tensor = torch.as_tensor(value, dtype=torch.float64).reshape(-1)
    if len(tensor) not in (1, size):
        raise ModelError(f"parameter '{name}' has {len(tensor)} values", fix=f"give one, or {size}")
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
    return EffectEntry(name=effect.name, label=effect.label, parameters=entries)


def _known(values: Tensor) -> bool:
    return bool(torch.isfinite(values).all())


def _plain(values: Tensor) -> float | tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    return numbers[0] if len(numbers) == 1 else numbers


def _plain_flags(values: Tensor) -> bool | tuple[bool, ...]:
    flags = tuple(bool(value) for value in values)
    return flags[0] if len(flags) == 1 else flags
