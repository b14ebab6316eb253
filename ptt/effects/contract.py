"""The contract that every effect keeps, the library's and a user's own: one function for each check."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from torch import Tensor

from ptt.effects.base import CONTEXTS, Effect
from ptt.effects.bench import bare
from ptt.effects.case import Case, Differentiate, make_case
from ptt.effects.layout import flatten, linear_size, sizes
from ptt.effects.phrases import compose
from ptt.mechanisms.derivatives import by_input
from ptt.run.view import PER_ROW

UNITS = ("1", "mm", "rad", "s", "K", "kg", "N", "Nmm")
NOMINAL = 1e-12  # mm or rad: a shift below is zero but for rounding
ALIKE = 1e-12  # relative difference of batch and loop that the order of summation may cause
CLOSE = 1e-5  # largest difference of exact derivative and central difference, as a share of the column's largest entry


@dataclass(frozen=True)
class CheckOutcome:
    """What one check of one effect on one family of mechanisms came to.

    Attributes:
        check: what was checked, in words.
        kind: mechanism family.
        broken: what is broken; '' where the check passed.
    """

    check: str
    kind: str
    broken: str = ""

    @property
    def passed(self) -> bool:
        """Whether the effect keeps this part of the contract."""
        return not self.broken


def check_effect(effect: Effect, differentiate: Differentiate) -> tuple[CheckOutcome, ...]:
    """Check an effect against the whole contract, on every mechanism family that it applies to.

    Args:
        effect: the effect.
        differentiate: `ptt.model.chain.differentiate`.

    Returns:
        One outcome for each check and family.
    """
    findings = []
    for kind in effect.mechanisms:
        broken = _attempt(partial(check_parameters, effect, kind))
        findings.append(CheckOutcome("units stated", kind, broken))
        if broken:
            continue
        try:
            case = make_case(effect, kind, differentiate)
        except Exception as error:
            findings.append(CheckOutcome("search offers its shape parameters", kind, _said(error)))
            continue
        findings += [CheckOutcome(name, kind, _attempt(partial(check, case))) for name, check in CHECKS.items()]
    return tuple(findings)


def check_parameters(effect: Effect, kind: str) -> str:
    """Every parameter has a known unit, a meaning, a usual size and sound bounds; names differ; needs are known."""
    names = [parameter.on(kind).name for parameter in effect.parameters]
    if not effect.name or not effect.parameters:
        return "no name, or no parameters"
    if len(set(names)) < len(names):
        return f"two parameters are called the same: {', '.join(names)}"
    for parameter in (p.on(kind) for p in effect.parameters):
        unknown = [part for part in re.split(r"[/ ]", parameter.unit) if part not in UNITS]
        if unknown:
            return f"unit '{parameter.unit}' of {parameter.stem} is not made of {', '.join(UNITS)}"
        if not parameter.meaning.strip():
            return f"{parameter.stem} has no meaning"
        if not (np.isfinite(parameter.usual) and parameter.usual > 0.0):
            return f"usual size of {parameter.stem} is {parameter.usual:g}, not positive"
        if not parameter.lower < parameter.upper:
            return f"bounds of {parameter.stem} are {parameter.lower:g} and {parameter.upper:g}"
    amplitudes = [parameter.fine for parameter in effect.parameters if parameter.role == "linear"]
    if amplitudes != sorted(amplitudes):
        return "fine detail is declared before other amplitudes"
    nameless = [phrase.stem for phrase in effect.phrases if phrase.stem not in {p.stem for p in effect.parameters}]
    if nameless:
        return f"a phrase says '{nameless[0]}', which is not a parameter"
    strange = [name for name in effect.requires if name not in CONTEXTS]
    return f"requires '{strange[0]}', which is none of {', '.join(CONTEXTS)}" if strange else ""


def check_shape(case: Case) -> str:
    """The basis is (n, out, P) and the shift (n, out), both finite and float64."""
    out = {"drive": case.view.joints, "geometry": len(case.view.mechanism.slots)}.get(case.effect.stage, 3)
    linear = linear_size(case.effect, case.view.joints)
    basis, shift = case.effect.basis(case.view, case.shape), case.shift()
    for name, value, wanted in (
        ("basis", basis, (case.view.rows, out, linear)),
        ("shift", shift, (case.view.rows, out)),
    ):
        if tuple(value.shape) != wanted:
            return f"{name} has shape {tuple(value.shape)}, not {wanted}"
        if value.dtype != torch.float64:
            return f"{name} is {value.dtype}, not float64"
        if not bool(torch.isfinite(value).all()):
            return f"{name} is not finite in {int((~torch.isfinite(value)).sum())} places"
    return ""


def check_zero(case: Case) -> str:
    """Amplitudes of zero mean exactly nominal, whatever the searched parameters are."""
    for shape in case.effect.search(case.view):
        shift = case.effect.shift(flatten(case.effect, shape, case.view.joints), case.view)
        if not float(shift.abs().max()) <= NOMINAL:
            return f"shifts by {float(shift.abs().max()):g} with all amplitudes zero"
    return ""


def check_acts(case: Case) -> str:
    """Each amplitude does something on a run in which everything varies; an arm may have an idle joint."""
    moved = case.effect.basis(case.effect.over_its_range(case.view), case.shape).abs().amax(dim=(0, 1)) > 0.0
    if bool(moved.all()) or (case.kind == "serial" and bool(moved.any())):
        return ""
    return f"amplitude {int((~moved).nonzero()[0, 0]) + 1} shifts nothing"


def check_rows(case: Case) -> str:
    """Single rows give what the batch gives; for effects that remember the travel, single runs do."""
    whole = case.shift()
    if case.effect.reverses:
        parts = [case.view.run == run for run in case.view.run.unique()]
    else:
        parts = [torch.arange(case.view.rows) == row for row in range(0, case.view.rows, 11)]
    for rows in parts:
        alone = case.shift(case.view.of_rows(rows))
        gap = float((alone - whole[rows]).abs().max())
        if not gap <= ALIKE * (1.0 + float(whole.abs().max())):
            where = f"run {int(case.view.run[rows][0])}" if case.effect.reverses else f"row {int(rows.nonzero()[0, 0])}"
            hint = "" if case.effect.reverses else " (set reverses = True if it remembers the travel)"
            return f"{where} on its own differs from the batch by {gap:g}{hint}"
    return ""


def check_derivative(case: Case) -> str:
    """The derivative by the parameters equals central differences, at usual size; also in the last of its shapes."""
    linear = linear_size(case.effect, case.view.joints)
    last = flatten(case.effect, tuple(case.effect.search(case.view))[-1], case.view.joints)
    last[:linear] = case.theta[:linear]
    return _check_derivative(case, case.theta) or _check_derivative(case, last)


def _check_derivative(case: Case, theta: Tensor) -> str:
    _, exact = case.differentiate(case.effect, theta, case.view)
    start = 0
    for parameter, size in zip(case.effect.parameters, sizes(case.effect, case.view.joints), strict=True):
        plain = parameter.default is not None and bool((theta[start : start + size] == parameter.default).all())
        held = parameter.role == "given" or plain  # no fit changes a shape at its default
        for index in () if held else range(start, start + size):
            step = torch.zeros_like(theta)
            step[index] = 1e-4 * parameter.on(case.kind).usual
            ends = [case.effect.shift(theta + sign * step, case.view) for sign in (1.0, -1.0)]
            broken = _compare(exact[..., index], ends, float(step[index]))
            if broken:
                return f"derivative by {parameter.stem} {index - start + 1}: {broken}"
        start += size
    return ""


def check_basis(case: Case) -> str:
    """The basis is what the shift tends to when the amplitudes are small."""
    small = flatten(case.effect, case.shape, case.view.joints)
    linear = linear_size(case.effect, case.view.joints)
    small[:linear] = 1e-3 * case.theta[:linear]
    shift, straight = case.effect.shift(small, case.view), case.effect.basis(case.view, case.shape) @ small[:linear]
    gap, scale = float((shift - straight).abs().max()), float(straight.abs().max())
    return (
        ""
        if gap <= 1e-2 * scale + NOMINAL
        else f"basis and shift part by {gap / scale:.0%} at a thousandth of usual size"
    )


def check_input(case: Case) -> str:
    """The derivative by the stage's input, which the model takes by autograd, equals central differences."""
    name = {"geometry": "q", "structure": "p", "metrology": "p"}.get(case.effect.stage)
    if name is None:
        return ""
    given = getattr(case.view, name)
    middle = given.mean(dim=0)
    x = middle + 0.9 * (given - middle)  # off the ends of a covered range, where curves have kinks
    h = 1e-3 if name == "p" or case.kind == "three-ptt" else 1e-6
    directions = torch.eye(x.shape[1], dtype=x.dtype)[:, None].expand(-1, *x.shape)

    def shift(value: Tensor) -> Tensor:
        return case.shift(case.view.at(**{name: value}))

    def differentiable(value: Tensor) -> Tensor:
        return case.effect.differentiable_shift(case.theta, case.view.at(**{name: value}))

    if float((differentiable(x) - shift(x)).abs().max()) > ALIKE:
        return "differentiable_shift is not the shift"
    exact = by_input(differentiable, x).permute(2, 0, 1)
    for column, direction in zip(exact, directions, strict=True):
        broken = _compare(column, [shift(x + h * direction), shift(x - h * direction)], h)
        if broken:
            return f"derivative by {name}: {broken}; use torch functions of view.{name} only"
    return ""


