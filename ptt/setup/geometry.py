"""Search for geometric set-up mistakes: all hypotheses are screened, the best judged together with ordinary faults."""

import numpy as np

from ptt.setup.candidates import slider_formulas, suggested_by_readings
from ptt.setup.columns import said
from ptt.setup.drawing import mistakes_in
from ptt.setup.faults import ROUGH_TIMES, fault_columns, left_after_faults
from ptt.setup.fitted import SEARCHED, SLIP, fitted_mistakes
from ptt.setup.judged import BROKEN, MOST_ROWS, Judged, is_proof, judge, thinned, undo_all
from ptt.setup.proof import BEYOND_FAULTS, FALL, STEEP
from ptt.setup.result import Finding, ties_in_words
from ptt.setup.rigid import align_many
from ptt.setup.score import FLOOR, agree, forward_many
from ptt.setup.setup import Hypothesis, Setup, drawn, used_rows

UNHEARD = 5.0  # mm: ordinary faults cause a millimetre or two
MANY_FAR, SHARE_FAR = 5, 0.05  # readings off by more, number and share: fewer are gross errors
EXACT = 0.01, 50.0  # mm, ratio of errors: commands are computed, so the right drawing gives targets to their digits
FEW_ROWS = 48  # rows for screening
LEADERS = 3  # hypotheses that are judged
TIE = np.log(1.5)  # difference of log errors up to which two explanations do equally well
SQUARE, CENTRED = 0.02, 10.0  # rad and mm within which people align a tracker with the base
APART = (
    "the readings differ from the targets by",
    "the readings differ from the commands by",
    "targets and commands differ by",
)
BUILT = 20.0  # mm: a machine may be built that far off its drawing, and a fit finds it without a warning


def find_geometry(setup: Setup) -> tuple[list[Finding], Setup]:
    """Mistakes in axes, units, sliders, lengths and frames.

    Args:
        setup: both files of a 3-PTT.

    Returns:
        Findings, and the files with the sure ones undone.
    """
    plain = judge(thinned(setup, MOST_ROWS), ())
    if not np.isfinite(plain.agreement.rms).any():
        return [], setup
    broken = plain.agreement.worst > BROKEN
    best, ties = _search(plain) if broken else (None, [])
    best = best or _exactly(plain)
    if best is None:
        return ([], setup) if broken else _turned_round(plain, setup)
    return _tell(plain, best, ties), undo_all(best.steps, setup)


def differ(setup: Setup) -> bool:
    """Whether targets and commands contradict each other."""
    return bool(np.nan_to_num(agree([thinned(setup, FEW_ROWS)])[0].rms[2]) > BROKEN)


def unexplained(setup: Setup) -> list[str]:
    """One sentence where the columns of a 3-PTT disagree by more than errors of construction can explain."""
    left = judge(thinned(setup, MOST_ROWS), ()).agreement.rms if is_off(setup) else np.zeros(0)
    if not np.nan_to_num(left).max(initial=0.0) > UNHEARD:
        return _partly_off(setup)
    pair = int(np.nanargmax(left))
    return [
        f"{APART[pair]} {_um(1e3 * float(left[pair]))} um, beyond ordinary faults: no machine is built that far "
        "off, and no known single mistake explains it; do machine file and targets belong to this run?"
    ]


def _partly_off(setup: Setup) -> list[str]:
    """One sentence where many readings, but fewer than half, are off by that much, so that a median hides it."""
    wanted = np.isfinite(setup.table.target).all(axis=1, keepdims=True)
    place = np.where(wanted, setup.table.target, forward_many([setup])[0])
    read = used_rows(setup.table)[:, None] & np.isfinite(setup.table.measured)
    reading = np.where(read, setup.table.measured, np.nan)
    distance = align_many(place[None], reading[None], setup.free)[2][0]
    known = int(np.isfinite(distance).sum())
    # Ordinary faults of two millimetres move some readings, or all, by five.
    if (distance > UNHEARD).any() and (columns := fault_columns(setup, place)) is not None:
        distance = left_after_faults(place, reading, columns, setup.free)
    far = np.flatnonzero(np.nan_to_num(distance) > UNHEARD)
    if not max(MANY_FAR, SHARE_FAR * known) <= len(far) < 0.5 * known:
        return []
    first, last = setup.table.line[far[[0, -1]]]
    return [
        f"{len(far)} of {known} readings, between rows {first} and {last}, are off the "
        f"{'targets' if wanted.any() else 'commands'} by more than {UNHEARD:g} mm and the others are not: no machine "
        "behaves like that; were the sliders, the reflector or the tracker's frame different there?"
    ]


