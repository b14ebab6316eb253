"""The curve behind a dependence: which shape it has, how much it explains, where it sits, its means and band."""

from dataclasses import dataclass

import numpy as np

from ptt.dependence.periods import harmonics, refine_frequency
from ptt.dependence.regressors import Atoms, build_atoms, orthonormal, raised_cosine
from ptt.dependence.strata import RepeatedPoses

ROUNDING = 1e-3  # of the range of a variable
BINS = 12
PHASES = 10
EDGE = 3.84  # chi-square of one degree of freedom, 95 %
HALF = 1.96
LOCAL = ("step", "bump", "period")


@dataclass(frozen=True)
class FittedCurve:
    """A curve.

    Attributes:
        share: 0 to 1, of the variance, less what chance explains.
        shape: 'levels', 'smooth', 'step', 'bump', 'period' or 'varying'.
        period: in the variable's unit, or None.
        place: (low, high) of a step or bump, or None.
        curve: (m, 3) centres, means, half-widths of the 95 % band.
    """

    share: float
    shape: str
    period: float | None
    place: tuple[float, float] | None
    curve: np.ndarray


@dataclass(frozen=True)
class _Choice:
    kind: int
    atom: int
    smooth: bool  # whether a cubic goes with it
    share: float
    toll: float  # directions that chance would have used up


def describe(
    residual: np.ndarray,
    values: np.ndarray,
    second: np.ndarray | None,
    atoms: tuple[Atoms, ...],
    toll: np.ndarray,
    poses: RepeatedPoses,
) -> list[FittedCurve]:
    """Describe how residuals follow one variable.

    Args:
        residual: (n, m) mm.
        values: (n,) the variable.
        second: (n,) the variable that its say varies with, or None.
        atoms: its trial functions, raw.
        toll: directions that chance uses up in the search, for each kind.
        poses: repeated visits.

    Returns:
        A finding for each residual.
    """
    centred = residual - residual.mean(axis=0)
    total = np.maximum(np.square(centred).sum(axis=0), 1e-300)
    data = (centred / np.sqrt(total)).astype(np.float32)
    amount = _independent(values, poses)
    choices = _candidates(atoms, toll, data)
    chosen = [_choose(row, amount) for row in choices]
    return [_finish(choice, centred[:, i], values, second, atoms, amount) for i, choice in enumerate(chosen)]


def _independent(values: np.ndarray, poses: RepeatedPoses) -> float:
    """How many independent rows the data amount to for this variable (Kish's design effect)."""
    if len(poses.size) == len(values) or not poses.holds(values):
        return float(len(values))
    usual = float(np.square(poses.size).sum() / poses.size.sum())
    return len(values) / (1.0 + poses.alike * (usual - 1.0))


def _candidates(atoms: tuple[Atoms, ...], toll: np.ndarray, data: np.ndarray) -> list[list[_Choice]]:
    """The best trial function of every kind, by itself and on top of a cubic, for every residual."""
    choices: list[list[_Choice]] = [[] for _ in range(data.shape[1])]
    flat = np.full((len(data), 1), 1.0 / np.sqrt(len(data)), np.float32)
    ready = [orthonormal(kind, flat) for kind in atoms]
    smooth = next((i for i, kind in enumerate(atoms) if kind.kind == "smooth"), None)
    for k, trial in enumerate(ready):
        _add(choices, trial, k, data, np.zeros(data.shape[1]), toll[k], smooth=False)
        if smooth is not None and trial.kind in LOCAL:
            base = ready[smooth].columns
            rest = orthonormal(trial, base)
            taken = np.square(base.T @ data).sum(axis=0)
            _add(choices, rest, k, data, taken, toll[k] + 3.0, smooth=True)
    return choices


def _add(
    choices: list[list[_Choice]],
    trial: Atoms,
    k: int,
    data: np.ndarray,
    taken: np.ndarray,
    toll: float,
    *,
    smooth: bool,
) -> None:
    share = trial.shares(data)
    best = share.argmax(axis=0)
    for i, row in enumerate(choices):
        row.append(_Choice(k, int(best[i]), smooth, float(taken[i] + share[best[i], i]), float(toll)))


