"""A joint of an arm whose zero jumped from some row on, as an alternative to a moved tracker.

They are told apart by what each leaves, though a jump of the first joint moves readings just as a turned tracker does.
"""

import numpy as np
import torch

from ptt.machine import SerialSpec
from ptt.run.frames import rigid_columns
from ptt.setup.arm_fit import ROUNDS, TURN_LENGTH, mount_of, pose_many
from ptt.setup.posed_readings import PosedReadings
from ptt.setup.rigid import align_many, rms_of_parts

MOST_ROWS = 120  # for a fit of ten unknowns
STEP = 1e-4  # rad, of a numerical derivative
ALIKE = 2.0  # times the residual of a second tracker frame: a slip that fits about as well is the simpler cause
LEAST_LEFT = 0.1  # mm: agreement beyond this is no further proof


def is_slip_of_joint(spec: SerialSpec, posed: PosedReadings, later: np.ndarray, left: float) -> bool:
    """Whether a jump of one joint's zero explains the later rows as well as a moved tracker does.

    Args:
        spec: an arm.
        posed: m rows before and after the suspected jump.
        later: (m,) bool, the rows after it.
        left: rms residual, mm, with a tracker frame of its own for the later rows.
    """
    some = np.unique(np.linspace(0, len(posed) - 1, min(len(posed), MOST_ROWS)).round().astype(int))
    few, after = posed.take(some), later[some]
    angle = _tracker_rotation(few, after)
    return any(
        _rms_of_slip(spec, few, after, joint, start) < ALIKE * left + LEAST_LEFT
        for joint in range(len(spec.joint))
        for start in (angle, -angle)
    )


def _tracker_rotation(posed: PosedReadings, later: np.ndarray) -> float:
    """Angle between the tracker frames of both parts, rad: the start value for the jump of a joint."""
    place = posed.reflector(later.astype(int))
    first, second = (align_many(place[None, own], posed.reading[None, own])[0][0] for own in (~later, later))
    return float(np.arccos(np.clip((np.trace(first.T @ second) - 1.0) / 2.0, -1.0, 1.0)))


def _rms_of_slip(spec: SerialSpec, posed: PosedReadings, later: np.ndarray, joint: int, slip: float) -> float:
    """Residual, mm rms, of all rows in one tracker frame with the joint's jump fitted by Gauss-Newton."""
    command, mount = np.asarray(posed.command), np.zeros(3)
    one = np.where(later[:, None], np.arange(command.shape[1]) == joint, 0.0)
    for again in range(ROUNDS):
        pose, beside = pose_many([(spec, command + slip * one), (spec, command + (slip + STEP) * one)])
        mount = mount if again else mount_of(pose, posed.reading, True)
        place, moved = (at.place + at.turn @ mount for at in (pose, beside))
        turn, shift, _ = align_many(place[None], posed.reading[None])
        left = (posed.reading - shift[0]) @ turn[0] - place
        rigid = rigid_columns(torch.as_tensor(place), torch.as_tensor(place.mean(axis=0)), TURN_LENGTH).numpy()
        columns = np.concatenate([pose.turn, (moved - place)[..., None] / STEP, rigid], axis=2)
        step = np.linalg.lstsq(columns.reshape(left.size, -1), left.ravel(), rcond=1e-10)[0]
        mount, slip = mount + step[:3], slip + float(step[3])
    return _rms_at(spec, command + slip * one, mount, posed, later)


def _rms_at(spec: SerialSpec, command: np.ndarray, mount: np.ndarray, posed: PosedReadings, later: np.ndarray) -> float:
    (pose,) = pose_many([(spec, command)])
    place = pose.place + pose.turn @ mount
    return rms_of_parts(align_many(place[None], posed.reading[None])[2][0], later.astype(int))
