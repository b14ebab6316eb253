"""Smooth paths: joints that reverse between rows on a circle, a helix or any path without corners."""

from dataclasses import replace

from ptt.mechanisms.workspace import translation_rank
from ptt.run.driven import every_pace
from ptt.run.pace import joint_speeds
from ptt.run.problem import Problem
from ptt.run.travel import on_the_way, read_travel

LEAST_READINGS = 3  # readings with another direction of arrival: fewer could be gross errors
MOSTLY = 0.5  # share of readings passed without a corner: of poses at random it is one in ten
LIKELIER = 5.0  # nats of evidence by which a smooth path has to do better than what the machine file says
SMOOTHLY = (
    "joints are taken to reverse between these rows where a smooth path through them does, as on a circle: "
    '`moves = "smooth"` in the machine file'
)


def smoothly(problem: Problem) -> Problem | None:
    """The same readings with joints that reverse between rows where a smooth path through the rows does.

    Args:
        problem: n rows.

    Returns:
        The problem, with `moves = "smooth"` in its machine file; None where the file does not have the default
        `"sliders"`, where few rows are passed without a corner, or where hardly a direction of arrival changes.
    """
    if problem.file.machine.moves != "sliders":
        return None
    view = problem.view
    passed, _ = on_the_way(view.p.numpy(), view.starts.numpy())
    if passed[problem.used].mean() < MOSTLY:
        return None
    travel = read_travel(view.mechanism, view.q, view.p, problem.table, straight=False, smooth=True)
    other = (travel.direction != view.direction).any(dim=1).numpy() & problem.used
    if other.sum() < LEAST_READINGS:
        return None
    machine = problem.file.machine.model_copy(update={"moves": "smooth"})
    varies = view.varies | {"direction"} if travel.two_sided else view.varies - {"direction"}
    seen = replace(view, direction=travel.direction, turning_point=travel.turning_point, varies=varies)
    if view.velocity.any() or view.fed is not None:  # else it stood at each row
        starts, rank = view.starts.numpy(), translation_rank(view.mechanism)
        velocity, paces = joint_speeds(
            view.q, view.p, view.jacobian, starts, problem.table, rank, straight=False, smooth=True
        )
        if view.fed is None:
            seen = replace(seen, velocity=velocity, paces=paces)
        elif paces is not None:
            seen = replace(seen, fed=every_pace(velocity, paces))
    return replace(problem, file=replace(problem.file, machine=machine), view=seen)