def _choose(row: list[_Choice], amount: float) -> _Choice:
    """Bayesian information criterion, the search for the best trial function counted as directions used."""
    return min(row, key=lambda c: amount * np.log(max(1.0 - c.share, 1e-9)) + c.toll * np.log(amount))


def choose_columns(values: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, float]:
    """The trial function that suits best, as columns to fit with others.

    Args:
        values: (n,) a joint's values.
        residual: (n,) mm.

    Returns:
        Columns (n, d), and the directions they use up, one more for each unknown place or period.
    """
    atoms = build_atoms(values, periodic=True)
    centred = residual - residual.mean()
    data = (centred / max(float(np.linalg.norm(centred)), 1e-300)).astype(np.float32)[:, None]
    toll = np.array([kind.dims + (kind.kind in LOCAL) * 2.0 * np.log(kind.columns.shape[1]) for kind in atoms])
    choice = _choose(_candidates(atoms, toll, data)[0], float(len(values)))
    columns = atoms[choice.kind].pick(choice.atom).astype(float)
    if choice.smooth:
        columns = np.column_stack([columns, np.polynomial.legendre.legvander(_scaled(values), 3)[:, 1:]])
    return columns, choice.toll


def corrected(share: float, toll: float, amount: float) -> float:
    """Share of variance less what chance explains (adjusted R^2).

    Args:
        share: raw, 0 to 1.
        toll: directions used up.
        amount: independent rows.

    Returns:
        0 to 1.
    """
    left = max(amount - 1.0 - toll, 0.25 * amount, 1.0)
    return float(np.clip(1.0 - (1.0 - share) * (amount - 1.0) / left, 0.0, 1.0))


def _finish(
    choice: _Choice,
    residual: np.ndarray,
    values: np.ndarray,
    second: np.ndarray | None,
    atoms: tuple[Atoms, ...],
    amount: float,
) -> FittedCurve:
    kind, share = atoms[choice.kind], choice.share
    period, place, toll = None, None, choice.toll
    base = np.polynomial.legendre.legvander(_scaled(values), 3 if choice.smooth else 0)
    if kind.kind == "period":
        period, share, more = _period(base, residual, values, float(kind.low[choice.atom]), amount)
        toll += more
    elif kind.kind == "step":
        place, share = _step(base, residual, values, float(kind.low[choice.atom]))
    elif kind.kind == "bump":
        place, share = _bump(base, residual, values, float(kind.low[choice.atom]), float(kind.high[choice.atom]))
    shape = "smooth" if kind.kind in ("wavy", "bins") else kind.kind
    if second is not None:
        curve = binned_curve(second, np.sign(values - 1e-9) * residual)
    elif period is not None:
        curve = binned_curve(np.mod(values, period), residual, PHASES)
    else:
        curve = binned_curve(values, residual)
    return FittedCurve(corrected(max(share, choice.share), toll, amount), shape, period, place, curve)


def _scaled(values: np.ndarray) -> np.ndarray:
    return 2.0 * (values - values.min()) / np.ptp(values) - 1.0


def _share(columns: np.ndarray, residual: np.ndarray) -> float:
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    return 1.0 - float(left @ left) / max(float(residual @ residual), 1e-300)


def _period(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, frequency: float, amount: float
) -> tuple[float, float, float]:
    """Period, share, and extra directions: a second harmonic where it earns its place."""
    rest = residual - base @ np.linalg.lstsq(base, residual, rcond=None)[0]
    frequency = refine_frequency(values, rest, frequency)
    one = _share(np.column_stack([base, harmonics(values, np.array([frequency]))]), residual)
    two = _share(np.column_stack([base, harmonics(values, np.array([frequency, 2.0 * frequency]))]), residual)
    better = amount * np.log(max(1.0 - two, 1e-9) / max(1.0 - one, 1e-9)) + 2.0 * np.log(amount) < 0
    return (1.0 / frequency, two, 2.0) if better else (1.0 / frequency, one, 0.0)


