"""The residual of the physics: training set of the network, and the correction by a trained network."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from nets import GaussianRbf, NetsError, RbfSettings, RbfTraining, measure_domain, train_rbf
from nets.selection import LEAST_PLACES
from ptt.correct.training.physics import Physics
from ptt.errors import TooFewError
from ptt.run.holdout import pose_groups
from ptt.run.means import group_means
from ptt.run.problem import Problem

Space = Literal["tool", "joints"]  # what the network's inputs are: tool positions, or an arm's joint commands

POSES = 2000  # k-means and the choice of settings gain nothing from more
ASIDE = 1.0  # mm: the size of errors, hence the distance from a target to the corrected position


@dataclass(frozen=True)
class TrainingSet:
    """What a network is trained on.

    Attributes:
        inputs: (m, 3) mm, poses and positions displaced from them; (m, k) rad for joint inputs of an arm.
        steps: (m, 3) mm, from the wanted position to the one that the model is asked for.
        groups: (m,) int, rows held out together.
        places: (u, 3) mm or (u, k) rad, the poses themselves.
    """

    inputs: np.ndarray
    steps: np.ndarray
    groups: np.ndarray
    places: np.ndarray


def spaces_of(problem: Problem) -> tuple[Space, ...]:
    """Possible inputs of a network: an arm reaches a position in several postures, told apart by joint commands."""
    told = problem.table.command is not None and bool(np.isfinite(problem.table.command).all())
    return ("tool", "joints") if problem.file.machine.kind == "serial" and told else ("tool",)


def inputs_of(problem: Problem, space: Space) -> np.ndarray:
    """Inputs of the network at every row, (n, 3) mm or (n, k) rad."""
    return problem.target if space == "tool" else np.asarray(problem.view.q.numpy())


def training_set_of(
    problem: Problem, fitted: Physics, rows: np.ndarray, groups: np.ndarray, space: Space = "tool"
) -> TrainingSet:
    """Training set for the step from a wanted position p to p - dp, dp the mean residual over all visits of a pose.

    Each pose is learned at its target and at displaced copies. Poses along a path lie on a curve, and off the curve an
    exact interpolation is undetermined; yet commands evaluate the network off it, by the error that they correct.
    (Training with displaced inputs: Bishop, Neural Computation 7, 1995.) A network of joint inputs is evaluated at
    the nominal joint commands themselves, so there nothing is displaced.

    Args:
        problem: the readings.
        fitted: the physics.
        rows: which rows, (n,) bool.
        groups: (n,) int, rows held out together when settings are chosen.
        space: what the inputs are.

    Returns:
        Inputs, steps and groups.
    """
    pose = pose_groups(problem.table)[rows]
    first, steps = np.unique(pose, return_index=True)[1], group_means(-fitted.residual[rows], pose)[1]
    kept = _thin(len(first))
    places, steps, groups = inputs_of(problem, space)[rows][first][kept], steps[kept], groups[rows][first][kept]
    aside = _displacements(places) if space == "tool" else np.zeros((1, places.shape[1]))
    copies = len(aside)
    inputs = (places[None] + aside[:, None]).reshape(-1, places.shape[1])
    return TrainingSet(inputs, np.tile(steps, (copies, 1)), np.tile(groups, copies), places)


def learn_rest(
    problem: Problem,
    fitted: Physics,
    rows: np.ndarray,
    groups: np.ndarray,
    settings: RbfSettings | None = None,
    space: Space = "tool",
) -> RbfTraining:
    """Train the network on the residual of the physics.

    Args:
        problem: the readings.
        fitted: the physics.
        rows: which rows, (n,) bool.
        groups: (n,) int, rows held out together when settings are chosen.
        settings: of the network.
        space: what its inputs are.

    Returns:
        The network; it predicts zero for an axis on which it does not help held-out rows.

    Raises:
        TableError: fewer than two groups of rows.
    """
    rest = training_set_of(problem, fitted, rows, groups, space)
    try:
        trained = train_rbf(rest.inputs, rest.steps, rest.groups, settings=settings)
    except NetsError as error:
        raise TooFewError(
            f"the network cannot be trained: {error}", where=problem.table.source, fix="measure more poses"
        ) from error
    return replace(trained, network=_with_domain_of(trained.network, rest.places))


def correction_of(network: GaussianRbf, space: Space = "tool") -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Wanted position and nominal joint values -> position to ask the model for.

    Args:
        network: trained on the rest.
        space: what its inputs are.

    Returns:
        N(p) = p + step(p), or step(q) for joint inputs; p unchanged outside the training domain.
    """
    return lambda wanted, joints: wanted + step_of(network, wanted if space == "tool" else joints)


def step_of(network: GaussianRbf, place: np.ndarray) -> np.ndarray:
    """The network's step, (m, 3) mm, at its inputs (m, 3) mm or (m, k) rad; zero outside its training domain."""
    return np.where(network.inside(place)[:, None], network.predict(place), 0.0)


def _displacements(places: np.ndarray) -> np.ndarray:
    """Displacements at which each of the places (m, 3) mm is learned, (c, 3) mm, the first zero."""
    none = np.zeros((1, 3))
    if len(places) < LEAST_PLACES:  # copies must not make too few poses look like enough
        return none
    from scipy.spatial import cKDTree

    nearest = cKDTree(places).query(places, k=2)[0][:, 1]
    way = min(ASIDE, 0.5 * float(np.median(nearest)))
    return np.concatenate([none, way * np.eye(3), -way * np.eye(3)])


def _with_domain_of(network: GaussianRbf, places: np.ndarray) -> GaussianRbf:
    """A network with the training domain measured from the poses alone, without displaced copies."""
    domain = measure_domain((places - network.input_mean.numpy()) / network.input_scale.numpy())
    tensors = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    box = np.stack([domain.low, domain.high])
    return GaussianRbf.from_tensors(
        tensors | {"domain_points": domain.points, "domain_reach": np.asarray(domain.reach), "domain_box": box}
    )


def _thin(poses: int) -> np.ndarray:
    """At most POSES of the poses, spread evenly over the travel."""
    return np.unique(np.linspace(0, poses - 1, min(poses, POSES)).round().astype(int))
