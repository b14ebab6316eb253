"""A further run over the region of one that showed something unknown."""

from dataclasses import replace

import numpy as np

from ptt.errors import WorkspaceError
from ptt.model.model import Model
from ptt.plan.first_run import LEAST_ROWS, ROWS, plan_first_run
from ptt.plan.space import boxed, build_space, narrow_space
from ptt.run.problem import Problem
from ptt.run.table import Table
from ptt.run.target_frame import kept_frame

MOST_LOADS = 3  # of those of the run: the ends tell a line, the middle whether it is one


def plan_again(model: Model, problem: Problem) -> Table | None:
    """Plan poses in random order, each joint arriving both ways, where the tool and the joints of a run went.

    A path that was driven once tells variables apart that run together on it only by chance; poses in random order part
    them.

    Args:
        model: with what was found.
        problem: the run.

    Returns:
        Targets in driving order, in the frame that the run states its own in; None where the run never left a place.
    """
    model = replace(model, file=replace(model.file, targets=kept_frame(problem.file.targets, problem.stated_in)))
    driven, seen, loads = problem.view.q[problem.used], problem.view.p[problem.used], _loads(problem)
    try:
        space = narrow_space(build_space(problem.file), driven.amin(dim=0), driven.amax(dim=0))
        space = boxed(space, seen.amin(dim=0), seen.amax(dim=0))  # joints alone would allow far more
        return plan_first_run(model, rows=max(ROWS, LEAST_ROWS * len(loads)), payloads=loads, space=space).targets
    except WorkspaceError:
        return None


def _loads(problem: Problem) -> tuple[float, ...]:
    """Loads of the run, kg; the ends and one between of more than `MOST_LOADS`."""
    stated = problem.table.payload_kg
    if stated is None:
        return ()
    loads = np.unique(np.round(np.asarray(stated, dtype=float)[problem.used], 3))
    loads = loads[np.isfinite(loads)]
    if len(loads) > MOST_LOADS:
        loads = loads[[0, len(loads) // 2, -1]]
    return tuple(loads.tolist())
