"""Training: data in, the network that holds out best, or the null network, out."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from nets.centres import kmeans_centres
from nets.design import Design, build_design
from nets.domain import Domain, measure_domain
from nets.errors import TrainingDataError
from nets.network import GaussianRbf
from nets.result import Candidate, RbfTraining, TriedSetting
from nets.scaling import FloatArray, input_scaling
from nets.selection import HeldOut, IntArray, choose, deal_folds, heldout_squares, judge
from nets.settings import RbfSettings
from nets.weights import NormalEquations, descend_gradient, normal_equations, products, ridge_path
from nets.widths import nearest_widths, shared_widths


@dataclass(frozen=True, eq=False)
class _Data:
    """Checked training rows in scaled inputs."""

    inputs: FloatArray
    outputs: FloatArray
    scaled: FloatArray
    scaling: tuple[FloatArray, FloatArray]
    domain: Domain


def train_rbf(
    inputs: npt.ArrayLike, outputs: npt.ArrayLike, groups: npt.ArrayLike, *, settings: RbfSettings | None = None
) -> RbfTraining:
    """Train a Gaussian RBF network, its settings chosen by the error on held-out groups.

    Centres and scaling use the inputs of all rows, no outputs: they are unsupervised. Outputs are best displacements:
    far from all centres the nodes vanish and the threshold (and straight line) is left.

    Args:
        inputs: (n, m), any unit per column.
        outputs: (n, o).
        groups: (n,) integers; rows of one group are held out together: whole blocks of travel, all visits of a pose.
            Make them longer than the correlation time of the noise, else drift is learned.
        settings: candidates and rules; the defaults where None.

    Returns:
        The network and how it was found.

    Raises:
        TrainingDataError: shapes that do not match, numbers that are not finite, fewer than two groups.
    """
    settings = settings or RbfSettings()
    data, codes = _check_data(inputs, outputs), _check_groups(groups, len(np.asarray(inputs)))
    candidates, centres = _candidates(data, settings)
    folds = deal_folds(codes, settings.folds, settings.seed)
    squares = [heldout_squares(_design(data, each, centres, settings), folds, settings) for each in candidates]
    null = np.stack([np.square(data.outputs[rows]).sum(axis=0) for rows in folds])
    places = len(np.unique(data.scaled, axis=0))
    held_out = HeldOut(np.stack(squares), null, np.array([len(rows) for rows in folds]), places)
    choice = choose(held_out, null_candidate=settings.null_candidate)
    verdict = judge(held_out, settings)
    chosen = candidates[choice.candidate] if verdict.learned.any() else Candidate(0, 0.0, False)
    ridges = np.asarray(settings.ridges)[choice.ridge]
    network, curve = _fit(data, chosen, centres, ridges, verdict.learned, settings)
    return RbfTraining(
        network=network,
        chosen=chosen,
        ridges=np.where(verdict.learned & (chosen.centres > 0), ridges, 0.0),
        heldout_rms=verdict.heldout_rms,
        null_rms=verdict.null_rms,
        p_value=verdict.p_value,
        learned=verdict.learned,
        fitted_rms=np.sqrt(np.mean(np.square(data.outputs - network.predict(data.inputs)), axis=0)),
        tried=_table(candidates, held_out, settings),
        mse_curve=curve,
    )


def muted(training: RbfTraining, kept: npt.NDArray[np.bool_]) -> RbfTraining:
    """Set outputs of a trained network to zero, as if they had not been learned.

    Args:
        training: a trained network.
        kept: (o,) outputs that stay as they are; the others become zero.

    Returns:
        The training unchanged where all learned outputs are kept; the null network where none is left.
    """
    learned = training.learned & kept
    if (learned == training.learned).all():
        return training
    nodes = slice(None) if learned.any() else slice(0)
    tensors = {name: value.numpy() for name, value in training.network.state_dict().items()}
    tensors |= {name: tensors[name] * learned for name in ("weights", "threshold", "slope")}
    tensors |= {name: tensors[name][nodes] for name in ("centres", "widths", "weights")}
    chosen = training.chosen if learned.any() else Candidate(0, 0.0, False)
    ridges = np.where(learned, training.ridges, 0.0)
    network = GaussianRbf.from_tensors(tensors)
    # Of an output set to zero, training and held-out error are those of the null network.
    heldout, fitted = (np.where(learned, rms, training.null_rms) for rms in (training.heldout_rms, training.fitted_rms))
    return replace(
        training, network=network, chosen=chosen, ridges=ridges, learned=learned, heldout_rms=heldout, fitted_rms=fitted
    )


def fit_rbf(
    inputs: npt.ArrayLike,
    outputs: npt.ArrayLike,
    *,
    centres: int,
    spread: float,
    ridge: float = 1e-8,
    affine: bool = False,
    settings: RbfSettings | None = None,
) -> GaussianRbf:
    """Fit a Gaussian RBF network with everything given: nothing is held out, nothing is chosen.

    Args:
        inputs: (n, m).
        outputs: (n, o).
        centres: number of nodes.
        spread: as in `RbfSettings.spreads`.
        ridge: as in `RbfSettings.ridges`.
        affine: whether there is a straight-line part.
        settings: widths, method, seed and restarts; its candidates are not used.

    Returns:
        The network.

    Raises:
        TrainingDataError: shapes that do not match, numbers that are not finite.
    """
    given = Candidate(centres, spread, affine)
    settings = settings or RbfSettings()
    data = _check_data(inputs, outputs)
    nodes = {centres: kmeans_centres(data.scaled, centres, seed=settings.seed, restarts=settings.restarts)}
    count = data.outputs.shape[1]
    network, _ = _fit(data, given, nodes, np.full(count, ridge), np.ones(count, dtype=bool), settings)
    return network


def _check_data(inputs: npt.ArrayLike, outputs: npt.ArrayLike) -> _Data:
    x, y = np.asarray(inputs, dtype=np.float64), np.asarray(outputs, dtype=np.float64)
    if x.ndim != 2 or y.ndim != 2 or len(x) != len(y) or min(x.shape + y.shape) < 1:
        raise TrainingDataError(f"inputs {x.shape} and outputs {y.shape}: give (n, m) and (n, o) with the same n >= 1")
    bad = np.flatnonzero(~(np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)))
    if bad.size:
        raise TrainingDataError(f"training row {bad[0]} (of {bad.size}) is not finite; leave such rows out")
    scaling = input_scaling(x)
    scaled = (x - scaling[0]) / scaling[1]
    return _Data(x, y, scaled, scaling, measure_domain(scaled))


def _check_groups(groups: npt.ArrayLike, rows: int) -> IntArray:
    codes = np.asarray(groups)
    if codes.shape != (rows,) or not np.issubdtype(codes.dtype, np.integer):
        raise TrainingDataError(f"groups {codes.dtype} {codes.shape}: give one integer for each of the {rows} rows")
    if len(np.unique(codes)) < 2:
        raise TrainingDataError("all rows are in one group, so none can be held out; give two groups or more")
    return codes.astype(np.int64)


def _candidates(data: _Data, settings: RbfSettings) -> tuple[list[Candidate], dict[int, FloatArray]]:
    # Simple ones first: the choice takes the first at a tie.
    candidates = [Candidate(0, 0.0, affine) for affine in sorted(settings.affine)]
    centres = {0: np.empty((0, data.scaled.shape[1]))}
    for wanted in sorted(set(settings.centre_counts)):
        nodes = kmeans_centres(data.scaled, wanted, seed=settings.seed, restarts=settings.restarts)
        if len(nodes) not in centres:
            centres[len(nodes)] = nodes
            pairs = [(spread, affine) for spread in settings.spreads for affine in sorted(settings.affine)]
            candidates += [Candidate(len(nodes), spread, affine) for spread, affine in pairs]
    return candidates, centres


def _widths(centres: FloatArray, spread: float, settings: RbfSettings) -> FloatArray:
    if settings.widths == "nearest":
        return nearest_widths(centres, spread, settings.neighbours)
    return shared_widths(centres, spread)


def _design(data: _Data, candidate: Candidate, centres: dict[int, FloatArray], settings: RbfSettings) -> Design:
    nodes = centres[candidate.centres]
    widths = _widths(nodes, candidate.spread, settings)
    return build_design(data.scaled, data.outputs, nodes, widths, affine=candidate.affine)


def _fit(
    data: _Data,
    chosen: Candidate,
    centres: dict[int, FloatArray],
    ridges: FloatArray,
    learned: npt.NDArray[np.bool_],
    settings: RbfSettings,
) -> tuple[GaussianRbf, FloatArray]:
    design = _design(data, chosen, centres, settings)
    equations = normal_equations(products(design.background, design.features, design.outputs))
    weights, curve = _solve(equations, ridges, settings)
    threshold, slope = design.threshold_and_slope(equations.background(weights), weights)
    slope = slope if chosen.affine else np.zeros((data.scaled.shape[1], len(learned)))
    nodes = centres[chosen.centres]
    network = GaussianRbf(
        scaling=data.scaling,
        centres=nodes,
        widths=_widths(nodes, chosen.spread, settings),
        weights=weights * learned,
        threshold=threshold * learned,
        slope=slope * learned,
        domain=data.domain,
    )
    return network, curve


def _solve(equations: NormalEquations, ridges: FloatArray, settings: RbfSettings) -> tuple[FloatArray, FloatArray]:
    if settings.method == "gradient":
        return descend_gradient(equations, ridges, rate=settings.rate, epochs=settings.epochs)
    outputs = np.arange(len(ridges))
    path = ridge_path(equations, ridges)  # (o, q, o): the ridge of one output along the first axis
    return path[outputs, :, outputs].T, np.empty((0, len(ridges)))


def _table(candidates: list[Candidate], held_out: HeldOut, settings: RbfSettings) -> tuple[TriedSetting, ...]:
    rms = np.sqrt(held_out.squares.sum(axis=2) / held_out.rows.sum())  # (c, r, o)
    return tuple(
        TriedSetting(candidate, ridge if candidate.centres else 0.0, tuple(row.tolist()))
        for candidate, rows in zip(candidates, rms, strict=True)
        for ridge, row in zip(settings.ridges if candidate.centres else (0.0,), rows, strict=False)
    )