def check_pure(case: Case) -> str:
    """Calls change neither view nor parameters, and give the same the second time."""
    fields = [name for name in (*PER_ROW, "home", "reflector", "growth") if getattr(case.view, name) is not None]
    before = {name: getattr(case.view, name).clone() for name in fields}
    theta = case.theta.clone()
    own = replace(case.view, **{name: value.clone() for name, value in before.items()})
    first = case.shift(own).clone()
    case.effect.basis(own, case.shape)
    case.effect.search(own)
    changed = [name for name in fields if not torch.equal(getattr(own, name), before[name])]
    if changed:
        return f"changes view.{changed[0]}"
    if not torch.equal(theta, case.theta):
        return "changes its parameters"
    return "" if torch.equal(case.shift(own), first) else "answers differently the second time"


def check_words(case: Case) -> str:
    """An effect with phrases yields words, and other words for the opposite sign."""
    unknown = torch.full_like(case.theta, torch.nan)
    linear, other = linear_size(case.effect, case.view.joints), case.theta.clone()
    other[:linear] = -other[:linear]
    first, second = (compose(case.effect.say(theta, unknown, case.view), "joint") for theta in (case.theta, other))
    if not first and not case.effect.phrases:
        return ""
    return "" if first and first != second else f"says '{first}' of either sign"