def is_off(setup: Setup) -> bool:
    """Whether the readings are off by more than ordinary faults cause."""
    return bool(np.nan_to_num(agree([thinned(setup, FEW_ROWS)])[0].rms[:2]).max() > BEYOND_FAULTS)


def left_beside_faults(setup: Setup) -> float:
    """Largest residual of the readings with ordinary faults fitted and nothing undone, mm; 0 where there is none."""
    return float(np.nan_to_num(judge(thinned(setup, MOST_ROWS), ()).agreement.rms[:2]).max())


def is_steep(finding: Finding) -> bool:
    """Whether a correction reduces the error so much that no other explanation needs to be tried."""
    return (finding.before_um or 0.0) > STEEP * (finding.after_um or 0.0)


def explains_more(setup: Setup, other: Setup) -> bool:
    """Whether some geometric mistake, proven or not, leaves less error than another correction of the same files."""
    plain = judge(thinned(setup, MOST_ROWS), ())
    least = min((item.total for item in _leaders([plain])), default=np.inf)
    return bool(least < min(plain.total - np.log(2.0), judge(thinned(other, MOST_ROWS), (), plain).total))


def _turned_round(plain: Judged, setup: Setup) -> tuple[list[Finding], Setup]:
    """Interchanged radii, which turn the machine by half a turn, where the tracker is aligned with the base."""
    turn, shift = plain.agreement.turn, plain.agreement.shift
    half = np.diag([-1.0, -1.0, 1.0])
    if np.isfinite(setup.table.target).any() or np.abs(turn - half).max() > SQUARE or np.abs(shift[:2]).max() > CENTRED:
        return [], setup
    base, platform = drawn(setup).base_radius_mm, drawn(setup).platform_radius_mm
    angle = np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))
    words = (
        f"the readings are turned by {abs(angle):.1f} deg about z and shifted by only "
        f"{np.linalg.norm(shift[:2]):.1f} mm; with base and platform radius interchanged they agree with the drawing"
    )
    fix = f"write base_radius_mm = {platform:g} and platform_radius_mm = {base:g}, if the drawing agrees"
    sure = platform > base
    cured = setup.with_drawing(base_radius_mm=platform, platform_radius_mm=base) if sure else setup
    return [said(setup, "radii-interchanged", words, fix, sure)], cured


def _exactly(plain: Judged) -> Judged | None:
    """The mistake whose correction makes targets and commands, which differ little, agree to their last digits."""
    apart = plain.agreement.rms[2]
    if not apart > EXACT[0]:
        return None
    judged = _judge_all([(plain, [*mistakes_in(plain.setup), *fitted_mistakes(plain.setup)])])
    exact = [item for item in judged if item.agreement.beside(item.width)[2] < apart / EXACT[1]]
    return min(exact, key=lambda item: item.score, default=None)


def _search(plain: Judged) -> tuple[Judged | None, list[Judged]]:
    """The best single mistake, else the best pair, and what does equally well; None where nothing is proven."""
    singles = _leaders([plain])
    best = _best(plain, singles)
    if best is None and plain.worst > BEYOND_FAULTS:
        read = [judge(step.undo(plain.setup), (step,), plain) for step in suggested_by_readings(plain.setup)]
        singles = _leaders([*read, *singles[:LEADERS]])
        best = _best(plain, singles)
    if best is None:
        return None, []
    return best, [other for other in singles if other is not best and other.total < best.total + TIE]


def _leaders(starts: list[Judged]) -> list[Judged]:
    """The best next mistakes from each start, judged, best first."""
    judged = _judge_all([(start, mistakes_in(start.setup)) for start in starts])
    if not any(is_proof(item.plain, item) and item.worst < BROKEN and not _is_guessed(item) for item in judged):
        judged += _judge_all([(start, list(fitted_mistakes(start.setup))) for start in starts])
    return sorted(judged, key=lambda item: item.score)


