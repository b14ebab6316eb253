"""Predicted error of held-out rows with and without model and network: computed, not measured."""

from typing import Literal

from nets import RbfTraining
from ptt.correct.training.compensator import Compensator
from ptt.correct.training.nested import hold_out
from ptt.correct.training.physics import fit_physics
from ptt.correct.training.protocols import Protocol
from ptt.correct.training.rest import Space, learn_rest
from ptt.errors import PosesError
from ptt.fitting.result import sound_rows
from ptt.judge.evaluation import Evaluation
from ptt.judge.ladder.rung import with_frames_of_base
from ptt.judge.run_errors import refer_z
from ptt.model.model import Model
from ptt.progress import Progress
from ptt.run.problem import Problem
from ptt.run.same_pose import count_places


def evaluate_heldout(
    compensator: Compensator,
    problem: Problem,
    protocol: Protocol,
    z_datum: Literal["absolute", "first"] = "absolute",
    *,
    progress: Progress | None = None,
) -> Evaluation:
    """Evaluate a model on held-out rows: effects refitted, and the network trained anew, without them.

    Args:
        compensator: the effects, and whether there is a network.
        problem: the readings.
        protocol: which rows are held out.
        z_datum: 'first' refers z errors to the first row that counts.
        progress: told what is done, how much of how much.

    Returns:
        Before: the bare drawing's error on those rows; after: the error with model and network.

    Raises:
        PosesError: all readings are of one pose.
    """
    if any((problem.used <= hidden).all() for hidden in protocol.folds):
        raise PosesError(
            f"{problem.table.source}: no reading can be held out: too few poses differ; measure more poses"
        )
    problem = with_frames_of_base(compensator.model, problem)
    bare = fit_physics(Model(compensator.model.file), problem)
    networks: dict[Space, RbfTraining] = {}
    if compensator.network is not None:
        fitted = fit_physics(compensator.model, problem)
        space = compensator.space
        networks[space] = learn_rest(problem, fitted, sound_rows(problem, fitted), protocol.groups, space=space)
    held = hold_out(compensator.model, problem, protocol, networks, progress=progress)
    before, after = (
        refer_z(errors, problem.target, held.rows, z_datum)[held.rows] for errors in (bare.residual, held.whole)
    )
    words = {
        "rows": int(held.rows.sum()),
        "poses": count_places(problem.target[held.rows]),
        "frame": f"{problem.file.tracker.frame}, by the machine file",
        "z_datum": z_datum,
        "measured": False,
        "held_out": protocol.text,
    }
    return Evaluation(before, after, words, None, problem.noise)
