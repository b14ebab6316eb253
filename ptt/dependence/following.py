"""What a residual depends on: a test of every residual against every variable, and the likelier cause of a tie."""

from dataclasses import replace

import numpy as np

from ptt.dependence.causes import position_explains_more, varies_with
from ptt.dependence.chance import gumbel_tail
from ptt.dependence.contexts import context_views, is_joint, own_joint, remove_frame, residual_views
from ptt.dependence.curves import LOCAL, describe
from ptt.dependence.dependence import Dependence, of_run
from ptt.dependence.scores import Score, build_scores
from ptt.dependence.strata import LEAST_POSES, RepeatedPoses, find_poses
from ptt.run.axes import AXES
from ptt.run.holdout import blocks as travel_blocks
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem
from ptt.run.tails import median_sigma

LEVEL = 0.005  # significance level of the family of all tests
MOST_ROWS = 3000  # of more rows a random sample is tested: its power suffices
FAR = 6.0  # robust standard deviations at which residuals are clipped
NEAR = 0.9  # ratio of two shares, above which they are a tie
KNOWN = 0.8  # share of rows with a value, below which a variable is not tested
NOTHING = 1e-9  # mm or rad: a residual that is nowhere larger is zero but for rounding, as across a flat arm's plane
FLAT = 1e-9  # range in the variable's own unit, below which it is constant but for rounding
OTHERS = 3  # rows with another than the commonest value, below which a variable is not tested


def dependence_of(problem: Problem, residual: np.ndarray) -> tuple[Dependence, ...]:
    """What the residual of a problem depends on.

    Args:
        problem: n rows.
        residual: (n, 3) mm, base frame, NaN on rows to leave out. Keep the outliers of a robust fit, which may be a
            local fault; gross errors are clipped here.

    Returns:
        Significant dependences, largest share first.
    """
    views = residual_views(problem, remove_frame(problem, _thinned(residual, problem.used)))
    noise = None
    if problem.noise is not None:
        noise = dict(zip(AXES, map(float, problem.noise.sigma), strict=True))
    found = depends_on(
        views, context_views(problem), pose_groups(problem.table), travel_blocks(problem.table), noise=noise
    )
    return tuple(of_run(item, problem) for item in found)


def depends_on(
    residuals: dict[str, np.ndarray],
    contexts: dict[str, np.ndarray],
    groups: np.ndarray,
    blocks: np.ndarray,
    *,
    noise: dict[str, float] | None = None,
    seed: int = 0,
) -> tuple[Dependence, ...]:
    """Test every residual against every variable.

    The best of several trial functions counts for each variable (smooth curve, bins, steps, bumps, periods). p-values
    refer to the largest statistic over all pairs under joint permutation of the rows (Westfall and Young 1993), with a
    Gumbel tail. Rows are first whitened for the error that repeats of a pose share; p-values of variables that change
    slowly over the run allow for slow error.

    Args:
        residuals: (n,) mm each, rows in travel order, NaN where not observed.
        contexts: (n,) each.
        groups: (n,) int, equal for visits of one pose; rows below zero are left out.
        blocks: (n,) int, contiguous blocks of travel; errors slower than a block count as slow.
        noise: residual -> standard deviation of its noise, mm: a lower bound of the scale at which it is clipped.
        seed: of the permutations.

    Returns:
        Significant dependences, largest share first; where two tie, the residual of a joint against that joint's own
        variable comes before others, which are then named as its rivals.
    """
    rows = _rows(residuals, groups, seed)
    contexts = _tidy(contexts, rows)
    residuals = {name: own for name, own in residuals.items() if np.abs(own[rows]).max(initial=0.0) > NOTHING}
    if len(rows) < LEAST_POSES or not contexts or not residuals:
        return ()
    values = np.column_stack([_cut(column[rows], (noise or {}).get(name, 0.0)) for name, column in residuals.items()])
    data = (values / np.maximum(values.std(axis=0), 1e-15)).astype(np.float32)
    poses = find_poses(data, np.asarray(groups)[rows])
    scores = build_scores(data, contexts, poses, seed=seed)
    found = _significant(scores, slow=max(4, len(np.unique(np.asarray(blocks)[rows]))))
    data_of = dict(zip(residuals, values.T, strict=True))
    described = _only_clear(_describe(found, data_of, contexts, poses), data_of, contexts)
    return _settle(described, data_of, contexts, poses)


def _significant(scores: list[Score], slow: int) -> list[tuple[Score, int, float]]:
    """(score, index of the residual, p-value over all pairs) of each significant pair."""
    if not scores:
        return []
    largest = np.max([score.chance for score in scores], axis=0)
    found = []
    for score in scores:
        for r in np.flatnonzero(gumbel_tail(score.found, largest) <= LEVEL):
            p_value = float(gumbel_tail(score.corrected(int(r), slow), largest))
            if p_value <= LEVEL:
                found.append((score, int(r), p_value))
    return found


