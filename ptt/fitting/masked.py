"""What a run shows about effects that a fitted model does not have, and how the model would have absorbed them."""

from dataclasses import dataclass

import numpy as np

from ptt.effects import Effect, library
from ptt.fitting.factor import inverse
from ptt.fitting.linear import linear_columns
from ptt.fitting.packed import pack, unpack
from ptt.fitting.result import FitResult
from ptt.machine_schema import MaskedSpec
from ptt.model.model import rival
from ptt.run.problem import Problem

MOST_VALUES = 12  # values up to which an effect is kept: curves would outgrow the file
MASKED_ROWS = 10_000  # rows beyond which the columns of all of the library's effects at once take too much memory
# root of the information below which a direction says nothing: even 30 usual sizes would be one sigma
LEAST_ROOT = 0.03


@dataclass(frozen=True)
class Masked:
    """Effects that a model does not have, their p values in usual sizes and concatenated.

    Attributes:
        keys: of the effects.
        absorbed: decrease of the model's w values per unit of theirs, (w, p).
        seen: root of their information beside the model, (p, p): information = seen.T @ seen.
        said: (p,): the run's equations for them are seen @ values = said, with unit errors.
    """

    keys: tuple[str, ...]
    absorbed: np.ndarray
    seen: np.ndarray
    said: np.ndarray

    def spec(self) -> MaskedSpec:
        """As a machine file keeps it."""
        flat = np.concatenate([self.absorbed.ravel(), self.seen.ravel(), self.said])
        return MaskedSpec(of=self.keys, told=pack(flat))


def read_masked(spec: MaskedSpec, width: int) -> Masked | None:
    """From a machine file.

    Args:
        spec: as kept.
        width: number of the model's values, w.

    Returns:
        The effects; None where it cannot be read.
    """
    flat = unpack(spec.told)
    if flat is None:
        return None
    p = round((np.sqrt((width + 1.0) ** 2 + 4.0 * len(flat)) - width - 1.0) / 2.0)
    if p * (width + p + 1) != len(flat):
        return None
    absorbed, seen, said = np.split(flat, [width * p, width * p + p * p])
    return Masked(spec.of, absorbed.reshape(width, p), seen.reshape(p, p), said)


def masked_effects(fitted: FitResult, problem: Problem) -> Masked | None:
    """What a run shows about library effects that a model does not have and that the run could test.

    Args:
        fitted: the model's fit.
        problem: its run.

    Returns:
        The effects; None for a long run, or where there are none.
    """
    candidates = [] if problem.table.rows > MASKED_ROWS or not len(fitted.unknowns) else _candidates(fitted, problem)
    if not candidates:
        return None
    linear = linear_columns(fitted, problem.masked(fitted.outliers), candidates, fitted.noise)
    gram, side, _, _ = linear.total()
    layout, own = fitted.layout, fitted.layout.owner >= 0
    simple, more = np.arange(len(layout.scale)), np.concatenate([trial.columns for trial in linear.trials])
    prior, wide = fitted.prior, fitted.prior.design_effect * fitted.scatter
    solved = inverse(gram[np.ix_(simple, simple)] + np.diag(wide / np.maximum(prior.variance, fitted.sizes**2)))
    left = side - gram[:, simple[own]] @ fitted.unknowns[own]
    cross = gram[np.ix_(simple, more)]
    absorbed = solved @ cross
    eigenvalues, vectors = np.linalg.eigh((gram[np.ix_(more, more)] - cross.T @ absorbed) / wide)
    root = np.sqrt(np.maximum(eigenvalues, 0.0))
    score = vectors.T @ (left[more] - absorbed.T @ left[simple]) / wide
    said = np.where(root > LEAST_ROOT, score / np.maximum(root, LEAST_ROOT), 0.0)
    keys = tuple(trial.effect.key for trial in linear.trials)
    return Masked(keys, absorbed[: int(own.sum())], root[:, None] * vectors.T, said)


def _candidates(fitted: FitResult, problem: Problem) -> list[Effect]:
    kind, joints, keys = problem.file.machine.kind, problem.view.joints, fitted.model.keys
    found = []
    for name, cls in library().items():
        effect = cls()
        size = sum(parameter.size(joints) for parameter in effect.parameters)
        if (
            kind not in cls.mechanisms
            or name in keys
            or cls.of_run
            or effect.stage == "metrology"
            or size > MOST_VALUES
        ):
            continue
        if _has_to_be_shaped(effect) or rival(effect, keys):
            continue
        if not effect.needs(problem.view):
            found.append(effect)
    return found


def _has_to_be_shaped(effect: Effect) -> bool:
    """Whether its columns depend on a shape; a nonlinear effect's are its tangent at zero, without usual shapes."""
    shapes = [parameter for parameter in effect.parameters if parameter.role != "linear"]
    linear = type(effect).shift is Effect.shift
    return any(linear or parameter.default is None for parameter in shapes)
