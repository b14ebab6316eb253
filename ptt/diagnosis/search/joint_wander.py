"""A slow wander that moves the readings as one joint does: the machine's own, whatever its size."""

from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.gains import all_rows
from ptt.diagnosis.noise.wander import SHARES, Clock, Wander, tracker_likelihood, white_likelihood
from ptt.diagnosis.unknown.places import Place, places_of_chain

# Nats by which a joint has to explain the wander better than the tracker does, beside the odds of which joint it is.
# Where a tracker wanders the joints lie behind by about as many nats as there are readings.
SURE_NATS = 10.0
LEAST_SHARE = 1.0  # variance along the joint, over the white one, beyond which it is worth a verdict


@dataclass(frozen=True)
class JointWander:
    """A wander along one joint.

    Attributes:
        residual: 'slider 2' or 'joint 2'.
        wander: along the joint.
        nats: by which it explains the readings better than a wander of the tracker, or none.
    """

    residual: str
    wander: Wander
    nats: float


def wander_of_joint(system: System, state: State) -> JointWander | None:
    """The joint along which the readings of a set wander, where that explains them better than a tracker's wander.

    A tracker's wander shifts readings alike at all poses, and in all directions or, as along its beam or where its
    stand leans, in a fixed one; a joint's, the way in which the joint moves the tool at each of them. So it is told
    apart by its direction, while by its size it might be either. Noise that is louder in that direction has no memory.

    Args:
        system: the linearised problem; that of a long run, which holds no rows, tells nothing.
        state: the best set. Errors of poses wander as the poses go, so beside them nothing is told.
    """
    if not isinstance(system, RowSystem) or state.memory.pose or not len(system.clock.constants):
        return None
    left, clock, found = system.residual(state.columns, state.posterior.values), system.clock, list[JointWander]()
    shares = [float(share) for share in SHARES]
    joints = [one for one in places_of_chain(system.at.problem, system.at.chain) if one.kind in ("slider", "joint")]
    slow = [Wander(s, float(t)) for s in shares for t in clock.constants if s > LEAST_SHARE]
    slow = [wander for wander in slow if clock.is_slow(wander)]
    one_way = left @ _main_direction(left, clock)
    # The fixed direction has two angles that the readings determine, each worth half the logarithm of their number.
    fixed = max((_wandering(left, one_way, one, clock) - np.log(len(left)) for one in slow), default=-np.inf)
    tracker = max(tracker_likelihood(left, system.noise, clock), fixed)
    for place in joints:
        along, _ = along_place(system, place, left)
        beside = max(tracker, *(_louder(left, along, share) for share in shares))
        found += [JointWander(place.residual, one, _wandering(left, along, one, clock) - beside) for one in slow]
    best = max(found, key=lambda one: one.nats, default=None)
    return best if best is not None and best.nats > SURE_NATS + np.log(len(joints)) else None


def _main_direction(left: np.ndarray, clock: Clock) -> np.ndarray:
    """Direction along which successive residuals (m, 3) are most alike, (3,), which is that of a wander along it."""
    within = ~clock.starts[1:]
    alike = left[1:][within].T @ left[:-1][within]
    return np.asarray(np.linalg.eigh(alike + alike.T)[1][:, -1])


def along_place(system: RowSystem, place: Place, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (m, 3), whitened, along the way in which a place of one direction moves each of them, (m,).

    And how far it moves each, (m,), over the root mean square of all.
    """
    way = place.slopes[system.rows][:, :, 0] @ system.noise.whitener.T
    size = np.linalg.norm(way, axis=1)
    along = np.einsum("ni,ni->n", left, way / np.maximum(size, 1e-300)[:, None])
    return along, size / max(float(np.sqrt(np.square(size).mean())), 1e-300)


def _wandering(left: np.ndarray, along: np.ndarray, wander: Wander, clock: Clock) -> float:
    """As `likelihoods`, of a wander of the component along one direction of each row, (n,), and white noise beside."""
    gains = clock.gains(wander.share, wander.constant)
    new = (along - all_rows(along[:, None], gains.keep, gains.take)[:, 0]) / gains.root
    taken = float(np.square(along).sum() - np.square(new).sum())
    return float(wander.log_prior) + white_likelihood(left, taken, gains.log_noise)


def _louder(left: np.ndarray, along: np.ndarray, share: float) -> float:
    """The same of white noise that is louder along that direction: noise unlike the stated one has no memory."""
    return white_likelihood(
        left, float(np.square(along).sum()) * share / (1.0 + share), 0.5 * len(along) * np.log1p(share)
    )