def _thinned(residual: np.ndarray, used: np.ndarray) -> np.ndarray:
    """The residual of a random sample of rows, NaN elsewhere; of few rows the whole."""
    rows = np.flatnonzero(used & np.isfinite(residual).all(axis=1))
    if len(rows) <= MOST_ROWS:
        return residual
    chosen = np.random.default_rng(0).choice(rows, MOST_ROWS, replace=False)
    thinned = np.full_like(residual, np.nan)
    thinned[chosen] = residual[chosen]
    return thinned


def _rows(residuals: dict[str, np.ndarray], groups: np.ndarray, seed: int) -> np.ndarray:
    known = np.asarray(groups) >= 0
    for values in residuals.values():
        known = known & np.isfinite(values)
    rows = np.flatnonzero(known)
    if len(rows) > MOST_ROWS:
        rows = np.sort(np.random.default_rng(seed).choice(rows, MOST_ROWS, replace=False))
    return rows


def _tidy(contexts: dict[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Contexts on the rows that count, gaps interpolated; without those that hardly vary or have many gaps."""
    tidy = {}
    for name, column in contexts.items():
        values = np.asarray(column, dtype=float)[rows]
        known = np.isfinite(values)
        if known.mean() < KNOWN:
            continue
        values = np.interp(rows, rows[known], values[known])
        commonest = np.unique(values, return_counts=True)[1].max()
        if np.ptp(values) > FLAT and len(rows) - commonest >= OTHERS:
            tidy[name] = values
    return tidy


def _cut(values: np.ndarray, sigma: float) -> np.ndarray:
    centre = np.median(values)
    reach = FAR * max(float(median_sigma(values - centre)), sigma)
    reach = reach if reach > 0 else np.inf
    return np.clip(values, centre - reach, centre + reach) - centre


def _describe(
    found: list[tuple[Score, int, float]],
    data: dict[str, np.ndarray],
    contexts: dict[str, np.ndarray],
    poses: RepeatedPoses,
) -> list[Dependence]:
    names, described = list(data), []
    for score in {id(item[0]): item[0] for item in found}.values():
        chosen = [(names[r], p_value) for other, r, p_value in found if other is score]
        variable = score.variable
        second = None if variable.second is None else contexts[variable.second]
        residual = np.column_stack([data[name] for name, _ in chosen])
        findings = describe(residual, contexts[variable.name], second, variable.on_rows(), score.parameters, poses)
        for (name, p_value), finding in zip(chosen, findings, strict=True):
            described.append(
                Dependence(
                    name, variable.name, finding.share, p_value, finding.period, finding.shape, finding.curve,
                    finding.place, variable.second,
                )
            )  # fmt: skip
    return described


def _only_clear(
    described: list[Dependence], data: dict[str, np.ndarray], contexts: dict[str, np.ndarray]
) -> list[Dependence]:
    """Leave out interactions of a direction and a second variable that both main effects explain as well."""
    kept = []
    for item in described:
        steady = item.with_ is not None and not varies_with(
            data[item.residual], contexts[item.on], contexts[item.with_]
        )
        if item.share > 0 and not steady:
            kept.append(item)
    return kept


def _settle(
    described: list[Dependence], data: dict[str, np.ndarray], contexts: dict[str, np.ndarray], poses: RepeatedPoses
) -> tuple[Dependence, ...]:
    """Sort by share; of a tie at the top, only the likeliest cause stays, with the others as its rivals."""
    ranked = sorted(described, key=lambda item: -item.share)
    if not ranked:
        return ()
    tied = [item for item in ranked if item.share >= NEAR * ranked[0].share]
    first = min(tied, key=lambda item: (_remoteness(item), -item.share))
    if _remoteness(first) == _remoteness(ranked[0]):
        first = ranked[0]
    smooth = is_joint(first.on) and first.shape not in LOCAL
    if smooth and position_explains_more(first.residual, first.on, data, contexts, poses):
        first = next((item for item in ranked if item.on in AXES), first)
    above = ranked[: ranked.index(first)]
    rivals = tuple(dict.fromkeys(f"{item.residual} on {item.on}" for item in above))
    return (replace(first, rivals=rivals), *ranked[len(above) + 1 :])


def _remoteness(item: Dependence) -> int:
    """Rank of a variable as a cause: 0 the joint's own, 1 a joint with a local curve, 2 any other, 3 time or run."""
    if own_joint(item.residual, item.on):
        return 0
    if is_joint(item.on) and item.shape in LOCAL:
        return 1
    return 3 if item.on in ("time", "run") else 2
