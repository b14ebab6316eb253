"""Set-up mistakes of serial arms: joints in another order, turned round, counted from elsewhere, degrees for radians.

The tracker may stand anywhere and the reflector sit anywhere on the tool. Every hypothesis is first screened by a
linear fit that allows more than that (any linear map of position and orientation); what passes is fitted exactly.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
import torch

from ptt.machine import SerialSpec
from ptt.mechanisms.serial import Serial
from ptt.setup.candidates import UNITS, mirrors, units
from ptt.setup.faults import left_after_faults
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many, rms
from ptt.setup.rows import slipped
from ptt.setup.setup import Hypothesis, Setup, Undo, used_rows

FEWEST, MOST_ROWS = 12, 90  # rows: fewer leave the station, the reflector and link errors free to fit anything
BROKEN = 0.004  # of the reach: what an arm misses by, out of the box, is less
FALL = 5.0
LEADERS = 4
ROUNDS = 8
USUAL = (0.5, 1e-3, 0.5, 1e-3, 1e-3)  # mm and rad: errors of a, alpha, d, theta and the Hayati angle
TURNS = {"90 deg": np.pi / 2.0, "-90 deg": -np.pi / 2.0, "180 deg": np.pi}
TIE = 1.5
LOOSE = 1e-9
LEAST = 0.01  # mm: agreement beyond this is no further proof


@dataclass(frozen=True, eq=False)
class Posed:
    """Where the joint values of a hypothesis put the tool.

    Attributes:
        place: (m, 3) mm.
        turn: (m, 3, 3), the tool's axes.
    """

    place: np.ndarray
    turn: np.ndarray


def find_arm(setup: Setup) -> tuple[list[Finding], Setup]:
    """Mistakes in joints, angles, axes and units of an arm.

    Args:
        setup: both files of a serial arm.

    Returns:
        At most one finding, and the files with it undone.
    """
    rows = _choose_rows(setup)
    if len(rows) < FEWEST:
        return [], setup
    before = _judge(setup, rows)
    reach = Serial.from_spec(_spec(setup)).reach_mm
    if before < BROKEN * reach:
        return [], setup
    judged = []
    for hypothesis in _leaders(setup, rows):
        for more in _read_off(hypothesis.undo(setup), rows):
            steps = [hypothesis, *more]
            cured = setup
            for step in steps:
                cured = step.undo(cured)
            named = [step for step in steps if step.undone]
            judged.append((_judge(cured, rows), named, cured))
    judged.sort(key=lambda item: np.log(item[0] + LEAST) + sum(step.cost + 0.1 for step in item[1]))
    if not judged or not judged[0][1]:
        return [], setup
    after, steps, cured = judged[0]
    if after > before / FALL or after > BROKEN * reach:
        return [], setup
    ties = [" and ".join(step.undone for step in other[1]) for other in judged[1:] if other[0] < TIE * after]
    also = f"; {' or '.join(dict.fromkeys(ties[:2]))} would do the same" if ties else ""
    undone = " and ".join(step.undone for step in steps)
    words = (
        f"the readings are off the commands by {1e3 * before:,.0f} um; "
        f"with {undone} the error falls to {1e3 * after:,.0f} um{also}"
    )
    source = setup.table.source
    return [Finding(s.mistake, words, s.fix, 1e3 * before, 1e3 * after, True, source) for s in steps], cured


def _choose_rows(setup: Setup) -> np.ndarray:
    table = setup.table
    if table.command is None:
        return np.zeros(0, dtype=int)
    rows = np.flatnonzero(
        used_rows(table) & np.isfinite(table.command).all(axis=1) & np.isfinite(table.measured).all(axis=1)
    )
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_ROWS)).round().astype(int))]


def _mistakes(setup: Setup) -> Iterator[Hypothesis]:
    """Single mistakes, nothing undone first."""
    spec = _spec(setup)
    count = len(spec.joint)
    yield Hypothesis("joint-sign", "", "", lambda same: same)
    for words, factor in (("degrees", np.pi / 180.0), ("radians", 180.0 / np.pi)):
        fix = "rename the columns (q1_cmd_deg, ...)" if words == "degrees" else "rename the columns (q1_cmd_rad, ...)"
        yield Hypothesis("angle-unit", f"the joint columns taken as {words}", fix, _driven(np.eye(count) * factor))
    if 0.0 < max(abs(joint.alpha_deg) for joint in spec.joint) < 7.0:
        fix = "turn alpha_deg and theta_offset_deg of the machine file into degrees"
        yield Hypothesis("angle-unit", "the machine file's angles taken as radians", fix, _in_degrees)
    yield from _orders(count)
    yield from _signs(count)
    yield from _zeros(count, setup.free)
    for slip in (1, -1):
        words = f"readings moved back by a row, which stand a row {'late' if slip > 0 else 'early'},"
        yield Hypothesis("row-shift", words, "move the readings back by a row", _slipped(slip))


def _orders(count: int) -> Iterator[Hypothesis]:
    plain = list(range(count))
    orders = [plain[::-1], *(plain[by:] + plain[:by] for by in range(1, count))]
    for one, other in combinations(range(count), 2):
        order = plain.copy()
        order[one], order[other] = other, one
        orders.append(order)
    for order in orders:
        moved = [place for place in plain if order[place] != place]
        words = f"joints {moved[0] + 1} and {moved[1] + 1} interchanged" if len(moved) == 2 else (
            f"the joints in the order {', '.join(str(joint + 1) for joint in order)}"
        )  # fmt: skip
        yield Hypothesis("joint-order", words, f"reorder the columns: {words}", _driven(np.eye(count)[order]))


def _signs(count: int) -> Iterator[Hypothesis]:
    for signs in product((1.0, -1.0), repeat=count):
        down = [joint + 1 for joint in range(count) if signs[joint] < 0]
        if down:
            words = f"joint{'s' if len(down) > 1 else ''} {', '.join(map(str, down))} turned the other way"
            yield Hypothesis("joint-sign", words, "negate the columns", _driven(np.diag(signs)), 0.02 * len(down))


def _zeros(count: int, free: bool) -> Iterator[Hypothesis]:
    """The first joint's zero is a turn of the tracker, the last one's a turn of the reflector's place."""
    singles = [(joint, name) for joint in range(1 if free else 0, count - 1) for name in TURNS]
    pairs = [pair for pair in combinations(singles, 2) if pair[0][0] != pair[1][0]]
    for chosen in [*((each,) for each in singles), *pairs]:
        shift = np.zeros(count)
        for joint, name in chosen:
            shift[joint] = TURNS[name]
        words = " and ".join(f"the zero of joint {joint + 1} moved by {name}" for joint, name in chosen)
        fix = "add it to theta_offset_deg of the machine file"
        yield Hypothesis("joint-sign", words, fix, _offset(shift), 0.03 * len(chosen))


