"""Training: fit the physics, train a Gaussian RBF network on the residual, and estimate the held-out error of both."""

from dataclasses import dataclass, field, replace

import numpy as np

from nets import RbfSettings, RbfTraining, muted
from ptt.correct.training.nested import Figures, better_space, hold_out
from ptt.correct.training.physics import Physics, fit_physics, keep_physics
from ptt.correct.training.protocols import Protocol, block_protocol
from ptt.correct.training.rest import Space, inputs_of, learn_rest, spaces_of
from ptt.fitting.beside_unnamed import beside_unnamed
from ptt.fitting.held_frame import with_frame_doubt
from ptt.fitting.result import sound_rows
from ptt.fitting.turns import with_turns
from ptt.judge.ladder.rung import with_frames_of_base
from ptt.model.model import Model
from ptt.progress import Progress, unwatched
from ptt.run.axes import rms
from ptt.run.problem import Problem


@dataclass(frozen=True)
class Training:
    """Physics and network, fitted on all rows, with held-out errors.

    Attributes:
        physics: the fitted effects.
        rbf: the network of the residual and how it was chosen.
        rms_um: error with the model as given, with the physics, and with the network, all on training rows.
        heldout_um: the same on held-out rows, which took part in one choice only: axes on which the network did not
            reduce their error are left to physics.
        rbf_share: share of the held-out variance after the physics that the network removes.
        protocol: which rows were held out.
        space: the network's inputs; for an arm, tool positions or joints by cross-validation.
        spaces_um: total held-out error with a network of each kind of inputs, um.
    """

    physics: Physics
    rbf: RbfTraining
    rms_um: dict[str, Figures]
    heldout_um: dict[str, Figures]
    rbf_share: float
    protocol: str
    space: Space = "tool"
    spaces_um: dict[str, float] = field(default_factory=dict)


def train(
    model: Model,
    problem: Problem,
    *,
    settings: RbfSettings | None = None,
    protocol: Protocol | None = None,
    progress: Progress | None = None,
) -> Training:
    """Fit a model's effects and train the network on the residual.

    Args:
        model: effects, none for the bare drawing.
        problem: the readings.
        settings: of the network.
        protocol: which rows are held out for the figures, and how finely for the network's settings; None: blocks.
        progress: told what is done, how much of how much.

    Returns:
        The training.

    Raises:
        TableError: too few poses to hold any out.
    """
    free, problem = problem, with_frames_of_base(model, problem)
    protocol = protocol or block_protocol(problem)
    tell = progress or unwatched
    spaces = spaces_of(problem)
    steps = 1 + len(spaces) + len(protocol.folds)
    tell("fit", 0, steps)
    fitted = _with_full_covariance(fit_physics(model, problem), problem, free)
    rows = sound_rows(problem, fitted)
    networks: dict[Space, RbfTraining] = {}
    for number, space in enumerate(spaces):
        tell("network", 1 + number, steps)
        networks[space] = learn_rest(problem, fitted, rows, protocol.groups, settings, space)

    def told(what: str, done: int, of: int) -> None:
        tell(what, steps - of + done, steps)

    held = hold_out(model, problem, protocol, networks, settings, told)
    space = better_space(networks)
    # An axis whose held-out error the network does not reduce is not corrected by it.
    kept = held.kept()
    network, held = muted(networks[space], kept), held.without(~kept)
    figures = held.rms_um()
    given = keep_physics(model, problem).residual
    after = np.full_like(given, np.nan)
    after[rows] = fitted.residual[rows] + network.network.predict(inputs_of(problem, space)[rows])
    physics, whole = figures["physics"]["total"], figures["rbf"]["total"]
    return Training(
        fitted,
        network,
        {"given": rms(given, rows), "physics": rms(fitted.residual, rows), "rbf": rms(after, rows)},
        figures,
        1.0 - (whole / physics) ** 2 if physics > 0 else 0.0,
        protocol.text,
        space,
        held.spaces_um(),
    )


def _with_full_covariance(physics: Physics, held: Problem, free: Problem) -> Physics:
    """The physics with the uncertainty of held frames and of errors outside the model added to its covariance."""
    if physics.fitted is None:
        return physics
    fitted = with_turns(beside_unnamed(with_frame_doubt(physics.fitted, free), held), held)
    return replace(physics, fitted=fitted, model=fitted.model)
