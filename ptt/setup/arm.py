"""Set-up mistakes of serial arms: order, sign or zero of joints, degrees for radians, axes and units of readings.

Tracker position and reflector offset are unknown. Every hypothesis is first screened by a linear fit that allows more
than these (any linear map of position and orientation); the best are then judged by an exact fit.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from ptt.machine import SerialSpec
from ptt.mechanisms.serial import Serial
from ptt.setup.arm_fit import arm_spec, judge_arm, linear, linear_many, pose_many
from ptt.setup.arm_lengths import is_no_arm, other_lengths
from ptt.setup.candidates import UNITS, is_near, mirrors, units
from ptt.setup.judged import undo_all
from ptt.setup.proof import FALL
from ptt.setup.result import Finding, ties_in_words
from ptt.setup.rows import slipped
from ptt.setup.setup import Hypothesis, Setup, Undo, used_rows

LEAST_ROWS, MOST_ROWS = 12, 90  # to few rows a fit of tracker, reflector and link errors can fit anything
BROKEN = 0.004  # share of the reach: uncalibrated arms err by less
FOREIGN = 0.05  # share of the reach: the most compliant arms yield by 0.01, a wrong drawing is off by 0.1 and more
LEADERS = 4  # hypotheses that are judged exactly
PLACES, MOST_PLACES = 12, 24  # rows at which a missing reading is tried, in the coarse and in the fine search
TURNS = {"90 deg": np.pi / 2.0, "-90 deg": -np.pi / 2.0, "180 deg": np.pi}
TIE = 1.5  # ratio of errors up to which two explanations do equally well
TURN = 7.0  # a little more than a turn in radians: angles in degrees are larger
SAME = ("z negated", "y and z swapped")  # reflections of the readings that stand for all where the frame is free
LEAST_MM = 0.01  # smaller errors count as equal
Judged = tuple[float, list[Hypothesis], Setup]


def find_arm(setup: Setup) -> tuple[list[Finding], Setup]:
    """Mistakes in joints, angles, axes and units of an arm.

    Args:
        setup: both files of a serial arm.

    Returns:
        At most one finding, and the files with it undone.
    """
    rows = choose_rows(setup)
    if len(rows) < LEAST_ROWS:
        return [], setup
    before, reach = judge_arm(setup, rows), Serial.from_spec(arm_spec(setup)).reach_mm
    if before < BROKEN * reach:
        return [], setup
    judged = next(filter(None, (_explained(*each, rows, before) for each in _starts(setup, rows, before))), None)
    if judged is None:
        return [], setup
    after, steps, cured = judged[0]
    ties = [" and ".join(step.undone for step in other[1]) for other in judged[1:] if other[0] < TIE * after]
    also = ties_in_words(list(dict.fromkeys(ties[:2])))
    undone = " and ".join(step.undone for step in steps)
    words = (
        f"the readings differ from the commands by {1e3 * before:,.0f} um; "
        f"with {undone} the error falls to {1e3 * after:,.0f} um{also}"
    )
    source = setup.table.source
    return [Finding(s.mistake, words, s.fix, 1e3 * before, 1e3 * after, True, source) for s in steps], cured


def unexplained_arm(setup: Setup) -> list[str]:
    """One sentence where an arm's readings differ from its commands by more than errors of construction can explain.

    Args:
        setup: both files, with what was found undone.
    """
    rows = choose_rows(setup)
    if len(rows) < LEAST_ROWS:
        return []
    left, most = judge_arm(setup, rows), BROKEN * Serial.from_spec(arm_spec(setup)).reach_mm
    if left < most:
        return []
    spec = arm_spec(setup)
    other = "modified" if spec.convention == "standard" else "standard"
    swapped = replace(setup, file=replace(setup.file, machine=spec.model_copy(update={"convention": other})))
    held = judge_arm(swapped, rows)
    if held < min(most, left / FALL):
        why = f'with convention = "{other}" in the machine file it would be {1e3 * held:,.0f} um'
    elif left > FOREIGN * Serial.from_spec(spec).reach_mm:
        why = (
            "no arm is built that far off, and no known single mistake explains it; does the machine file belong to "
            "this run, and are its lengths and its convention right?"
        )
    else:
        return []
    return [f"the readings differ from the commands by {1e3 * left:,.0f} um, beyond ordinary link errors: {why}"]


def _starts(setup: Setup, rows: np.ndarray, before: float) -> list[tuple[list[Hypothesis], Setup]]:
    """What is undone before further mistakes are sought: the unit of lengths of no arm, or one that alone is proof."""
    units = other_lengths(setup, rows)
    if not is_no_arm(arm_spec(setup)):
        units = [(left, item) for left, item in units if _falls(left, before, item.undo(setup))][:1]
    return [([item], item.undo(setup)) for _, item in units] or [([], setup)]


def _explained(
    first: list[Hypothesis], start: Setup, rows: np.ndarray, before: float
) -> list[Judged] | None:  # fmt: skip
    """What was undone first and what else explains an arm's readings, the best first; None where nothing does."""
    left = judge_arm(start, rows) if first else before
    if first and _falls(left, before, start):
        return [(left, first, start)]
    for sought in (_leaders, _slips_from):
        judged = _tried(start, rows, sought(start, rows))
        if judged and judged[0][1] and _falls(judged[0][0], left, start):
            return [(after, [*first, *steps], cured) for after, steps, cured in judged]
    return None


