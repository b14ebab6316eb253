"""A joint of an arm that slipped from some row on: the first one's turn is a turn of the tracker as well."""

import numpy as np
import torch

from ptt.machine import SerialSpec
from ptt.run.frames import rigid_columns
from ptt.setup.arm_fit import ROUNDS, TURN_LENGTH, mount_of, pose_many
from ptt.setup.rigid import align_many, rms_of_parts
from ptt.setup.seen import Seen

MOST_ROWS = 120
STEP = 1e-4  # rad, of a numerical derivative
ALIKE = 2.0  # times what a frame of their own leaves: a slip that does as well is the simpler cause
LEAST_LEFT = 0.1  # mm: agreement beyond this is no further proof


def is_slip_of_joint(spec: SerialSpec, seen: Seen, later: np.ndarray, left: float) -> bool:
    """Whether one joint that stands otherwise in later rows explains them as well as another place of the tracker.

    Args:
        spec: an arm.
        seen: m rows that were read before or after.
        later: (m,) bool.
        left: what a frame of its own for the later rows leaves, mm.
    """
    some = np.unique(np.linspace(0, len(seen) - 1, min(len(seen), MOST_ROWS)).round().astype(int))
    few, after = seen.take(some), later[some]
    angle = _turned(few, after)
    return any(
        _left_by_slip(spec, few, after, joint, start) < ALIKE * left + LEAST_LEFT
        for joint in range(len(spec.joint))
        for start in (angle, -angle)
    )


def _turned(seen: Seen, later: np.ndarray) -> float:
    """By how much the tracker is turned between the parts, rad: what a joint's slip that looks like it comes to."""
    place = seen.of_reflector(later.astype(int))
    first, second = (align_many(place[None, own], seen.reading[None, own])[0][0] for own in (~later, later))
    return float(np.arccos(np.clip((np.trace(first.T @ second) - 1.0) / 2.0, -1.0, 1.0)))


def _left_by_slip(spec: SerialSpec, seen: Seen, later: np.ndarray, joint: int, slip: float) -> float:
    """What stays, mm rms, of all rows in one frame with the joint moved in the later ones, by Gauss-Newton."""
    command, mount = np.asarray(seen.command), np.zeros(3)
    one = np.where(later[:, None], np.arange(command.shape[1]) == joint, 0.0)
    for again in range(ROUNDS):
        pose, beside = pose_many([(spec, command + slip * one), (spec, command + (slip + STEP) * one)])
        mount = mount if again else mount_of(pose, seen.reading, True)
        place, moved = (at.place + at.turn @ mount for at in (pose, beside))
        turn, shift, _ = align_many(place[None], seen.reading[None])
        left = (seen.reading - shift[0]) @ turn[0] - place
        rigid = rigid_columns(torch.as_tensor(place), torch.as_tensor(place.mean(axis=0)), TURN_LENGTH).numpy()
        columns = np.concatenate([pose.turn, (moved - place)[..., None] / STEP, rigid], axis=2)
        step = np.linalg.lstsq(columns.reshape(left.size, -1), left.ravel(), rcond=1e-10)[0]
        mount, slip = mount + step[:3], slip + float(step[3])
    return _left_at(spec, command + slip * one, mount, seen, later)


def _left_at(spec: SerialSpec, command: np.ndarray, mount: np.ndarray, seen: Seen, later: np.ndarray) -> float:
    (pose,) = pose_many([(spec, command)])
    place = pose.place + pose.turn @ mount
    return rms_of_parts(align_many(place[None], seen.reading[None])[2][0], later.astype(int))