def _is_guessed(item: Judged) -> bool:
    """Whether a slider's sign was reversed and its zero is only assumed."""
    told = np.isfinite(item.setup.table.target).any()
    return not told and any(step.mistake == "slider-sign" for step in item.steps)


def _judge_all(starts: list[tuple[Judged, list[Hypothesis]]]) -> list[Judged]:
    """The best hypotheses by a screening on few rows, judged on many."""
    cases: list[tuple[Judged, Hypothesis]] = []
    setups: list[Setup] = []
    for start, hypotheses in starts:
        thin = thinned(start.setup, FEW_ROWS)
        scaled = any(step.mistake == "unit-scale" for step in start.steps)
        for hypothesis in hypotheses:
            if scaled and hypothesis.mistake == "unit-scale":
                continue  # a second change of units would only shrink errors until ordinary faults explain them
            other = hypothesis.undo(thin)
            if other is not thin:
                cases.append((start, hypothesis))
                setups.append(other)
    totals = np.array(
        [item.total(start.width) for item, (start, _) in zip(agree(setups), cases, strict=True)], dtype=float
    )
    order = np.argsort(totals, kind="stable")
    kept = [
        index for rank, index in enumerate(order) if rank < LEADERS or totals[index] < totals[order[0]] + np.log(FALL)
    ]
    leaders = [cases[index] for index in kept[: 2 * LEADERS]]
    return [judge(step.undo(start.setup), (*start.steps, step), start.plain or start) for start, step in leaders]


def _best(plain: Judged, judged: list[Judged]) -> Judged | None:
    """The first whose reduction of the error is a proof."""
    return next((item for item in judged if is_proof(plain, item)), None)


def _tell(plain: Judged, best: Judged, ties: list[Judged]) -> list[Finding]:
    """A finding for each mistake of the best explanation."""
    pair = int(np.nanargmax(plain.agreement.rms / np.maximum(best.agreement.rms, FLOOR)))
    before, after = (1e3 * float(item.agreement.rms[pair]) for item in (plain, best))
    undone = " and ".join(step.undone for step in best.steps)
    also = ties_in_words(_one_of_each(ties))
    words = f"{APART[pair]} {_um(before)} um; with {undone} the error falls to {_um(after)} um{also}"
    source, files, findings = plain.setup.table.source, plain.setup, []
    for step in best.steps:
        files, last = step.undo(files), files
        fix = slider_formulas(last.table.command, files.table.command) or step.fix
        findings.append(Finding(step.mistake, words, fix, before, after, _is_sure(step, plain, best), source))
    return findings


def _is_sure(step: Hypothesis, plain: Judged, best: Judged) -> bool:
    """Whether a mistake must be corrected: a fit copes with rough parts, small lengths, targets in their own frame."""
    if step.mistake == "target-frame" or _is_rough(plain, best):
        return False
    if step.mistake != "drawing-length":
        return True
    moved = max(abs(getattr(drawn(best.setup), key) - getattr(drawn(plain.setup), key)) for key in SEARCHED)
    apart = plain.agreement.rms[2]
    return bool(moved > BUILT or (np.isfinite(apart) and apart > EXACT[0] and moved > SLIP))


def _is_rough(plain: Judged, best: Judged) -> bool:
    """Whether faults of a machine that was built by hand explain the readings as well as mistakes do."""
    if plain.agreement.rms[2] > EXACT[0]:
        return False  # targets and commands differ, which no fault of the machine explains
    left = judge(plain.setup, (), most=ROUGH_TIMES).agreement.rms
    return bool(np.nanmax(left) < np.exp(TIE) * np.nanmax(best.agreement.rms))


def _one_of_each(ties: list[Judged]) -> list[str]:
    """Equally good explanations in words, the first of each kind."""
    kinds: dict[tuple[str, ...], str] = {}
    for tie in ties:
        kinds.setdefault(tuple(step.mistake for step in tie.steps), " and ".join(step.undone for step in tie.steps))
    return list(kinds.values())


def _um(value: float) -> str:
    return f"{value:,.0f}" if value >= 9.95 else f"{value:.1f}"