def _leaders(setup: Setup, rows: np.ndarray) -> list[Hypothesis]:
    """The best of the screen, and doing nothing."""
    hypotheses = list(_mistakes(setup))
    found = []
    for hypothesis in hypotheses:
        undone = hypothesis.undo(setup)
        found.append((undone.file.machine, undone.table.command[rows], undone.table.measured[rows]))  # type: ignore[index]
    posed = _pose_many([item[:2] for item in found])  # type: ignore[misc]
    left = np.array([_linear(pose, reading)[0] for pose, (_, _, reading) in zip(posed, found, strict=True)])
    order = np.argsort(np.log(left + 1e-6) + [hypothesis.cost for hypothesis in hypotheses], kind="stable")
    return [hypotheses[0], *(hypotheses[index] for index in order[:LEADERS] if index != 0)]


def _read_off(setup: Setup, rows: np.ndarray) -> list[list[Hypothesis]]:
    """Axes and units of the readings, which the linear fit shows by its determinant."""
    command, reading = setup.table.command[rows], setup.table.measured[rows]  # type: ignore[index]
    (pose,) = _pose_many([(_spec(setup), command)])
    volume = float(np.linalg.det(_linear(pose, reading)[1]))
    size = abs(volume) ** (1.0 / 3.0)
    near = [unit for unit, factor in UNITS.items() if 0.8 < size * factor < 1.25]
    more = [item for item in units("readings") if near and near[0] in item.undone.split()]
    plain: list[list[Hypothesis]] = [more] if more else [[]]
    return plain + ([[*more, item] for item in mirrors("readings")] if volume < 0.0 else [])


