"""What the unknown depends on: each block of an explanation as a curve over one variable."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.dependence.bins import binned_curve
from ptt.dependence.contexts import is_direction, loads_of, path_views, residual_views
from ptt.dependence.dependence import Dependence, of_run
from ptt.dependence.following import FAR, depends_on
from ptt.dependence.way import since_reversal
from ptt.diagnosis.evidence.atoms import is_block
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.joint_wander import JointWander
from ptt.diagnosis.telling.sizes import points_of, rms_beside_frames, size_of_unknown, sized
from ptt.diagnosis.telling.unknowns import Unexplained, Unknown
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.places import PlaceKind
from ptt.run.axes import AXES
from ptt.run.holdout import blocks as travel_blocks
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem

MOST_LINES = 5  # dependences that are listed
LEAST_SHARE = 0.005  # of an unexplained error that a listed dependence has: less is told as 0 %
ENOUGH_ALONE = 0.5  # share of an unknown from which one variable describes it
NO_VARIANCE = 1e-30  # mm^2 or rad^2, against division by zero
SAME_SHARE = 0.95  # share of what the best variable explains from which another explains as much: bins tell no finer
# Second variables that a reversal may vary with and a curve can show
SECOND_VARIABLES = ("temperature", "payload", "time")


def with_suspect(scorer: Scorer, state: State) -> State:
    """The set with the block that explains most under white noise, to show what an unknown may depend on.

    Args:
        scorer: of the system.
        state: the best set, where something is left that no block of it describes.

    Returns:
        The set with one more block; as given where no block raises the score.
    """
    plain = scorer.score(state.keys, WHITE, state.variances)
    blocks = scorer.screen(plain, is_block)
    if not blocks:
        return state
    best = blocks[0]
    more = scorer.score((*state.keys, best.key), WHITE, {**state.variances, best.key: best.variances})
    return more if more.total > plain.total else state


def dependences(unnamed: Unexplained, problem: Problem) -> tuple[Dependence, ...]:
    """Each block as the dependence of one residual on one variable.

    Args:
        unnamed: what the named effects leave, and the blocks.
        problem: n rows.

    Returns:
        At most `MOST_LINES`, the largest share first; beside the first none that has next to no share.
    """
    contexts, found = path_views(problem), list[Dependence]()
    for item in unnamed.unknowns:
        if item.energy < LEAST_SHARE and item is not unnamed.unknowns[0]:
            continue
        one = _dependence(item, unnamed.unknowns, unnamed.left, contexts, problem)
        if one is not None and not any(one.residual == o.residual and one.on == o.on for o in found):
            found.append(one)
    return tuple(found[:MOST_LINES])


def wandering(found: JointWander, left: np.ndarray, problem: Problem) -> Dependence:
    """The wander of a joint as its dependence on time.

    Args:
        found: the wander.
        left: what the named effects leave, the wander in it, (n, 3) mm; NaN on rows that do not count.
        problem: n rows.
    """
    share, chance = found.wander.share / (1.0 + found.wander.share), float(np.exp(-min(found.nats, 700.0)))
    curve = _centred_curve(problem.view.clock.numpy(), residual_views(problem, left)[found.residual])
    told = Dependence(found.residual, "time", share, chance, None, "smooth", curve, acts_on=found.residual)
    return of_run(sized((told,), left, problem)[0], problem)


def _dependence(
    item: Unknown, unknowns: Sequence[Unknown], rest: np.ndarray, contexts: dict[str, np.ndarray], problem: Problem
) -> Dependence | None:
    """One block: the residual in which it shows most, the variable that explains most of it, and its size."""
    if item.block.place.kind == "mount":
        return _along_tool(item, unknowns, rest, contexts, problem)
    alike = [other for other in unknowns if other.block.is_like(item.block)]
    others = sum((other.part for other in unknowns if not any(other is own for own in alike)), np.zeros_like(rest))
    parts, rests = residual_views(problem, item.part), residual_views(problem, rest - others)
    residuals = _residuals(item, parts)
    choices = [name for name in _variables(item, problem) if name in contexts]
    # A joint that arrived from one side but for a few readings has no context of direction; other variables serve.
    choices = choices or [name for name in item.block.on if name in contexts]
    if not choices:
        return None
    period = item.block.period
    folded = {name: contexts[name] if period is None else np.mod(contexts[name], period) for name in choices}
    explained = {name: {axis: _explained(folded[name], parts[axis]) for axis in residuals} for name in choices}
    on = _followed({name: sum(explained[name].values()) for name in choices}, item, problem)
    residual = max(residuals, key=lambda axis: explained[on][axis])
    seconds = (*SECOND_VARIABLES, *problem.table.watched)
    may_vary = (*seconds, *loads_of(problem))
    second = next((name for name in item.block.on[1:] if name in may_vary and is_direction(on)), None)
    shown = {name: contexts[name] for name in {on, second} - {None} if name in contexts}
    groups, travel = pose_groups(problem.table), travel_blocks(problem.table)
    reached = {residual: float(np.nanmax(np.abs(parts[residual]))) / FAR}  # what the unknown itself does is not clipped
    tested = [d for d in depends_on({residual: rests[residual]}, shown, groups, travel, noise=reached) if d.on == on]
    tested.sort(key=lambda one: one.with_ != second)
    if item.block.gradual:
        contexts = contexts | {"reversal": _since_reversal(item.block, problem)}
    found = _as_curve(item, residual, on, rests[residual], contexts, tested)
    if period is None and not item.block.reverses:
        beside = {name: contexts[name] for name in (*seconds, *AXES) if name in contexts}
        found = replace(found, rivals=_alike(found, item, beside | {on: contexts[on]}))
    alone = max(explained[on][residual] / max(float(np.nanvar(parts[residual])), NO_VARIANCE), 0.0)
    found = _of_several(found, item.block, alone, contexts[on], rests[residual], problem)
    found = replace(found, ranges=_ranges(found.together, contexts, rests[residual]))
    size = size_of_unknown(item, alike, found, rest - others if item.in_addition else rest, problem, contexts)
    return of_run(replace(found, size=size, points=points_of(found, rests[residual], contexts)), problem)


def _along_tool(
    item: Unknown, unknowns: Sequence[Unknown], rest: np.ndarray, contexts: dict[str, np.ndarray], problem: Problem
) -> Dependence | None:
    """`_dependence` of what moves in an arm's tool holder, its x, y and z along the tool's own axes."""
    axes = item.block.place.slopes
    found = {id(one): _turned(one, axes) for one in unknowns}
    told = _dependence(found[id(item)], [*found.values()], np.einsum("nca,nc->na", axes, rest), contexts, problem)
    if told is None or told.size is None or told.size.rms is None:
        return told
    alike = np.sum([one.part for one in unknowns if one.block.is_like(item.block)], axis=0)
    rows = np.isfinite(rest).all(axis=1)
    rms = rms_beside_frames(alike[rows], problem, rows)  # frames are seen from the base
    return replace(told, size=replace(told.size, rms=rms))


def _turned(item: Unknown, axes: np.ndarray) -> Unknown:
    """An unknown with its readings, and the directions of its place, along axes, (n, 3, 3)."""
    slopes = np.einsum("nca,ncw->naw", axes, item.block.place.slopes)
    kind: PlaceKind = "tool" if item.block.place.kind == "mount" else item.block.place.kind
    place = replace(item.block.place, kind=kind, slopes=slopes)
    return replace(item, block=replace(item.block, place=place), part=np.einsum("nca,nc->na", axes, item.part))


def _as_curve(
    item: Unknown, residual: str, on: str, left: np.ndarray, contexts: dict[str, np.ndarray], tested: list[Dependence]
) -> Dependence:
    """One residual, with what is unexplained by others left in it, (n,), as a curve over a variable.

    Args:
        item: the unknown.
        residual: name of the residual.
        on: the variable.
        left: that residual, (n,) mm or rad.
        contexts: variables by name, (n,) each.
        tested: dependences of the residual on the variable that a test by itself shows, the best first.
    """
    block, period, acts_on = item.block, item.block.period, _acts_on(item.block)
    share, chance = min(item.energy, 1.0), float(np.exp(-np.clip(item.nats, 0.0, 700.0)))
    if block.gradual:
        curve, q = _centred_curve(contexts["reversal"], left, np.sign(contexts[on])), contexts[block.on[1]]
        ends = float(q.min()), float(q.max())
        return Dependence(residual, on, share, chance, None, "gradual", curve, ends, "reversal", acts_on=acts_on)
    if period is not None and all(one.period_mm is None for one in tested):
        # The wave is finer than these readings show by themselves.
        curve = _centred_curve(np.mod(contexts[on], period), left)
        return Dependence(residual, on, share, chance, period, "period", curve, acts_on=acts_on)
    if tested:
        return replace(tested[0], share=share, p_value=chance, rivals=(), acts_on=acts_on)
    curve = _centred_curve(contexts[on], left)
    return Dependence(residual, on, share, chance, None, "smooth", curve, acts_on=acts_on)


def _of_several(
    found: Dependence, block: Block, alone: float, values: np.ndarray, left: np.ndarray, problem: Problem
) -> Dependence:
    """The dependence of an unknown that jumps, or that several variables describe, with the first one's share.

    Args:
        found: on the first of them.
        block: the unknown.
        alone: share of it that the first explains.
        values: of the first at each row, (n,).
        left: the residual, with what is unexplained by others left in it, (n,) mm or rad.
        problem: n rows.

    Returns:
        As given where one variable is enough.
    """
    if len(block.jumps) == 1 and found.on == block.on[0]:
        step = replace(found, shape="step", place=_between(values, block.jumps[0]), period_mm=None, with_=None)
        together = (found.on, *AXES)
        return replace(step, together=together, alone_share=alone * found.share) if block.is_change else step
    if block.is_spell:
        curve = _curve_of_levels(problem.view.clock.numpy(), left, block.jumps)
        return replace(found, shape="levels", place=None, moments=block.jumps, curve=curve)
    if not _is_field(block) or (alone >= ENOUGH_ALONE and not _is_of_one_axis(block)):
        return found
    return replace(  # the shape of a curve that leaves most of the unknown aside says nothing
        found, shape="smooth", place=None, period_mm=None, with_=None, rivals=(), together=block.on,
        alone_share=alone * found.share,
    )  # fmt: skip


def _ranges(names: Sequence[str], contexts: dict[str, np.ndarray], left: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Lowest and highest value of each variable at the readings of a residual, (n,); none where one is no context."""
    if not all(name in contexts for name in names):
        return ()
    read = [contexts[name][np.isfinite(left)] for name in names]
    return tuple((float(np.nanmin(values)), float(np.nanmax(values))) for values in read)


