"""Uncertainty of a model's commands over the whole workspace, compared with that at the poses of its run."""

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

POSES = 200  # of the workspace, enough for a median
FAR = 3.0  # ratio to the expected error at the run's poses, beyond which the uncertainty elsewhere is reported


@dataclass(frozen=True)
class Elsewhere(Record):
    """Expected error of a fitted model's commands, as the column `sigma_um` of `ptt predict`.

    Attributes:
        run: rms over the poses of the run, um.
        workspace: median over the workspace, um.
    """

    keys: ClassVar[str] = "run, workspace"

    run: float
    workspace: float

    def words(self, error_um: float) -> str:
        """A sentence where the workspace is far less certain than the run's poses; else ''.

        Args:
            error_um: error of the model at the poses of the run, rms, um.
        """
        if not self.workspace > FAR * max(error_um, self.run):
            return ""
        return (
            "Outside the measured region the model is less certain: over half of the workspace the expected error is "
            f"{self.workspace:.0f} um or more. Measure where the machine works; `ptt predict` gives sigma_um per "
            "target."
        )


def elsewhere_um(fitted: FitResult, problem: Problem) -> dict[str, Any]:
    """`elsewhere` under its key for JSON; the same arguments."""
    found = elsewhere(fitted, problem)
    return {"elsewhere_um": None if found is None else found.to_dict()}


def elsewhere(fitted: FitResult, problem: Problem) -> Elsewhere | None:
    """Expected error at the poses of a run, and over the workspace without load at the reference temperature.

    Args:
        fitted: the model, fitted to the run.
        problem: the run.

    Returns:
        None where no effect of the machine was fitted, the workspace is empty, or the fit did not work out the
        uncertainty by sizes of the drawing that the model does not have.
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
