"""Odd shapes: whether one simple dependence that no effect describes does the work of many effects."""

import re
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from scipy import stats

from ptt.chain import trace
from ptt.dependence.contexts import COORDINATES, context_views, is_joint
from ptt.dependence.curves import binned_curve, corrected
from ptt.dependence.dependence import Dependence
from ptt.diagnosis.screen import toll
from ptt.diagnosis.walker import State, Walker
from ptt.diagnosis.wander import take_off
from ptt.sums import gain, project

SEARCHED = 500  # shapes and places that a search for one odd dependence tries
KNOTS = 9
HARMONICS = 2
HATS = 17  # of a local damage of any shape
SKIRT = 1.0  # its widths, on either side: damage fades out beyond the feet that a test finds
LOCAL = ("step", "bump", "period")  # what a smooth error map of an axis is not
DEGREES = (2, 3, 4)  # of a free field over the workspace
FIELD = 30.0  # chi-squared by which a free field, which fits much, has to beat known physics


@dataclass(frozen=True)
class Oddity:
    """A dependence as an explanation.

    Attributes:
        dependence: what depends on what.
        gain: sum of squares that it takes off, in whitened units.
        freedom: seen directions behind it.
        handicap: chi-squared by which it has to be better than others.
    """

    dependence: Dependence
    gain: float
    freedom: int
    handicap: float = 0.0

    def cost(self, misfit: float, spread: float, noise_freedom: float) -> float:
        """Misfit left with it, in noise units, its toll and its handicap."""
        return (misfit - self.gain) / spread + toll(self.freedom, noise_freedom, SEARCHED) + self.handicap


def weigh_oddities(walker: Walker, state: State, found: tuple[Dependence, ...]) -> list[Oddity]:
    """What each dependence would take off a state's residual if it were an effect.

    A dependence on a joint's own height, direction or speed acts on that joint; others act on the tool. A free
    smooth field over the workspace is weighed as well: what pulls at the platform from one side moves it by no function
    of one coordinate.

    Args:
        walker: of the problem.
        state: where the dependences were found.
        found: dependences.

    Returns:
        Those that are local, periodic or not of an axis, and free fields, largest gain first.
    """
    contexts = context_views(walker.problem)
    terms = [(term.effect, term.theta) for term in state.fitted.model.terms]
    by_joint = trace(terms, walker.problem.view).by_joint.numpy()
    oddities = []
    for item in found:
        if item.on not in contexts or item.on in ("time", "run"):
            continue
        if is_joint(item.on) and item.shape not in (*LOCAL, "varying"):
            continue
        for shapes in _shapes(item, contexts):
            took, seen = _gain(walker, state, _columns(item, shapes, by_joint))
            oddities.append(Oddity(item, took, seen))
    oddities += _weigh_fields(walker, state, found)
    return sorted(oddities, key=lambda oddity: -oddity.gain)


def _weigh_fields(walker: Walker, state: State, found: tuple[Dependence, ...]) -> list[Oddity]:
    """Free fields over the workspace, told by the coordinate of the tool that says most about the residual."""
    place = walker.problem.view.p.numpy()
    fields = [_on_every_axis(_monomials(place, degree)) for degree in DEGREES]
    gains = [_gain(walker, state, field) for field in fields]
    leading = next((item for item in found if item.on in COORDINATES), None)
    if leading is None:
        spread, freedom = state.screened.spread, state.screened.freedom
        chance = min((stats.f.sf(took / spread / seen, seen, freedom) for took, seen in gains if seen), default=1.0)
        leading = _leading_coordinate(state, place, float(min(1.0, chance * SEARCHED)))
    return [Oddity(leading, took, seen, FIELD) for took, seen in gains if seen]


