"""Which of two confounded causes is likelier: joint or tool position, constant or varying reversal error."""

import numpy as np

from ptt.dependence.chance import minus_log_p
from ptt.dependence.curves import choose_columns
from ptt.dependence.strata import RepeatedPoses
from ptt.run.axes import AXES

CLEAR = 10.0  # -log p of the F test, beyond which the effect of a direction varies
BETTER = 6.0  # difference of the Bayesian information criterion, beyond which the field is preferred
PATH_STEP = 0.1  # median step over the workspace's diagonal, below which the poses form a path


def position_explains_more(
    residual: str, on: str, data: dict[str, np.ndarray], contexts: dict[str, np.ndarray], poses: RepeatedPoses
) -> bool:
    """Whether a smooth field over the workspace explains joint residuals better than the joint itself does.

    The joint's curve is joined by plane terms, which a fitted tracker frame leaves behind; the field is a full
    quadric or cubic.

    Args:
        residual: name of the residual that depends on the joint. The joint's own residual is tested as well; a residual
            along x, y or z is not tested itself.
        on: the joint's variable, 'b2' or 'q2'.
        data: (n,) residuals by name.
        contexts: (n,) variables by name.
        poses: repeated visits.

    Returns:
        True where the Bayesian information criterion clearly prefers the field for one of them.
    """
    own = {f"slider {on[1:]}", f"joint {on[1:]}"} | ({residual} if residual not in AXES else set())
    axes = [contexts[name] for name in AXES if name in contexts]
    names = sorted(own & set(data))
    if len(axes) < 2 or _is_path(np.column_stack([axis[poses.first] for axis in axes])):
        return False
    place = np.column_stack([_scaled(axis[poses.first]) for axis in axes])
    return any(_field_wins(poses.mean(data[name][:, None])[:, 0], contexts[on][poses.first], place) for name in names)


def _is_path(place: np.ndarray) -> bool:
    """Whether poses follow a path in short steps: any field is then a function of the path."""
    step = np.linalg.norm(np.diff(place, axis=0), axis=1)
    return bool(np.median(step) < PATH_STEP * np.linalg.norm(np.ptp(place, axis=0)))


def _field_wins(residual: np.ndarray, values: np.ndarray, place: np.ndarray) -> bool:
    joint, parameters = choose_columns(values, residual)
    local = _criterion(np.column_stack([joint, place]), parameters + place.shape[1], residual)
    fields = [_polynomial(place, degree) for degree in (2, 3)]
    return min(_criterion(field, field.shape[1], residual) for field in fields) < local - BETTER


def varies_with(residual: np.ndarray, direction: np.ndarray, second: np.ndarray) -> bool:
    """Whether the effect of a direction varies with a second variable: an interaction, beside both main effects.

    Args:
        residual: (n,) mm.
        direction: (n,), +1 or -1.
        second: the second variable, (n,).

    Returns:
        True where the F test of direction x (s, s^2), s the standardised second variable, is clear.
    """
    s, side = (second - second.mean()) / second.std(), np.sign(direction - 1e-9)
    curve = np.column_stack([np.ones_like(s), s, s**2])
    plain = np.column_stack([curve, side])
    full = np.column_stack([plain, side[:, None] * curve[:, 1:]])
    left = [np.square(residual - m @ np.linalg.lstsq(m, residual, rcond=None)[0]).sum() for m in (plain, full)]
    share = 1.0 - left[1] / max(left[0], 1e-300)
    return bool(minus_log_p(np.array([share]), 2, len(residual) - 6)[0] > CLEAR)


def _scaled(values: np.ndarray) -> np.ndarray:
    return 2.0 * (values - values.min()) / max(float(np.ptp(values)), 1e-12) - 1.0


def _polynomial(place: np.ndarray, degree: int) -> np.ndarray:
    """All monomials of the coordinates up to a degree, without the constant, (n, m)."""
    powers = [p for p in np.ndindex(*(degree + 1,) * place.shape[1]) if 0 < sum(p) <= degree]
    return np.column_stack([np.prod(place ** np.array(p), axis=1) for p in powers])


def _criterion(columns: np.ndarray, used: float, residual: np.ndarray) -> float:
    columns = np.column_stack([np.ones(len(residual)), columns])
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=1e-8)[0]
    rows = len(residual)
    return float(rows * np.log(max(float(left @ left), 1e-300)) + used * np.log(rows))