def check_needs(case: Case) -> str:
    """`needs` accepts the sample run, in which everything varies, and refuses one without a context it requires."""
    lacking = case.effect.needs(case.view)
    if lacking is not None:
        return f"refuses a run in which everything varies: {lacking}"
    if case.effect.requires and case.effect.needs(bare(case.view)) is None:
        return f"accepts a run without {', '.join(case.effect.requires)}"
    return ""


CHECKS: dict[str, Callable[[Case], str]] = {
    "shapes and numbers": check_shape,
    "zero is nominal": check_zero,
    "amplitudes act": check_acts,
    "batch equals loop": check_rows,
    "derivative by parameters": check_derivative,
    "basis is the small limit": check_basis,
    "derivative by input": check_input,
    "nothing is changed": check_pure,
    "needs of the data": check_needs,
    "words have a side": check_words,
}


def _compare(exact: Tensor, ends: list[Tensor], step: float) -> str:
    """An exact derivative against the central difference of two shifts, at + and - a step."""
    numeric = (ends[0] - ends[1]) / (2.0 * step)
    gap, scale = float((exact - numeric).abs().max()), float(numeric.abs().max())
    rounding = 1e-12 / step
    return "" if gap <= CLOSE * scale + rounding else f"off by {gap:g} where the largest is {scale:g}"


def _attempt(check: Callable[[], str]) -> str:
    """What a check finds; one that raises has found the exception."""
    try:
        return check()
    except Exception as error:
        return _said(error)


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"[:300]