def _since_reversal(block: Block, problem: Problem) -> np.ndarray:
    """Travel of a block's joint since its last reversal, (n,) mm or rad."""
    return since_reversal(problem.view.q.numpy()[:, block.place.joint], problem.view.starts.numpy())


def _between(values: np.ndarray, jump: float) -> tuple[float, float]:
    """The last value, (n,), before a jump and the first one after it; a column of the user's own may lack some."""
    return float(values[values <= jump].max()), float(values[values > jump].min())


def _is_field(block: Block) -> bool:
    """Whether an unknown is a smooth function of several variables, so that a curve over one may be a small part."""
    return len(block.on) > 1 and block.period is None and not block.reverses and not block.gradual


def _is_of_one_axis(block: Block) -> bool:
    """Whether an unknown moves the tool along one axis, as a field over the workspace: a curve would explain less."""
    return _is_field(block) and block.place.residual in AXES and block.on[0] == "x"


def _centred_curve(values: np.ndarray, readings: np.ndarray, side: np.ndarray | float = 1.0) -> np.ndarray:
    """Binned curve of readings about their mean, multiplied by the direction of arrival where one is given."""
    rows = np.isfinite(values) & np.isfinite(readings)
    return binned_curve(values[rows], ((readings - readings[rows].mean()) * side)[rows])


