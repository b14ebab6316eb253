"""Blocks of unknown physics: a smooth function of something that varies, acting at one place, with one variance."""

from collections.abc import Callable, Collection, Iterator, Sequence
from functools import cache, partial

import numpy as np

from ptt.dependence.contexts import hanging_of
from ptt.diagnosis.unknown.block import Block, Period, Recipe
from ptt.diagnosis.unknown.places import Place, load_of, mount_of, one_way_each, places_of_chain, tool_axes
from ptt.diagnosis.unknown.smooth import cosines, harmonics, legendre, modulation, product, scaled
from ptt.diagnosis.unknown.span import Context, Span, span_of
from ptt.effects.curve_basis import GRAVITY
from ptt.effects.hysterons import hysterons
from ptt.model.chain import Chain
from ptt.run.axes import AXES
from ptt.run.frames import rigid_columns
from ptt.run.problem import Problem

OWN_COSINES = 24  # cosines along a joint's own travel
# Contexts without which nothing happens: at no load, and where the drawing holds, a rail lies as drawn
ZERO_CONTEXTS = ("payload", "temperature")
# Total degree of a field over the workspace, and of one that a context modulates
FIELD_DEGREE, CONTEXT_FIELD_DEGREE = 5, 3
# Size of each degree over the one before, and the degree of a field that bends but once
FIELD_DECAY, GENTLE_DEGREE = 0.6, 2


def unknown_blocks(
    problem: Problem,
    chain: Chain,
    periods: Sequence[Period] = (),
    span: Span | None = None,
    names: Collection[str] | None = None,
) -> list[Block]:
    """All blocks that the run can show.

    Args:
        problem: n rows.
        chain: linearisation of the present model, for how joints and rails move the reading.
        periods: waves that spectra of residuals showed.
        span: of the run that the rows are a part of; None where they are all of it.
        names: names of the wanted blocks; None for all.

    Returns:
        The blocks.
    """
    if span is None:
        span = span_of(problem)
    elif problem.view.number is not None:
        span = span.of(problem.view.number.numpy().astype(int))
    places = places_of_chain(problem, chain, span.levers)
    recipes = (*_recipes(problem, chain, places, span), *_periodic(problem, places, periods))
    wanted = (one for one in recipes if names is None or one.name in names)
    blocks = (Block(one.name, one.place, one.on, one.make(), one.period, gradual=one.gradual) for one in wanted)
    return [block for block in blocks if block.shapes.shape[1]]


def _recipes(problem: Problem, chain: Chain, places: Sequence[Place], span: Span) -> Iterator[Recipe]:
    tool, *moving = places
    raw, letter, serial = problem.view.q.numpy(), problem.file.machine.letter, problem.file.machine.kind == "serial"
    q, p = scaled(raw, span.q), scaled(problem.view.p.numpy(), span.p)
    yield _named(tool, AXES, partial(field_over, p, _degree(problem)))
    yield _named(tool, AXES, partial(field_over, p, GENTLE_DEGREE), "gently ")
    for axis in tool_axes(tool):  # what bends one way only has a third of the features
        yield _named(axis, AXES, partial(field_over, p, _degree(problem)))
    turned = _turned(problem, span)
    mount = mount_of(problem, chain)
    if mount is not None:
        yield from _of_mount(problem, chain, mount, span)
    for place in moving:
        assert place.joint is not None
        own, low = f"{letter}{place.joint + 1}", modulation(q[:, place.joint])
        if place.kind == "link":  # it grows with temperature, or yields under load
            for context in span.contexts:
                if context.fields:
                    yield _named(place, (context.name,), partial(_shapes, context))
            continue
        yield _named(place, (own,), partial(_own_travel, q[:, place.joint], raw[:, place.joint], serial))
        if place.kind == "rail":
            yield from _of_rail(problem, place, own, low, span)
            continue
        yield from _of_drive(problem, place, q, p, span)
        if span.two_sided[place.joint]:
            load = span.loads[place.joint]
            yield from _reversal(problem, place, own, low, span.contexts if load is None else (*span.contexts, load))
            on = f"direction{place.joint + 1}", own
            yield Recipe(
                f"{place.residual} gradually on {on[0]}", place, on, partial(turned, place.joint), gradual=True
            )
    for context in span.contexts:
        yield from _of_context(tool, context, p)
    if span.two_sided.any():
        yield _named(tool, ("direction",), problem.view.direction.numpy)
    yield from _of_set_up(problem, span)


