"""Loads, temperatures and speeds of a run that the model's own run did not have."""

from ptt.again.prior import Prior
from ptt.run.corners import shows_feed
from ptt.run.problem import Problem
from ptt.run.ranges import LEAST_BEYOND, QUANTITIES, ranges_of, ranges_of_model

# Ratio of the scatter of one reading to all that the model left of its own run, from which something repeats worse: two
# estimates of one noise from 50 readings each differ by a twelfth, as one standard error
LOUDER = 2.0


def context_notes(prior: Prior, problem: Problem) -> tuple[str, ...]:
    """Contexts to which the model is extrapolated in this run.

    Args:
        prior: the solved model.
        problem: the run.

    Returns:
        One line for each context outside the range of the model's run, or whose range then is not known.
    """
    recorded = ranges_of_model(prior.model.file)
    then, told = recorded or {}, recorded is not None
    needs = {context for term in prior.model.terms for context in term.effect.requires}
    lines = []
    for column, (low, high) in ranges_of(problem).items():
        context, unit = QUANTITIES[column]
        if column == "time_s" or (column == "feed_mm_s" and not shows_feed(problem.table)):
            continue  # by the clock, which tells little by itself
        has = f"the model has {'an' if context in needs else 'no'} effect that depends on it"
        now = f"{low:.3g} to {high:.3g} {unit}" if high - low > LEAST_BEYOND[column] else f"{high:.3g} {unit}"
        if column in then:
            beyond = max(then[column][0] - low, high - then[column][1])
            if beyond > LEAST_BEYOND[column]:
                old = f"{then[column][0]:.3g} to {then[column][1]:.3g}"
                lines.append(f"{context} goes beyond the model's run ({now}; then {old}), and {has}")
        elif column != "feed_mm_s" and (told or context not in needs) and _matters(column, low, high, problem):
            which = "the model's run did not record it" if told else "nothing says what it was in the model's run"
            lines.append(f"{context} is {now} in this run; {which}, and {has}")
    return tuple(lines)


def _matters(column: str, low: float, high: float, problem: Problem) -> bool:
    usual = problem.file.machine.reference_temp_c if column == "temp_c" else 0.0
    return max(abs(low - usual), abs(high - usual)) > LEAST_BEYOND[column]


def scatter_notes(prior: Prior, noise_um: float) -> tuple[str, ...]:
    """A note where readings scatter far more than they did in the run that the model was fitted to.

    What repeats worse than before hides every change that is smaller, so that nothing seems to have changed.

    Args:
        prior: the solved model.
        noise_um: noise floor of the new run, um.

    Returns:
        One line; none where the model's run left as much, or its history does not tell.
    """
    then = 0.0 if prior.last is None else float(prior.last.heldout_after_um["total"])
    if not 0.0 < LOUDER * then < noise_um:
        return ()
    now = f"the noise of this run is {noise_um:.1f} um, where the model left {then:.1f} um of its own run in all"
    return (
        f"{now}: look for what has come loose, in the machine, its tool, or tracker and reflector, unless this is "
        "another tracker; smaller changes do not show",
    )