def _curve_of_levels(time: np.ndarray, readings: np.ndarray, moments: Sequence[float]) -> np.ndarray:
    """Means of readings between moments with their 95 % confidence band, each at both ends of its level, (2 m, 3)."""
    rows = np.isfinite(readings)
    time, about = time[rows], (readings - readings[rows].mean())[rows]
    level = np.unique(np.searchsorted(np.array(moments), time), return_inverse=True)[1]
    _, mean, half = binned_curve(level.astype(float), about, len(time)).T
    ends = [[end(time[level == number]) for end in (np.min, np.max)] for number in range(len(mean))]
    return np.column_stack([np.ravel(ends), np.repeat(mean, 2), np.repeat(half, 2)])


def _alike(found: Dependence, item: Unknown, contexts: dict[str, np.ndarray]) -> tuple[str, ...]:
    """Other variables that would describe the unknown as well in this run, as temperature when it rises with time."""
    amount = _amount(item)
    if amount is None:
        return ()
    enough = SAME_SHARE * _explained(contexts[found.on], amount)
    if enough < ENOUGH_ALONE * amount.var():  # it follows no one variable, so none stands for another
        return ()
    others = (name for name in contexts if name not in (found.on, *item.block.on))
    return tuple(f"{found.residual} on {name}" for name in others if _explained(contexts[name], amount) > enough)


