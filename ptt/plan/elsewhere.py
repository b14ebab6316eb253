"""Elsewhere: how far a fit leaves the tool open all over the workspace, beside the poses that it was made on."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ptt.errors import WorkspaceError
from ptt.fitting.chunks import sampled_if_long
from ptt.fitting.kept import keep
from ptt.fitting.result import FitResult
from ptt.fitting.tool_sigma import tool_sigma
from ptt.mechanisms import build_mechanism
from ptt.model.chain import EffectTerms
from ptt.plan.space import build_space, draw_poses
from ptt.record import Record
from ptt.run.problem import Problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

POSES = 200  # of the workspace; their median is as good as its twentieth part
FAR = 3.0  # times what is to be expected where the readings are, from which the workspace is worth a word


@dataclass(frozen=True)
class Elsewhere(Record):
    """How far commands of a fit may be off, as `sigma_um` says it of each.

    Attributes:
        run: at the poses of the run, root mean square, um.
        workspace: in half of the workspace it is more than this, um.
    """

    keys: ClassVar[str] = "run, workspace"

    run: float
    workspace: float

    def words(self, error_um: float) -> str:
        """A sentence where the workspace is far less sure than the readings; '' where it is not.

        Args:
            error_um: what is to be expected of the machine at the poses of the run.
        """
        if not self.workspace > FAR * max(error_um, self.run):
            return ""
        return (
            "Outside the measured region the model is less certain: over half of the workspace the expected error is "
            f"{self.workspace:.0f} um or more. Measure where the machine works; `ptt predict` gives sigma_um per "
            "target."
        )


def elsewhere_um(fitted: FitResult, problem: Problem) -> dict[str, Any]:
    """The same as a key of JSON; arguments as of `elsewhere`."""
    found = elsewhere(fitted, problem)
    return {"elsewhere_um": None if found is None else found.to_dict()}


def elsewhere(fitted: FitResult, problem: Problem) -> Elsewhere | None:
    """How far the machine may miss at the poses of a run, and all over its workspace, unloaded and as warm as drawn.

    Args:
        fitted: to the run.
        problem: the run.

    Returns:
        None where nothing of the machine was fitted, or its workspace is none, or where nobody asked what sizes of the
        drawing that the model does not have leave open.
    """
    file = problem.file
    terms: EffectTerms = [
        (term.effect, term.theta) for term in fitted.model.terms if term.effect.stage != "metrology" and len(term.theta)
    ]
    if not terms or fitted.unnamed is None:
        return None
    kept = keep(fitted)
    problem = sampled_if_long(problem)
    try:
        q = draw_poses(build_space(file), POSES, np.random.default_rng(0))
    except WorkspaceError:
        return None
    place = build_mechanism(file.machine).forward(q).numpy()
    table = make_table(place, command=q.numpy() if file.machine.kind == "serial" else None)
    run, far = (1e3 * tool_sigma(kept, terms, view, file) for view in (problem.view, build_view(file, table)))
    run = run[problem.used & np.isfinite(run)]
    return Elsewhere(float(np.sqrt(np.mean(run**2))), float(np.nanmedian(far)))
