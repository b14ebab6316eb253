"""The rest: what physics leaves, as the network learns it and gives it back."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from nets import GaussianRbf, NetsError, RbfSettings, RbfTraining, measure_domain, train_rbf
from nets.selection import LEAST_PLACES
from ptt.correct.training.physics import Physics
from ptt.errors import TooFewError
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem

Space = Literal["tool", "joints"]  # what the network's inputs are: tool positions, or an arm's joint commands

POSES = 2000  # k-means and the held-out choice gain nothing from more
BESIDE = 1.0  # mm: the size of the errors, hence of the way from a target to what is asked for instead


@dataclass(frozen=True)
class TrainingSet:
    """What a network is trained on.

    Attributes:
        inputs: (m, 3) mm, poses and places beside them; (m, k) rad over an arm's joints.
        steps: (m, 3) mm, from the place to what the model is to be asked for.
        groups: (m,) int, rows held out together.
        places: (u, 3) mm or (u, k) rad, the poses themselves.
    """

    inputs: np.ndarray
    steps: np.ndarray
    groups: np.ndarray
    places: np.ndarray


def spaces_of(problem: Problem) -> tuple[Space, ...]:
    """Inputs that a network may have: an arm reaches a place in many postures, so its joint commands may tell more."""
    told = problem.table.command is not None and bool(np.isfinite(problem.table.command).all())
    return ("tool", "joints") if problem.file.machine.kind == "serial" and told else ("tool",)


def inputs_of(problem: Problem, space: Space) -> np.ndarray:
    """Inputs of the network at every row, (n, 3) mm or (n, k) rad."""
    return problem.target if space == "tool" else np.asarray(problem.view.q.numpy())


def training_set_of(
    problem: Problem, fitted: Physics, rows: np.ndarray, groups: np.ndarray, space: Space = "tool"
) -> TrainingSet:
    """What the network learns: P_m(p) -> P_m(p - dp), as the step from p, the mean over all visits of a pose.

    Each pose is learned at its target and again a little beside it. A path is a line in space, and beside a line
    nothing holds a network that fits it to the last digit, while the commands ask for places beside it, off by the
    very error that they correct. (Training with displaced inputs: Bishop, Neural Computation 7, 1995.) Joint commands
    are asked at the nominal ones themselves, so over joints nothing is displaced.

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
    _, first, code = np.unique(pose, return_index=True, return_inverse=True)
    count = np.bincount(code)[:, None]
    steps = np.column_stack([np.bincount(code, column) for column in -fitted.residual[rows].T]) / count
    kept = _thin(len(first))
    places, steps, groups = inputs_of(problem, space)[rows][first][kept], steps[kept], groups[rows][first][kept]
    aside = _beside(places) if space == "tool" else np.zeros((1, places.shape[1]))
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
    """Train the network on what the physics leaves.

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
    return replace(trained, network=_over(trained.network, rest.places))


def correction_of(network: GaussianRbf, posture: np.ndarray | None = None) -> Callable[[np.ndarray], np.ndarray]:
    """Wanted position -> position to ask the model for.

    Args:
        network: trained on the rest.
        posture: (n, k) rad, nominal joint commands of the rows that will be asked for, where the network was trained on
            joints; None where it was trained on tool positions.

    Returns:
        N(p) = p + step(p), p unchanged outside the training domain.
    """
    return lambda wanted: wanted + step_of(network, wanted if posture is None else posture)


def step_of(network: GaussianRbf, place: np.ndarray) -> np.ndarray:
    """The network's step, (m, 3) mm, at its inputs (m, 3) mm or (m, k) rad; none outside its training domain."""
    return np.where(network.inside(place)[:, None], network.predict(place), 0.0)


def _beside(places: np.ndarray) -> np.ndarray:
    """Displacements at which each of the places (m, 3) mm is learned, (c, 3) mm, none among them."""
    none = np.zeros((1, 3))
    if len(places) < LEAST_PLACES:  # copies must not pass for poses where there are too few
        return none
    from scipy.spatial import cKDTree

    nearest = cKDTree(places).query(places, k=2)[0][:, 1]
    way = min(BESIDE, 0.5 * float(np.median(nearest)))
    return np.concatenate([none, way * np.eye(3), -way * np.eye(3)])


def _over(network: GaussianRbf, places: np.ndarray) -> GaussianRbf:
    """The same network, its domain that of the poses themselves."""
    domain = measure_domain((places - network.input_mean.numpy()) / network.input_scale.numpy())
    tensors = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    box = np.stack([domain.low, domain.high])
    return GaussianRbf.from_tensors(
        tensors | {"domain_points": domain.points, "domain_reach": np.asarray(domain.reach), "domain_box": box}
    )


def _thin(poses: int) -> np.ndarray:
    """At most POSES of the poses, spread evenly over the travel."""
    return np.unique(np.linspace(0, poses - 1, min(poses, POSES)).round().astype(int))
