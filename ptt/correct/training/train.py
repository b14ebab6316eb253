"""Training: fit the physics, let a Gaussian RBF network learn what is left, and say how well both hold out."""

from dataclasses import dataclass, field, replace

import numpy as np

from nets import RbfSettings, RbfTraining, muted
from ptt.correct.training.nested import Figures, better_space, hold_out
from ptt.correct.training.physics import Physics, fit_physics, keep_physics, sound
from ptt.correct.training.protocols import Protocol, block_protocol
from ptt.correct.training.rest import Space, inputs_of, learn_rest, spaces_of
from ptt.fitting.beside_unnamed import beside_unnamed
from ptt.fitting.held_frame import with_frame_doubt
from ptt.fitting.solve import hold_to_base, rms
from ptt.fitting.turns import with_turns
from ptt.model.model import Model
from ptt.progress import Progress, unwatched
from ptt.run.problem import Problem


@dataclass(frozen=True)
class Training:
    """Physics and network, fitted on all rows, with errors on rows that neither had seen.

    Attributes:
        physics: the fitted effects.
        rbf: the network that learns the rest and how it was chosen.
        rms_um: error with the model as given, with the physics, and with the network, all on training rows.
        heldout_um: the same on held-out rows, which had no part in any choice but one: an axis that the network did not
            better on them is left to physics.
        rbf_share: share of the held-out variance after the physics that the network took away.
        protocol: which rows were held out.
        space: what the network's inputs are; of an arm's tool positions and joints, what its own held-out rows favour.
        spaces_um: held-out error in total with a network over each of them, um.
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
    """Fit a model's effects and train the network on what is left.

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
    free, problem = problem, hold_to_base(model, problem)
    protocol = protocol or block_protocol(problem)
    tell = progress or unwatched
    spaces = spaces_of(problem)
    steps = 1 + len(spaces) + len(protocol.folds)
    tell("fit", 0, steps)
    fitted = _as_sure(fit_physics(model, problem), problem, free)
    rows = sound(problem, fitted)
    networks: dict[Space, RbfTraining] = {}
    for number, space in enumerate(spaces):
        tell("network", 1 + number, steps)
        networks[space] = learn_rest(problem, fitted, rows, protocol.groups, settings, space)

    def told(what: str, done: int, of: int) -> None:
        tell(what, steps - of + done, steps)

    held = hold_out(model, problem, protocol, networks, settings, told)
    space = better_space(networks)
    # What the whole procedure did not better on rows that it had not seen is not sent to a machine.
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


def _as_sure(physics: Physics, held: Problem, free: Problem) -> Physics:
    """Physics fitted beside held frames, as sure as base reflectors and what the model does not have make it."""
    if physics.fitted is None:
        return physics
    fitted = with_turns(beside_unnamed(with_frame_doubt(physics.fitted, free), held), held)
    return replace(physics, fitted=fitted, model=fitted.model)
