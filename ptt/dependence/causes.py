"""Which of two confounded causes is the likelier: a joint or where the tool is, a steady play or one that varies."""

import numpy as np

from ptt.dependence.chance import log_chance
from ptt.dependence.contexts import COORDINATES
from ptt.dependence.curves import choose_columns
from ptt.dependence.strata import RepeatedPoses

CLEAR = 10.0  # log chance by which a varying direction must beat what it is made of
BETTER = 6.0  # by which the information criterion must speak for the position

PATH_STEP = 0.1  # of the workspace's diagonal


def position_explains_more(
    residual: str, on: str, data: dict[str, np.ndarray], contexts: dict[str, np.ndarray], poses: RepeatedPoses
) -> bool:
    """Whether a smooth field over the workspace explains joint residuals better than the joint itself does.

    The joint's curve is joined by plane terms, which a fitted tracker frame leaves behind; the field is a full
    quadric or cubic.

    Args:
        residual: which residual follows the joint; it is looked at with the joint's own where it is a joint's.
        on: the joint's variable, 'b2' or 'q2'.
        data: (n,) residuals by name.
        contexts: (n,) variables by name.
        poses: repeated visits.

    Returns:
        True where the Bayesian information criterion speaks for the field in one of them.
    """
    own = {f"slider {on[1:]}", f"joint {on[1:]}"} | ({residual} if residual not in COORDINATES else set())
    axes = [contexts[name] for name in COORDINATES if name in contexts]
    names = sorted(own & set(data))
    if len(axes) < 2 or _is_path(np.column_stack([axis[poses.first] for axis in axes])):
        return False
    place = np.column_stack([_scaled(axis[poses.first]) for axis in axes])
    return any(_field_wins(poses.mean(data[name][:, None])[:, 0], contexts[on][poses.first], place) for name in names)


def _is_path(place: np.ndarray) -> bool:
    """Along a path, short steps from pose to pose, every field is a function of the way and tells nothing."""
    step = np.linalg.norm(np.diff(place, axis=0), axis=1)
    return bool(np.median(step) < PATH_STEP * np.linalg.norm(np.ptp(place, axis=0)))


def _field_wins(residual: np.ndarray, values: np.ndarray, place: np.ndarray) -> bool:
    joint, toll = choose_columns(values, residual)
    local = _criterion(np.column_stack([joint, place]), toll + place.shape[1], residual)
    fields = [_polynomial(place, degree) for degree in (2, 3)]
    return min(_criterion(field, field.shape[1], residual) for field in fields) < local - BETTER


def varies_with(residual: np.ndarray, direction: np.ndarray, second: np.ndarray) -> bool:
    """Whether a direction's say varies with a second variable, beyond a steady direction and that variable itself.

    Args:
        residual: (n,) mm.
        direction: (n,), +1 or -1.
        second: (n,).

    Returns:
        True where the F test of direction x (s, s^2) is clear.
    """
    s, side = (second - second.mean()) / second.std(), np.sign(direction - 1e-9)
    curve = np.column_stack([np.ones_like(s), s, s**2])
    plain = np.column_stack([curve, side])
    full = np.column_stack([plain, side[:, None] * curve[:, 1:]])
    left = [np.square(residual - m @ np.linalg.lstsq(m, residual, rcond=None)[0]).sum() for m in (plain, full)]
    share = 1.0 - left[1] / max(left[0], 1e-300)
    return bool(log_chance(np.array([share]), 2, len(residual) - 6)[0] > CLEAR)


def _scaled(values: np.ndarray) -> np.ndarray:
    return 2.0 * (values - values.min()) / max(float(np.ptp(values)), 1e-12) - 1.0


def _polynomial(place: np.ndarray, degree: int) -> np.ndarray:
    """Every product of coordinates up to a degree."""
    powers = [p for p in np.ndindex(*(degree + 1,) * place.shape[1]) if 0 < sum(p) <= degree]
    return np.column_stack([np.prod(place ** np.array(p), axis=1) for p in powers])


def _criterion(columns: np.ndarray, used: float, residual: np.ndarray) -> float:
    columns = np.column_stack([np.ones(len(residual)), columns])
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=1e-8)[0]
    rows = len(residual)
    return float(rows * np.log(max(float(left @ left), 1e-300)) + used * np.log(rows))