def _of_drive(problem: Problem, place: Place, q: np.ndarray, p: np.ndarray, span: Span) -> Iterator[Recipe]:
    """What moves a slider or joint besides its own curve and its reversals; q and p are scaled."""
    assert place.joint is not None
    raw, letter, serial = problem.view.q.numpy(), problem.file.machine.letter, problem.file.machine.kind == "serial"
    own, low = f"{letter}{place.joint + 1}", modulation(q[:, place.joint])
    yield _named(place, AXES, partial(field_over, p, _degree(problem)))
    for i in range(q.shape[1]):
        if i != place.joint:
            yield _named(place, (f"{letter}{i + 1}",), partial(_others_travel, q[:, i], raw[:, i], serial))
    for i in range(q.shape[1] - 1) if q.shape[1] > len(AXES) else ():  # of fewer joints the place says all
        yield _named(place, (f"q{i + 1}", f"q{i + 2}"), partial(_of_two, raw[:, i], raw[:, i + 1]))
    yield _named(place, ("time",), lambda: span.settling, "steadily ")
    if problem.view.lead is not None:  # a bearing of the screw, or its encoder's, that gets worse
        turns = harmonics(2.0 * np.pi * raw[:, place.joint] / problem.view.lead)
        yield _named(place, ("time", own), partial(product, span.settling[:, 1:], turns), "each turn steadily ")
    load = span.loads[place.joint]
    if load is not None:  # it yields unevenly, or goes to the other side of its play
        yield _named(place, (load.name,), partial(_shapes, load))
    for context in span.contexts:
        if context.joints:
            yield _named(place, (context.name, own), partial(product, _with_level(context), low))


def _of_mount(problem: Problem, chain: Chain, mount: Place, span: Span) -> Iterator[Recipe]:
    """What hangs on the last link bends, or falls to the lower side, as gravity turns about it, and under a load."""
    pulls = np.column_stack([*hanging_of(problem).values()])
    yield _named(mount, GRAVITY, partial(field_over, pulls, CONTEXT_FIELD_DEGREE))
    for payload in (context.shapes for context in span.contexts if context.name == "payload"):
        yield _named(mount, ("payload", *GRAVITY), partial(product, payload, field_over(pulls, GENTLE_DEGREE)))
        if (load := load_of(problem, chain)) is not None:
            yield _named(load, ("payload",), partial(np.asarray, payload[:, :1]))


def _of_rail(problem: Problem, place: Place, own: str, low: np.ndarray, span: Span) -> Iterator[Recipe]:
    """What moves a carriage across its rail besides the rail's own curve."""
    assert place.joint is not None
    if span.two_sided[place.joint]:  # it tips as the drive pulls it the other way
        yield from _reversal(problem, place, own, low, ())
    if problem.view.lead is not None:  # a bent screw pushes it aside once a turn
        yield _waves(place, own, problem.view.q.numpy()[:, place.joint], problem.view.lead)
    for way in one_way_each(place):  # it bends for good
        yield _named(way, ("time", own), partial(product, span.settling, low), "steadily ")
    for context in span.contexts:  # and it gives way under load, or to the sun
        changes = context.shapes - context.mean  # the mean over the run belongs to towers and guides
        for way in one_way_each(place) if context.fields else ():
            yield _named(way, (context.name, own), partial(product, changes, low))
            if context.name in ZERO_CONTEXTS:
                yield _named(way, (context.name, own), partial(product, context.shapes, low), "from zero ")


def _of_context(tool: Place, context: Context, p: np.ndarray) -> Iterator[Recipe]:
    """Effects of a context at the tool: the same everywhere, or modulated over the workspace."""
    if not context.joints:
        yield _named(tool, (context.name,), partial(_shapes, context))
    elif context.name != "time":
        yield _named(tool, (context.name,), partial(_shapes, context), "gently ")
        degree = CONTEXT_FIELD_DEGREE if context.fields else 1
        yield _named(tool, (context.name,), partial(_modulated_field, context.shapes, p, degree))


def _degree(problem: Problem) -> int:
    return FIELD_DEGREE if problem.file.machine.kind == "three-ptt" else CONTEXT_FIELD_DEGREE


def _named(place: Place, on: tuple[str, ...], make: Callable[[], np.ndarray], how: str = "") -> Recipe:
    return Recipe(f"{place.residual} {how}on {' and '.join(on)}", place, on, make)