def _pose_many(cases: list[tuple[SerialSpec, np.ndarray]]) -> list[Posed]:
    posed: list[Posed | None] = [None] * len(cases)
    groups: dict[SerialSpec, list[int]] = {}
    for index, (spec, _) in enumerate(cases):
        groups.setdefault(spec, []).append(index)
    for spec, members in groups.items():
        q = torch.as_tensor(np.stack([cases[index][1] for index in members]), dtype=torch.float64)
        place, turn = Serial.from_spec(spec).pose(q)
        for index, p, r in zip(members, place.numpy(), turn.numpy(), strict=True):
            posed[index] = Posed(p, r)
    return [pose for pose in posed if pose is not None]


def _linear(pose: Posed, reading: np.ndarray) -> tuple[float, np.ndarray]:
    """What the best linear map of position and orientation leaves, mm, and its part of the position, (3, 3)."""
    known = np.isfinite(reading).all(axis=1)
    columns = np.concatenate([pose.place, pose.turn.reshape(-1, 9)], axis=1)[known]
    columns, wanted = columns - columns.mean(axis=0), reading[known] - reading[known].mean(axis=0)
    size = np.sqrt((columns**2).mean(axis=0)) + 1e-9
    scaled = columns / size
    normal = scaled.T @ scaled + LOOSE * len(scaled) * np.eye(scaled.shape[1])
    solved = np.linalg.solve(normal, scaled.T @ wanted)
    left = np.linalg.norm(wanted - scaled @ solved, axis=1)
    return float(np.sqrt(np.median(left**2))), (solved / size[:, None])[:3].T


def _judge(setup: Setup, rows: np.ndarray) -> float:
    """What an exact fit of station, reflector and ordinary link errors leaves, mm."""
    reading = setup.table.measured[rows]
    kept = np.isfinite(reading).all(axis=1)
    q, reading = setup.table.command[rows][kept], reading[kept]  # type: ignore[index]
    (pose,) = _pose_many([(_spec(setup), q)])
    place = pose.place + pose.turn @ _mount(pose, reading, setup.free)
    arm = Serial.from_spec(_spec(setup))
    slopes = arm.geometry_jacobian(torch.as_tensor(q, dtype=torch.float64))[:, :3].numpy()[..., :-3]
    columns = np.concatenate([slopes * np.tile(USUAL, arm.joints), pose.turn], axis=2)
    left = left_after_faults(place, reading, columns, setup.free)
    return float(rms(left[None], np.zeros((1, len(left)), dtype=bool), 1.0)[0])


def _mount(pose: Posed, reading: np.ndarray, free: bool) -> np.ndarray:
    """Where the reflector sits beside the drawing's tool point, (3,) mm in the tool's frame, by Gauss-Newton."""
    mount = np.zeros(3)
    for _ in range(ROUNDS):
        place = pose.place + pose.turn @ mount
        turn, shift, _ = align_many(place[None], reading[None], free)
        left = (reading - shift[0]) @ turn[0] - place
        turns = np.stack([np.cross(axis, place - place.mean(axis=0)) for axis in np.eye(3)], axis=2)
        blocks = [pose.turn, np.broadcast_to(np.eye(3), pose.turn.shape), turns / 100.0]
        matrix = np.concatenate(blocks, axis=2).reshape(3 * len(place), -1)
        mount = mount + np.linalg.lstsq(matrix, left.ravel(), rcond=1e-8)[0][:3]
    return mount


def _spec(setup: Setup) -> SerialSpec:
    assert isinstance(setup.file.machine, SerialSpec)
    return setup.file.machine


def _driven(matrix: np.ndarray) -> Undo:
    return lambda setup: setup.with_rows(command=np.asarray(setup.table.command) @ matrix.T)


def _slipped(slip: int) -> Undo:
    return lambda setup: setup.with_rows(measured=slipped(setup.table.measured, slip, 0))


def _offset(shift: np.ndarray) -> Undo:
    def undo(setup: Setup) -> Setup:
        moved = zip(_spec(setup).joint, np.degrees(shift).round(9), strict=True)
        joints = tuple(j.model_copy(update={"theta_offset_deg": j.theta_offset_deg + float(d)}) for j, d in moved)
        return setup.with_drawing(joint=joints)

    return undo


def _in_degrees(setup: Setup) -> Setup:
    def turned(joint: object) -> dict[str, float]:
        return {key: float(np.degrees(getattr(joint, key))) for key in ("alpha_deg", "theta_offset_deg")}

    return setup.with_drawing(joint=tuple(joint.model_copy(update=turned(joint)) for joint in _spec(setup).joint))
