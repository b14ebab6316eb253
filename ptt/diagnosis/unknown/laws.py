"""Every law that a run can show: one place times one variable, as a curve, as jumps, or as levels."""

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ptt.dependence.contexts import hanging_of, is_direction, load_name, loads_of, path_views
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.blocks import field_over
from ptt.diagnosis.unknown.jumps import Jump, heights_of, passed_again, sides_of, spells_of, switches_of
from ptt.diagnosis.unknown.places import Place, mount_of, one_way_each, places_of_chain, stand_of, tool_axes
from ptt.diagnosis.unknown.smooth import column_ends, cosines, reined, scaled
from ptt.effects.curve import STEP_DEGREE
from ptt.effects.curve_basis import GRAVITY
from ptt.model.chain import Chain
from ptt.run.problem import Problem

# Cosines over a joint's own travel, where wear and joints of rails are short; over all else that varies; and over what
# modulates the direction of arrival, which only fades or grows.
OWN_COSINES, OTHER_COSINES, ARRIVAL_COSINES = 48, 16, 6
# Variables that no place of the machine follows by a curve: fields and blocks have them
NO_CURVES = re.compile("run|(way|turn) [xyz]")
SHORTEST_MOVE = 1e-3  # share of the longest move below which moves count as that, before the logarithm


Switching = Mapping[str, Sequence[float]]  # place of one direction, or tool -> moments at which it switches


def laws_of(
    problem: Problem,
    chain: Chain,
    moments: Sequence[float] = (),
    switching: Switching | None = None,
) -> Iterator[list[Block]]:
    """Every law: each place times each variable.

    Args:
        problem: n rows.
        chain: of the present model.
        moments: at which something seems to have happened, by the clock, ascending.
        switching: place -> moments at which it seems to have switched, ascending; the tool's also for set-up and mount.

    Yields:
        The laws of one place after another.
    """
    levels = dict(switching or {})
    levels["set-up"] = levels["mount"] = levels.get("tool", ())
    letter, q, varied = problem.file.machine.letter, problem.view.q.numpy(), dict(_curves(problem))
    passed, spells = list(passed_again(problem)), list(spells_of(problem, moments))
    finer = {f"{letter}{joint + 1}": _curve(q[:, joint], OWN_COSINES) for joint in range(problem.view.joints)}
    hung = [(on, varied.pop(on)) for on in GRAVITY if on in varied]
    loads = loads_of(problem)
    loaded = {on: varied.pop(on) for on in loads if on in varied}
    for place in _places(problem, chain):
        if place.joint is None:
            yield [*(_law(place, (on,), shapes) for on, shapes in varied.items()), *_jumps(place, spells)]
            continue
        own, heights = f"{letter}{place.joint + 1}", q[:, place.joint]
        here = varied | {on: finer[own] for on in varied if on == own}
        last = hung if place.kind == "joint" and place.joint == problem.view.joints - 1 else []
        load = load_name(problem, place.joint)
        bears = [(load, loaded[load])] if load in loaded else []
        laws = [_law(place, (on,), shapes) for on, shapes in (*here.items(), *bears, *last)]
        laws += [_law(place, ons, shapes) for ons, shapes in _arrivals(problem, place.joint)]
        jumps = [(own, (float(height),), heights > height) for height in heights_of(heights[problem.used])]
        changes = bears and place.kind != "link"  # a link that changes sides is an effect
        sides = sides_of(problem, load, loads[load]) if changes else []
        yield [*laws, *_jumps(place, [*jumps, *sides, *passed, *spells])]
    tool, mount = places_of_chain(problem, chain)[0], mount_of(problem, chain)
    held = [stand_of(problem), *([] if mount is None else [mount])]
    yield [*_jumps(held[0], spells), *_changes(problem, tool, moments)]
    if mount is not None:  # a single moment is a knock's of the set-up, but no effect moves the tool in its holder
        # it bends, or falls to the lower side
        lower = [(on, (0.0,), values > 0.0) for on, values in hanging_of(problem).items() if on in dict(hung)]
        yield [_law(mount, (on,), shapes) for on, shapes in hung]
        yield _jumps(mount, lower)
        clock = problem.view.clock.numpy()
        yield _jumps(mount, [*(("time", (moment,), clock > moment) for moment in moments), *spells])
    yield [
        block for place in (tool, *held, *_places(problem, chain))
        for block in _jumps(place, list(switches_of(problem, levels.get(place.residual, ()))))
    ]  # fmt: skip


def _law(place: Place, on: tuple[str, ...], shapes: np.ndarray) -> Block:
    return Block(f"law {place.residual} on {' and '.join(on)}", place, on, shapes, is_law=True)


def _jumps(place: Place, jumps: Sequence[Jump]) -> list[Block]:
    """Step functions: zero on one side of a value and constant on the other."""
    name = f"law {place.residual} jumps on"
    return [
        Block(f"{name} {on}", place, (on,), there.reshape(len(there), -1).astype(float), is_law=True, jumps=where)
        for on, where, there in jumps
    ]


def _changes(problem: Problem, tool: Place, moments: Sequence[float]) -> Iterator[Block]:
    """Jumps over time by amounts that vary over the workspace, as by a load or a clamp that nobody noted."""
    place, clock = problem.view.p.numpy(), problem.view.clock.numpy()
    field = field_over(scaled(place, column_ends(place)), STEP_DEGREE)
    for moment in moments:
        shapes = (clock > moment)[:, None] * field
        yield Block("law tool jumps by place on time", tool, ("time",), shapes, is_law=True, jumps=(moment,))


def _places(problem: Problem, chain: Chain) -> Iterator[Place]:
    """Places of laws, one direction each: axes of the tool, joints, both directions of rails, links."""
    tool, *joints = places_of_chain(problem, chain)
    yield from tool_axes(tool)
    for place in joints:
        yield from one_way_each(place)


def _curves(problem: Problem) -> Iterator[tuple[str, np.ndarray]]:
    """Every variable and its basis functions, (n, s): rough enough to bend sharply."""
    for name, values in path_views(problem).items():
        if is_direction(name):
            yield name, values[:, None]
        elif not NO_CURVES.fullmatch(name):
            known = np.nan_to_num(values, nan=float(np.nanmean(values)))
            if np.ptp(reined(known)) > 0.0:  # else one or two rows alone differ
                yield name, _curve(known, OTHER_COSINES)


def _arrivals(problem: Problem, joint: int) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
    """Direction of arrival of a joint, modulated by its position or by the length of its last move."""
    if not problem.two_sided[joint]:
        return
    view, letter = problem.view, problem.file.machine.letter
    q, side = view.q.numpy()[:, joint], view.direction.numpy()[:, joint : joint + 1]
    step = np.abs(np.diff(q, prepend=q[:1]))
    step[view.starts.numpy()] = 0.0
    name, longest = f"direction{joint + 1}", step.max()
    yield (name, f"{letter}{joint + 1}"), side * _curve(q, ARRIVAL_COSINES)
    if longest > 0.0:  # zero where the table gives directions of a joint that never moves
        step[view.starts.numpy()] = longest  # how far it came to a run's first row is unknown
        far = np.log(np.maximum(step, SHORTEST_MOVE * longest))  # friction decays exponentially with travel
        yield (name, "step"), side * _curve(far, ARRIVAL_COSINES)


def _curve(values: np.ndarray, count: int) -> np.ndarray:
    """Level, slope and cosines of a variable, (n, count + 2)."""
    values = reined(values)
    place = scaled(values, column_ends(values))
    return np.column_stack([np.ones(len(place)), place, cosines(place, count)])
