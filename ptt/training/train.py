"""Training: fit the physics, let a Gaussian RBF network learn what is left, and say how well both hold out."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from nets import RbfSettings, RbfTraining
from ptt.fit.solve import rms
from ptt.model import Model
from ptt.problem import Problem
from ptt.training.physics import Physics, fit_physics, keep_physics, sound
from ptt.training.protocols import PROTOCOLS, Protocol, block_protocol, random_protocol
from ptt.training.rest import Space, correction_of, inputs_of, learn_rest, refit, rest_of, spaces_of

__all__ = [
    "PROTOCOLS",
    "HeldOut",
    "Physics",
    "Protocol",
    "Training",
    "block_protocol",
    "correction_of",
    "fit_physics",
    "hold_out",
    "keep_physics",
    "learn_rest",
    "random_protocol",
    "rest_of",
    "sound",
    "train",
]

Progress = Callable[[str, int, int], None]
Figures = dict[str, float]


@dataclass(frozen=True)
class HeldOut:
    """Errors of rows that neither physics nor network had seen, NaN elsewhere.

    Attributes:
        protocol: which rows those are.
        given: residual of the model with the parameters it came with, (n, 3) mm.
        physics: residual of the refitted model, (n, 3) mm.
        whole: what the network leaves of it, (n, 3) mm.
        rows: the rows that count, (n,) bool.
    """

    protocol: Protocol
    given: np.ndarray
    physics: np.ndarray
    whole: np.ndarray
    rows: np.ndarray

    def rms_um(self) -> dict[str, Figures]:
        """Root mean square per axis and in total, um, for 'given', 'physics' and 'rbf'."""
        return {
            "given": rms(self.given, self.rows),
            "physics": rms(self.physics, self.rows),
            "rbf": rms(self.whole, self.rows),
        }


@dataclass(frozen=True)
class Training:
    """Physics and network, fitted on all rows, with errors on rows that neither had seen.

    Attributes:
        physics: the fitted effects.
        rbf: the network that learns the rest and how it was chosen.
        rms_um: error with the model as given, with the physics, and with the network, all on training rows.
        heldout_um: the same on held-out rows.
        rbf_share: share of the held-out variance after the physics that the network took away.
        protocol: which rows were held out.
        space: what the network's inputs are; of an arm's tool positions and joints, what holds out better.
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
    problem = problem.anchored()
    protocol = protocol or block_protocol(problem)
    tell = progress or (lambda what, done, of: None)
    spaces = spaces_of(problem)
    steps = 1 + len(spaces) * (len(protocol.folds) + 1)
    tell("fit", 0, steps)
    fitted = fit_physics(model, problem)
    rows = sound(problem, fitted)
    tried: dict[Space, tuple[RbfTraining, HeldOut]] = {}
    for number, space in enumerate(spaces):
        begun = 1 + number * (len(protocol.folds) + 1)
        tell("network", begun, steps)
        learned = learn_rest(problem, fitted, rows, protocol.groups, settings, space)

        def told(what: str, done: int, of: int, begun: int = begun) -> None:
            tell(what, begun + 1 + done, steps)

        tried[space] = learned, hold_out(model, problem, protocol, learned, settings, told, space)
    totals = {space: held.rms_um()["rbf"]["total"] for space, (_, held) in tried.items()}
    space = min(totals, key=lambda each: totals[each])
    network, held = tried[space]
    given = keep_physics(model, problem).residual
    after = np.full_like(given, np.nan)
    after[rows] = fitted.residual[rows] + network.network.predict(inputs_of(problem, space)[rows])
    figures = held.rms_um()
    physics, whole = figures["physics"]["total"], figures["rbf"]["total"]
    return Training(
        fitted,
        network,
        {"given": rms(given, rows), "physics": rms(fitted.residual, rows), "rbf": rms(after, rows)},
        figures,
        1.0 - (whole / physics) ** 2 if physics > 0 else 0.0,
        protocol.text,
        space,
        {name: float(value) for name, value in totals.items()},
    )


def hold_out(
    model: Model,
    problem: Problem,
    protocol: Protocol,
    network: RbfTraining | None,
    settings: RbfSettings | None = None,
    progress: Progress | None = None,
    space: Space = "tool",
) -> HeldOut:
    """Errors of rows that were hidden from physics and network.

    Args:
        model: effects to be refitted without the hidden rows.
        problem: the readings.
        protocol: which rows are hidden.
        network: what was chosen on all rows; its centres, widths and weights are found anew; None for physics alone.
        settings: of the network.
        progress: told what is done, how much of how much.
        space: what the network's inputs are.

    Returns:
        The errors.
    """
    problem = problem.anchored()
    given = keep_physics(model, problem)
    physics = np.full((problem.table.rows, 3), np.nan)
    whole, rows = physics.copy(), sound(problem, given)
    for number, hidden in enumerate(protocol.folds):
        if progress is not None:
            progress("held-out", number, len(protocol.folds))
        part = fit_physics(model, problem.masked(hidden), lean=True)
        seen = hidden & rows
        physics[seen] = whole[seen] = part.residual[seen]
        if network is not None and network.learned.any():
            shown = sound(problem.masked(hidden), part)
            again = refit(rest_of(problem, part, shown, protocol.groups, space), network, settings)
            place = inputs_of(problem, space)[seen]
            whole[seen] += np.where(again.inside(place)[:, None], again.predict(place), 0.0)
    scored = rows & np.isfinite(whole).all(axis=1)
    return HeldOut(protocol, given.residual, physics, whole, scored)