def _step(base: np.ndarray, residual: np.ndarray, values: np.ndarray, near: float) -> tuple[tuple[float, float], float]:
    """Where the step lies, with 95 % confidence, and its share: every place between two heights near the best trial."""
    levels = np.unique(values)
    at = int(np.searchsorted(levels, near))
    reach = max(len(levels) // 20, 3)
    last = np.arange(max(at - reach, 0), min(at + reach + 1, len(levels) - 1))
    column = (values[:, None] > (levels[last] + levels[last + 1]) / 2).astype(float)
    share = _added_shares(base, residual, column)
    best = int(np.argmax(share))
    spread = (1.0 - share[best]) / max(len(values) - base.shape[1] - 1, 1)
    inside = last[share >= share[best] - EDGE * spread]
    return (float(levels[inside.min()]), float(levels[inside.max() + 1])), float(share[best])


def _bump(
    base: np.ndarray, residual: np.ndarray, values: np.ndarray, low: float, high: float
) -> tuple[tuple[float, float], float]:
    """Feet of the bump, and its share."""
    middle, width = (low + high) / 2, high - low
    shift, stretch = np.meshgrid(np.linspace(-0.4, 0.4, 9), (0.7, 0.85, 1.0, 1.2, 1.4))
    middles, widths = middle + shift.ravel() * width, stretch.ravel() * width
    share = _added_shares(base, residual, raised_cosine(values, middles, widths).astype(float))
    best = int(np.argmax(share))
    feet = (float(middles[best] - widths[best] / 2), float(middles[best] + widths[best] / 2))
    return feet, float(share[best])


def _added_shares(base: np.ndarray, residual: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Share of base and one column together, for every column."""
    basis = np.linalg.qr(base)[0]
    left = residual - basis @ (basis.T @ residual)
    clean = columns - basis @ (basis.T @ columns)
    length = np.square(clean).sum(axis=0)
    taken = np.square(clean.T @ left) / np.where(length > 1e-9 * len(residual), length, np.inf)
    return 1.0 - (float(left @ left) - taken) / max(float(residual @ residual), 1e-300)


def binned_curve(values: np.ndarray, residual: np.ndarray, count: int = BINS) -> np.ndarray:
    """Binned means with their confidence band.

    Args:
        values: (n,) the variable.
        residual: (n,) mm.
        count: bins of equal count; a variable with fewer levels has one for each. Levels next to each other are one.

    Returns:
        (m, 3) centres, means, half-widths of the 95 % confidence band of each mean.
    """
    number, centre = bins_of(values, count)
    size = np.bincount(number).astype(float)
    mean = np.bincount(number, residual) / size
    spread = np.bincount(number, np.square(residual - mean[number])) / np.maximum(size - 1.0, 1.0)
    pooled = np.square(residual - mean[number]).sum() / max(len(residual) - len(size), 1)
    # Few rows tell little about their own scatter.
    spread = (spread * (size - 1.0) + 4.0 * pooled) / (size + 3.0)
    return np.column_stack([centre, mean, HALF * np.sqrt(spread / size)])


def bins_of(values: np.ndarray, count: int = BINS) -> tuple[np.ndarray, np.ndarray]:
    """Put values in bins.

    Args:
        values: (n,).
        count: bins of equal count; a variable with fewer levels has one for each. Levels next to each other are one.

    Returns:
        (n,) int number of each, and (m,) mean of the values in each.
    """
    levels = np.unique(values)
    cuts = levels[1:] if len(levels) <= count else np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    apart = np.diff(cuts, prepend=levels[0]) > ROUNDING * (levels[-1] - levels[0])
    cuts = cuts[apart]  # what differs by no more than digits of a table is one level
    number = np.unique(np.searchsorted(cuts, values, side="right"), return_inverse=True)[1].reshape(-1)
    return number, np.bincount(number, values) / np.bincount(number)