def _amount(item: Unknown) -> np.ndarray | None:
    """Amplitude of an unknown at each row apart from its place, (n,): its first principal component over directions."""
    if item.amounts is None:
        return None
    shapes = item.block.shapes
    ways = shapes @ item.amounts.values[item.own].reshape(-1, shapes.shape[1]).T  # features go way by way
    centred = ways - ways.mean(axis=0)
    return np.asarray(centred @ np.linalg.eigh(centred.T @ centred)[1][:, -1])


def _acts_on(block: Block) -> str | None:
    """The place on which a block acts: the set-up, the mount, or one of one direction and no field; None where open."""
    if block.place.residual in ("set-up", "mount", "load"):
        return block.place.residual
    field = len(block.on) > 1 and block.on[0] == "x" and not _is_of_one_axis(block)
    return None if field or block.place.slopes.shape[2] > 1 else block.place.residual


def _followed(explained: dict[str, float], item: Unknown, problem: Problem) -> str:
    """The variable that explains most; a joint's own travel where that explains nearly as much."""
    best, own = max(explained, key=lambda name: explained[name]), item.block.place.joint
    mine = None if own is None else f"{problem.file.machine.letter}{own + 1}"
    return mine if mine in explained and explained[mine] > SAME_SHARE * explained[best] else best


def _residuals(item: Unknown, parts: dict[str, np.ndarray]) -> tuple[str, ...]:
    """The joint that a block acts on, else the axes of the tool."""
    place = item.block.place
    if place.joint is None:
        return AXES
    return (next(name for name in parts if name.endswith(f" {place.joint + 1}")),)


def _variables(item: Unknown, problem: Problem) -> tuple[str, ...]:
    """Names of the context variables that may be a block's leading variable."""
    joints = range(1, problem.view.joints + 1)
    match item.block.on[0]:
        case "direction":
            return tuple(f"direction{i}" for i in joints)
        case "speed" | "velocity":
            own = item.block.place.joint
            return tuple(f"speed{i}" for i in joints) if own is None else (f"speed{own + 1}",)
        case "memory of temperature":
            return ("temperature",)
        case "way" | "turn" as name:
            return tuple(f"{name} {axis}" for axis in AXES)
        case "gravity x":
            return item.block.on
        case "x" if len(item.block.on) > 1:
            own = item.block.place.joint
            return AXES if own is None else (*AXES, f"{problem.file.machine.letter}{own + 1}")
        case name:
            return (name,)


def _explained(values: np.ndarray, part: np.ndarray) -> float:
    """Variance of a contribution that a binned curve over one variable explains."""
    rows = np.isfinite(values) & np.isfinite(part)
    curve = binned_curve(values[rows], part[rows])
    centred = part[rows] - part[rows].mean()
    middle = np.interp(values[rows], curve[:, 0], curve[:, 1])
    return float(np.square(centred).mean() - np.square(part[rows] - middle).mean())
