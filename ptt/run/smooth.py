"""Smooth ways: where joints turn between rows that lie on a circle, a helix or any way without corners."""

from dataclasses import replace

from ptt.mechanisms.workspace import translation_rank
from ptt.run.pace import joint_speeds
from ptt.run.problem import Problem
from ptt.run.travel import on_the_way, read_travel

LEAST_READINGS = 3  # at which a joint arrives otherwise: fewer could be gross errors
MOSTLY = 0.5  # of the readings that are passed without a corner: of poses at random it is one in ten
LIKELIER = 5.0  # nats by which a smooth way has to do better than what the machine file says, for names and for fits
SMOOTHLY = (
    "joints are taken to reverse between these rows where a smooth path through them does, as on a circle: "
    '`moves = "smooth"` in the machine file'
)


def smoothly(problem: Problem) -> Problem | None:
    """The same readings with joints that turn between rows where a smooth way through the rows does.

    Args:
        problem: n rows.

    Returns:
        The problem, whose machine file says so; None where the file says something else than that sliders run evenly
        from row to row, or where few rows are passed without a corner, or hardly a joint arrives from another side.
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
    if view.velocity.any():  # else it stood at each row
        starts, rank = view.starts.numpy(), translation_rank(view.mechanism)
        velocity, paces = joint_speeds(
            view.q, view.p, view.jacobian, starts, problem.table, rank, straight=False, smooth=True
        )
        seen = replace(seen, velocity=velocity, paces=paces)
    return replace(problem, file=replace(problem.file, machine=machine), view=seen)