def _periodic(problem: Problem, places: list[Place], periods: Sequence[Period]) -> Iterator[Recipe]:
    """Two harmonics of each period along its joint, or over time at the tool, each axis of it, and each other place."""
    tool, *moving = places
    for joint, length in periods:
        if joint is None:
            for place in (tool, *tool_axes(tool), *(way for one in moving for way in one_way_each(one))):
                yield _waves(place, "time", problem.view.clock.numpy(), length)
        else:
            place = next(place for place in places if place.joint == joint)
            yield _waves(place, f"{problem.file.machine.letter}{joint + 1}", problem.view.q.numpy()[:, joint], length)


def _waves(place: Place, on: str, raw: np.ndarray, length: float) -> Recipe:
    phase, called = 2.0 * np.pi * raw / length, f"{length:.5g}"
    name = f"{place.residual} on {on} with period {called}"
    return Recipe(name, place, (on,), partial(harmonics, phase), float(called))


def _reversal(
    problem: Problem, place: Place, own: str, low: np.ndarray, contexts: Sequence[Context]
) -> Iterator[Recipe]:
    """Direction of arrival of a joint, modulated by its position or by a context."""
    assert place.joint is not None
    side = problem.view.direction.numpy()[:, place.joint : place.joint + 1]
    name = f"direction{place.joint + 1}"
    yield _named(place, (name, own), partial(np.multiply, side, low))
    for context in contexts:
        yield _named(place, (name, context.name), partial(np.multiply, side, context.measure))


def _of_set_up(problem: Problem, span: Span) -> Iterator[Recipe]:
    """Tracker and machine move against each other as rigid bodies, with time or with a context.

    Over time only scale and rotation, since the shift is the tracker's wander. Not with payload: how a load tilts what
    the machine stands on depends on where the load is.
    """
    p = problem.view.p
    rigid = rigid_columns(p, length=span.radius).numpy()
    slopes = np.concatenate([p.numpy()[..., None] / span.radius, rigid[..., 3:], rigid[..., :3]], axis=-1)
    yield _named(Place("set-up", "set-up", slopes[..., :4]), ("time",), lambda: span.slow)
    for context in span.contexts:
        if context.fields and context.name != "payload":
            yield _named(Place("set-up", "set-up", slopes), (context.name,), partial(_shapes, context))


def _turned(problem: Problem, span: Span) -> Callable[[int], np.ndarray]:
    """A function: joint -> how far it has turned over since its reversals and what a run began with; made lazily."""

    @cache
    def every() -> np.ndarray:
        travel = problem.view.q.new_tensor(np.ptp(span.q, axis=0))
        return np.concatenate([hysterons(problem.view, travel).numpy(), span.begun], axis=2)

    return lambda joint: every()[:, joint]


def _own_travel(place: np.ndarray, raw: np.ndarray, turns: bool) -> np.ndarray:
    """A curve with level and slope, without which offsets and leads would be named beside it."""
    shapes = np.column_stack([np.ones(len(place)), place, cosines(place, OWN_COSINES)])
    return np.column_stack([shapes, harmonics(raw)]) if turns else shapes


def _others_travel(place: np.ndarray, raw: np.ndarray, turns: bool) -> np.ndarray:
    return np.column_stack([np.ones(len(raw)), harmonics(raw)]) if turns else modulation(place)


def _of_two(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Harmonics of two angles, of their sum and of their difference: a link's attitude follows several joints."""
    each = [np.column_stack([np.ones(len(raw)), harmonics(raw)]) for raw in (one, other)]
    return product(*each)


def _shapes(context: Context) -> np.ndarray:
    return context.shapes


def _with_level(context: Context) -> np.ndarray:
    """Shapes of a context; of time with a level, as the mean over the run is part of what changes."""
    return np.column_stack([np.ones(len(context.shapes)), context.shapes]) if context.name == "time" else context.shapes


def field_over(place: np.ndarray, degree: int) -> np.ndarray:
    """Products of Legendre polynomials of the coordinates up to a total degree, each the smaller the more it bends.

    With their level, without which zeros, links or a trusted frame would be named beside a fault that is large in one
    corner.

    Args:
        place: coordinates scaled to -1..1, (n, 3).
        degree: largest total degree.

    Returns:
        (n, f).
    """
    each = [legendre(column, degree) for column in place.T]
    powers = [power for power in np.ndindex(*(degree + 1,) * 3) if sum(power) <= degree]
    return np.column_stack(
        [FIELD_DECAY ** max(sum(m) - 1, 0) * each[0][:, m[0]] * each[1][:, m[1]] * each[2][:, m[2]] for m in powers]
    )


def _modulated_field(shapes: np.ndarray, place: np.ndarray, degree: int) -> np.ndarray:
    return product(shapes, field_over(place, degree))