def _leading_coordinate(state: State, place: np.ndarray, chance: float) -> Dependence:
    """The coordinate whose binned means take most off one axis of the residual."""
    rows = state.design.rows
    best: Dependence | None = None
    for axis, residual in zip(COORDINATES, state.fitted.residual[rows].T, strict=True):
        centred = residual - residual.mean()
        for on, values in zip(COORDINATES, place[rows].T, strict=True):
            curve = binned_curve(values, centred)
            means = curve[np.abs(values[:, None] - curve[:, 0]).argmin(axis=1), 1]
            share = 1.0 - float(np.square(centred - means).sum() / max(np.square(centred).sum(), 1e-300))
            share = corrected(share, len(curve) - 1.0, float(len(centred)))
            if best is None or share > best.share:
                best = Dependence(axis, on, share, chance, None, "smooth", curve)
    assert best is not None
    return best


def _shapes(item: Dependence, contexts: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Functions of the variable that the dependence may be, (n, m) for each fineness."""
    value = np.nan_to_num(contexts[item.on])
    if item.shape == "period" and item.period_mm:
        phase = 2.0 * np.pi * value[:, None] * np.arange(1, HARMONICS + 1) / item.period_mm
        return [np.column_stack([np.cos(phase), np.sin(phase)])]
    if item.shape in ("step", "bump") and item.place is not None:
        low, high = item.place
        if item.shape == "step":
            return [((value > 0.5 * (low + high)) * 1.0)[:, None]]
        few, many = ((high - low) * 0.5, 6), ((high - low) * SKIRT, HATS + 2)
        return [_hats(value, np.linspace(low - reach, high + reach, count), ends=False) for reach, count in (few, many)]
    if item.with_ is not None and item.with_ in contexts:
        second = np.nan_to_num(contexts[item.with_])
        return [value[:, None] * _hats(second, np.quantile(second, np.linspace(0.0, 1.0, 5)), ends=True)]
    return [_hats(value, np.unique(np.quantile(value, np.linspace(0.0, 1.0, KNOTS))), ends=True)]


def _hats(value: np.ndarray, knots: np.ndarray, *, ends: bool) -> np.ndarray:
    """Piecewise linear functions that are one at one knot and zero at the others, (n, m)."""
    columns = [np.interp(value, knots, unit) for unit in np.eye(len(knots))]
    return np.column_stack(columns if ends else columns[1:-1])


def _columns(item: Dependence, shapes: np.ndarray, by_joint: np.ndarray) -> np.ndarray:
    """Reading shift per unit of each shape, (n, 3, P) mm."""
    joint = re.fullmatch(r"(?:b|q|direction|speed)(\d+)", item.on)
    if joint:
        return by_joint[:, :, int(joint[1]) - 1, None] * shapes[:, None, :]
    return _on_every_axis(shapes)


def _on_every_axis(shapes: np.ndarray) -> np.ndarray:
    """Shapes (n, m) that shift x, y and z, each by itself, (n, 3, 3 m)."""
    return np.concatenate([np.eye(3)[axis][None, :, None] * shapes[:, None, :] for axis in range(3)], axis=-1)


def _monomials(place: np.ndarray, degree: int) -> np.ndarray:
    """Products of up to so many coordinates, each scaled to between -1 and 1, (n, m)."""
    low, high = np.nanmin(place, axis=0), np.nanmax(place, axis=0)
    scaled = (2.0 * place - low - high) / np.maximum(high - low, 1e-9)
    powers = (factors for size in range(1, degree + 1) for factors in combinations_with_replacement(range(3), size))
    return np.column_stack([scaled[:, list(factors)].prod(axis=1) for factors in powers])


def _gain(walker: Walker, state: State, columns: np.ndarray) -> tuple[float, int]:
    """What the columns take off the rows that count now, beyond the state's model, and their seen directions."""
    design = state.design
    scale = 0.02  # mm: an oddity of this size is worth seeing
    whitened = np.einsum("ij,njp->nip", design.noise.whitener, columns * scale)
    if walker.wander is not None:
        whitened = take_off(whitened, walker.wander, walker.problem, design.rows)
    base, rows = design.base, design.rows & ~walker.gross
    own = design.columns[rows][..., base].reshape(-1, len(base))
    joined = np.concatenate([own, whitened[rows].reshape(len(own), -1)], axis=1)
    values = design.values[rows].ravel()
    start = np.arange(len(base))
    projected = project(joined.T @ joined, joined.T @ values, float(values @ values), start)
    return gain(projected, np.arange(len(base), joined.shape[1]))
