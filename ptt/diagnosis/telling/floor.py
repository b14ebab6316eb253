"""The noise floor that errors are compared with: the stated one, else what a saturated model or a search leaves."""

from ptt.diagnosis.evidence.noise_level import LEAST_FREEDOM, noise_left
from ptt.diagnosis.evidence.saturated import saturated_floor, too_few
from ptt.diagnosis.search.find import find
from ptt.diagnosis.telling.enough import LEAST_READINGS
from ptt.diagnosis.telling.given import hold_own_effects
from ptt.effects import Library
from ptt.errors import TableError
from ptt.fitting.opening import opening_rows
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem


def noise_floor(model: Model, problem: Problem, known: Library) -> Noise:
    """The noise floor for a comparison or a fit: the problem's own, else what the saturated model leaves.

    With few rows the saturated model has far more values than there are coordinates; then it is what the explanation of
    a search leaves.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.

    Returns:
        The noise.

    Raises:
        TableError: nothing tells the noise.
    """
    try:
        return saturated_floor(model, problem, known)
    except TableError:
        if problem.used.sum() < LEAST_READINGS:
            raise
    found = find(hold_own_effects(model), problem.masked(opening_rows(problem)), known, lambda what: None)
    noise = noise_left(found.system, found.state)
    if noise.freedom < LEAST_FREEDOM:
        raise too_few(problem)
    return noise
