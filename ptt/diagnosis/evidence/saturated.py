"""The noise floor that is left where every effect is in the model at once."""

from collections.abc import Mapping

import numpy as np

from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.noise_level import LEAST_FREEDOM, noise_left, starting_noise
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.effects import Library
from ptt.errors import TooFewError
from ptt.fitting.result import sound_rows
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem

SATURATED_ROUNDS = 3  # rounds of the saturated model, each whitened with the noise that the one before left
# Columns per coordinate beyond which the saturated model takes minutes to say what a search says
MOST_COLUMNS_RATIO = 4.0
TOO_MANY_SHAPES = 12  # shapes from which an effect is left out of the saturated model
Variances = Mapping[str, np.ndarray]  # name of an atom -> its learned prior variances, in usual sizes squared


def saturated_floor(model: Model, problem: Problem, known: Library) -> Noise:
    """The noise floor: the problem's own, else what the saturated model leaves, which has all effects and blocks.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.

    Returns:
        The noise.

    Raises:
        TableError: nothing tells the noise, or the saturated model has far more values than there are coordinates.
    """
    if problem.noise is not None:
        return problem.noise
    noise, variances = _saturated(model, problem, known, starting_noise(problem)[0], {})
    if noise.freedom < LEAST_FREEDOM:
        raise too_few(problem)
    for _ in range(SATURATED_ROUNDS - 1):
        finer, variances = _saturated(model, problem, known, noise, variances)
        if finer.freedom < LEAST_FREEDOM:  # each round sees more of the curves, until they explain everything
            break
        noise = finer
    return noise


def too_few(problem: Problem) -> TooFewError:
    """The error for readings that do not tell their noise."""
    return TooFewError(
        f"{int(problem.used.sum())} readings without repeats do not tell the noise",
        where=problem.table.source,
        fix="give sigma_mm under [tracker] in the machine file, or measure more rows",
    )


def _saturated(
    model: Model, problem: Problem, known: Library, noise: Noise, known_variances: Variances
) -> tuple[Noise, Variances]:
    """The noise that the saturated model leaves, and the prior variances that were learned for its atoms.

    Times the white variance they do not depend on the assumed noise, so the next round starts from them.
    """
    fitted = fit(model, problem, noise=noise)
    candidates, _ = present_candidates(fitted, problem, known)
    short = [effect for effect in candidates if len(effect.search(problem.view)) < TOO_MANY_SHAPES]
    rows = sound_rows(problem, fitted)
    system = build_row_system(fitted, problem, short, noise, 0.0, rows)
    one_each = {atom.name: key for key, atom in system.atoms.items()}
    if sum(len(system.atoms[key].columns) for key in one_each.values()) > MOST_COLUMNS_RATIO * 3.0 * rows.sum():
        raise too_few(problem)
    start = {key: known_variances[name] for name, key in one_each.items() if name in known_variances}
    state = Scorer(system, model.keys).score(tuple(one_each.values()), WHITE, start)
    learned = {name: state.variances[key] * state.posterior.phi for name, key in one_each.items()}
    return noise_left(system, state), learned