def _falls(after: float, before: float, setup: Setup) -> bool:
    """Whether a correction reduces the error enough to prove a mistake, mm."""
    return after <= min(before / FALL, BROKEN * Serial.from_spec(arm_spec(setup)).reach_mm)


def _tried(setup: Setup, rows: np.ndarray, hypotheses: list[Hypothesis]) -> list[Judged]:
    """Each hypothesis alone and with axes and units of the readings corrected, judged by exact fits, best first."""
    judged = []
    for hypothesis in hypotheses:
        for more in _reading_corrections(hypothesis.undo(setup), rows):
            steps = (hypothesis, *more)
            cured = undo_all(steps, setup)
            judged.append((judge_arm(cured, rows), [step for step in steps if step.undone], cured))
    return sorted(judged, key=lambda item: np.log(item[0] + LEAST_MM) + sum(step.cost + 0.1 for step in item[1]))


def choose_rows(setup: Setup) -> np.ndarray:
    """Evenly spaced rows of an arm with a command and a reading, at most `MOST_ROWS`, (m,) int."""
    table = setup.table
    if table.command is None:
        return np.zeros(0, dtype=int)
    rows = np.flatnonzero(
        used_rows(table) & np.isfinite(table.command).all(axis=1) & np.isfinite(table.measured).all(axis=1)
    )
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_ROWS)).round().astype(int))]


def _mistakes(setup: Setup) -> Iterator[Hypothesis]:
    """Every single mistake; first the hypothesis of none."""
    spec = arm_spec(setup)
    count = len(spec.joint)
    yield Hypothesis("joint-sign", "", "", lambda same: same)
    for words, factor in (("degrees", np.pi / 180.0), ("radians", 180.0 / np.pi)):
        fix = "rename the columns (q1_cmd_deg, ...)" if words == "degrees" else "rename the columns (q1_cmd_rad, ...)"
        yield Hypothesis("angle-unit", f"the joint columns taken as {words}", fix, _driven(np.eye(count) * factor))
    if 0.0 < max(abs(joint.alpha_deg) for joint in spec.joint) < TURN:
        fix = "convert alpha_deg and theta_offset_deg in the machine file to degrees"
        yield Hypothesis("angle-unit", "the machine file's angles taken as radians", fix, _in_degrees)
    yield from _orders(count)
    yield from _signs(count)
    yield from _zeros(count, setup.free)
    for slip in (1, -1):
        words = f"the readings moved by a row (they are a row {'late' if slip > 0 else 'early'})"
        yield Hypothesis("row-shift", words, f"move all readings {'up' if slip > 0 else 'down'} by 1", _slipped(slip))


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
            yield Hypothesis(
                "joint-sign",
                words,
                f"negate the column{'s' if len(down) > 1 else ''} of {words.split(' turned')[0]}",
                _driven(np.diag(signs)),
                0.02 * len(down),
            )


def _zeros(count: int, free: bool) -> Iterator[Hypothesis]:
    """Joint zeros off by quarter turns, except the first joint's, which is a tracker rotation, and the last one's."""
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
    """The best hypotheses by the linear fit, after that of no mistake."""
    hypotheses = list(_mistakes(setup))
    cases, readings = [], []
    for hypothesis in hypotheses:
        undone = hypothesis.undo(setup)
        turned, command = _zeros_in_commands(arm_spec(setup), arm_spec(undone))
        cases.append((turned, np.asarray(undone.table.command)[rows] + command))
        readings.append(undone.table.measured[rows])
    left = linear_many(pose_many(cases), np.stack(readings))
    order = np.argsort(np.log(left + 1e-6) + [hypothesis.cost for hypothesis in hypotheses], kind="stable")
    return [hypotheses[0], *(hypotheses[index] for index in order[:LEADERS] if index != 0)]


