"""Normal equations of one run for the machine's own parameters, in a form that can be added over runs."""

from dataclasses import dataclass

import numpy as np

from ptt.effects.dated import is_dated
from ptt.effects.parameter import Parameter
from ptt.fitting.solve import FitResult
from ptt.fleet.seen import seen_by
from ptt.fleet.task import Testimony
from ptt.model.model import parameter_names


def told_by(fitted: FitResult) -> Testimony:
    """Normal equations of a fit for the machine's own parameters; those of set-up, frames and mounts are eliminated.

    The fit's normal equations (G + W) u = g hold the rows' part G and a prior W. The prior is taken out, and unknowns
    that are not the machine's are eliminated (Schur complement), so that runs with different set-ups can be added.
    Shape parameters (a period, a settling length) count as known.

    Args:
        fitted: a fit of one run.

    Returns:
        Information and score of the machine's p linear parameters.
    """
    layout = fitted.layout
    named = _own_values(fitted)
    shape = layout.searched
    own, rest = np.flatnonzero(named.own & ~shape), np.flatnonzero(~named.own & ~shape)
    gram, amplitudes = fitted.information, np.where(shape, 0.0, fitted.unknowns)
    # The rows' own gradient at the fit is what the prior holds against. What a curve's definition keeps near zero is in
    # the information as a reading of zero, which has no score.
    score = (gram - np.diag(layout.held.astype(float))) @ amplitudes + fitted.prior.pull(fitted.unknowns)
    follow = np.linalg.pinv(gram[np.ix_(rest, rest)], hermitian=True) @ gram[np.ix_(rest, own)]
    information = gram[np.ix_(own, own)] - gram[np.ix_(own, rest)] @ follow
    information = 0.5 * (information + information.T) / fitted.scatter
    usual = layout.scale[own]
    return Testimony(
        named.names, named.labels, named.units, usual, information,
        (score[own] - follow.T @ score[rest]) / fitted.scatter, fitted.values[own], _std(information) * usual,
    )  # fmt: skip


def _std(information: np.ndarray) -> np.ndarray:
    """Standard errors of the values in usual sizes, (p,); NaN for values that the rows do not measure."""
    seen = seen_by(information)
    return np.where(seen.told, seen.marginal_std, np.nan)


@dataclass(frozen=True)
class OwnValues:
    """Which of a fit's unknowns are the machine's own, and names of the p linear ones among them.

    Attributes:
        own: whether each unknown is the machine's own (of an effect that does not belong to one run), (u,) bool.
        names: 'effect parameter' of each linear one.
        labels: the same for a person.
        units: of each, as in the machine file.
    """

    own: np.ndarray
    names: tuple[str, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]


def _own_values(fitted: FitResult) -> OwnValues:
    layout, kind, joints = fitted.layout, fitted.model.file.machine.kind, fitted.model.joints
    own = np.zeros(len(layout.owner), dtype=bool)
    names, labels, units = list[str](), list[str](), list[str]()
    for index, (term, free) in enumerate(zip(layout.terms, layout.free, strict=True)):
        if is_dated(term.effect):
            continue
        own |= layout.owner == index
        noun = term.effect.arm_noun if kind == "serial" else term.effect.noun
        local = iter(zip(parameter_names(term.effect, kind, joints), free, strict=True))
        for parameter in (declared.on(kind) for declared in term.effect.parameters):
            for _ in range(parameter.size(joints)):
                name, open_ = next(local)
                if open_ and parameter.role == "linear":
                    names.append(f"{term.effect.key} {name}")
                    labels.append(f"{term.effect.key}: {_label(parameter, name, noun)}")
                    units.append(parameter.unit)
    return OwnValues(own, tuple(names), tuple(labels), tuple(units))


def _label(parameter: Parameter, name: str, noun: str) -> str:
    """The name of one value for a person, as in 'gap of slider 2'."""
    number, stem = name.removeprefix(parameter.name).strip(), parameter.stem.replace("_", " ")
    return f"{stem} of {noun} {number}" if parameter.per_joint else f"{stem} {number}".strip()