def _zeros_in_commands(drawn: SerialSpec, undone: SerialSpec) -> tuple[SerialSpec, np.ndarray]:
    """Changed zeros of the drawing as a shift of the commands, (k,) rad, so that one mechanism serves many cases."""
    pairs = list(zip(drawn.joint, undone.joint, strict=True))
    if drawn is undone or any(
        one.model_copy(update={"theta_offset_deg": two.theta_offset_deg}) != two for one, two in pairs
    ):
        return undone, np.zeros(len(pairs))
    return drawn, np.radians([two.theta_offset_deg - one.theta_offset_deg for one, two in pairs])


def _slips_from(setup: Setup, rows: np.ndarray) -> list[Hypothesis]:
    """A missing reading, or one too many, at the row where it fits best, by a coarse and a fine search."""
    count, found = setup.table.rows, []
    for slip in (1, -1):
        at = np.linspace(0, count, PLACES + 2)[1:-1].round().astype(int)
        for _ in range(2):
            left = [_left_by(setup, rows, slip, int(first)) for first in at]
            best, step = int(at[int(np.argmin(left))]), max(1, int(at[1] - at[0]))
            at = np.unique(np.clip(np.arange(best - step, best + step + 1), 1, count - 1))
            at = at[:: max(1, len(at) // MOST_PLACES)]
        line = setup.table.line[best]
        words = f"the readings from row {line} on, where one {'is too many' if slip > 0 else 'was missed'}, moved back"
        fix = f"move the readings from row {line} on {'up' if slip > 0 else 'down'} by 1, and leave the row without a "
        found.append(Hypothesis("row-shift", words, f"{fix}reading empty", _slipped(slip, best), 0.1))
    return found


def _left_by(setup: Setup, rows: np.ndarray, slip: int, first: int) -> float:
    undone = _slipped(slip, first)(setup).table
    kept = rows[np.isfinite(undone.measured[rows]).all(axis=1)]
    (pose,) = pose_many([(arm_spec(setup), undone.command[kept])])  # type: ignore[index]
    return linear(pose, undone.measured[kept])[0]


def _reading_corrections(setup: Setup, rows: np.ndarray) -> list[list[Hypothesis]]:
    """Corrections by the determinant of the linear fit: its size shows a unit, its sign a left-handed frame."""
    command, reading = setup.table.command[rows], setup.table.measured[rows]  # type: ignore[index]
    (pose,) = pose_many([(arm_spec(setup), command)])
    volume = float(np.linalg.det(linear(pose, reading)[1]))
    size = abs(volume) ** (1.0 / 3.0)
    near = [unit for unit, factor in UNITS.items() if is_near(1.0, size * factor)]
    more = [item for item in units("readings") if near and near[0] in item.undone.split()]
    left_handed = [item for item in mirrors("readings") if not setup.free or item.undone in SAME]
    plain: list[list[Hypothesis]] = [more] if more else [[]]
    return plain + ([[*more, item] for item in left_handed] if volume < 0.0 else [])


def _driven(matrix: np.ndarray) -> Undo:
    return lambda setup: setup.with_rows(command=np.asarray(setup.table.command) @ matrix.T)


def _slipped(slip: int, first: int = 0) -> Undo:
    return lambda setup: setup.with_rows(measured=slipped(setup.table.measured, slip, first))


def _offset(shift: np.ndarray) -> Undo:
    def undo(setup: Setup) -> Setup:
        moved = zip(arm_spec(setup).joint, np.degrees(shift).round(9), strict=True)
        joints = tuple(j.model_copy(update={"theta_offset_deg": j.theta_offset_deg + float(d)}) for j, d in moved)
        return setup.with_drawing(joint=joints)

    return undo


def _in_degrees(setup: Setup) -> Setup:
    def turned(joint: object) -> dict[str, float]:
        return {key: float(np.degrees(getattr(joint, key))) for key in ("alpha_deg", "theta_offset_deg")}

    return setup.with_drawing(joint=tuple(joint.model_copy(update=turned(joint)) for joint in arm_spec(setup).joint))
