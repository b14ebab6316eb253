"""Which geometric mistake a run was set up with: all are screened, the leaders judged beside ordinary faults."""

from dataclasses import dataclass, replace

import numpy as np

from ptt.run.table import take_rows
from ptt.setup.candidates import mistakes_in
from ptt.setup.faults import fault_columns, left_after_faults
from ptt.setup.fitted import SLIP, fitted_mistakes
from ptt.setup.result import Finding
from ptt.setup.rigid import rms
from ptt.setup.score import FLOOR, Agreement, agree, forward_many
from ptt.setup.setup import Hypothesis, Setup, drawn, used_rows

MOST_ROWS, FEW_ROWS = 120, 48  # rows judged and screened: more say nothing new about a mistake that touches all
BROKEN = 0.5  # mm left beside ordinary faults: below it there is nothing to explain
BEYOND = 2.0  # mm: twice the largest ordinary fault
FALL = np.log(5.0)  # an error has to fall to a fifth
STEEP = 20.0  # to a twentieth: then what stays is noise and play, and no fault of another kind does that
EXACT = (0.01, 50.0)  # mm, and the fall: commands are computed, so the right drawing gives the targets to their digits
LEADERS = 3
TIE = np.log(1.5)
RAW = 0.2
SPECK, UNLIKELY = 2e-3, 5.0  # of a link: nobody measures a machine within that, and all errors are small there
SQUARE, CENTRED = 0.02, 10.0  # rad and mm: a tracker aligned to the base, by how well people do that
APART = (
    "the readings are off the targets by",
    "the readings are off the commands by",
    "targets and commands differ by",
)
BUILT = 20.0  # mm: a machine may be built so far off its drawing; a fit follows it without a warning


@dataclass(frozen=True, eq=False)
class Judged:
    """A hypothesis and what it leaves.

    Attributes:
        setup: the files with the mistake undone.
        steps: what was undone, one after the other.
        agreement: what stays, ordinary faults taken off.
        plain: what stayed before anything was undone; None where nothing was.
        raw: the same sum of logarithms with ordinary faults left in, which parts what they hide.
    """

    setup: Setup
    steps: tuple[Hypothesis, ...]
    agreement: Agreement
    plain: "Judged | None" = None
    raw: float = 0.0

    @property
    def width(self) -> float:
        """How far the points lay apart before anything was undone, mm."""
        return (self.plain or self).agreement.width

    @property
    def worst(self) -> float:
        """Largest of the pairs, mm, made up for where all lies closer together than before."""
        return float(np.nan_to_num(self.agreement.beside(self.width)).max())

    @property
    def total(self) -> float:
        """What stays, as a sum of logarithms."""
        return self.agreement.total(self.width)

    @property
    def score(self) -> float:
        """Small is good."""
        odd = _oddness(self.agreement.turn)
        odd += UNLIKELY * (self.agreement.width < SPECK * drawn(self.setup).link_length_mm)
        return self.total + RAW * self.raw + sum(step.cost for step in self.steps) + odd


def find_geometry(setup: Setup) -> tuple[list[Finding], Setup]:
    """Mistakes in axes, units, sliders, lengths and frames.

    Args:
        setup: both files of a 3-PTT.

    Returns:
        Findings, and the files with the sure ones undone.
    """
    plain = judge(_thinned(setup, MOST_ROWS), ())
    if not np.isfinite(plain.agreement.rms).any():
        return [], setup
    if not _is_broken(plain.agreement):
        other = _other_drawing(plain)
        return _turned_round(plain, setup) if other is None else (_tell(plain, other, []), undo_all(other.steps, setup))
    found = _search(plain)
    if found is None:
        return [], setup
    best, ties = found
    return _tell(plain, best, ties), undo_all(best.steps, setup)


def is_steep(finding: Finding) -> bool:
    """Whether an error falls so far that nothing else is to be asked."""
    return (finding.before_um or 0.0) > STEEP * (finding.after_um or 0.0)


def explains_more(setup: Setup, other: Setup) -> bool:
    """Whether some mistake in the geometry, proven or not, leaves less than another cure of the same files does."""
    plain = judge(_thinned(setup, MOST_ROWS), ())
    least = min((item.total for item in _leaders([plain])), default=np.inf)
    return bool(least < judge(_thinned(other, MOST_ROWS), (), plain).total)


def undo_all(steps: tuple[Hypothesis, ...], setup: Setup) -> Setup:
    """Both files with one mistake undone after the other."""
    for step in steps:
        setup = step.undo(setup)
    return setup


def judge(setup: Setup, steps: tuple[Hypothesis, ...], plain: Judged | None = None) -> Judged:
    """What stays between the columns beside ordinary faults.

    Args:
        setup: both files, mistakes undone.
        steps: what was undone.
        plain: what stayed before anything was undone.

    Returns:
        The judgement.
    """
    agreement = agree([setup])[0]
    values, reading = agreement.rms.copy(), setup.table.measured
    for index, place in enumerate((setup.table.target, forward_many([setup])[0])):
        if not np.isfinite(values[index]) or values[index] > drawn(setup).link_length_mm / 4.0:
            continue
        columns = fault_columns(setup, place)
        if columns is not None:
            distance = left_after_faults(place, reading, columns, setup.free)[None]
            lost = np.isfinite(reading).all(axis=1) & ~np.isfinite(distance[0])
            left = rms(distance, lost[None] & np.isfinite(place).any(), drawn(setup).link_length_mm)[0]
            values[index] = min(values[index], left)
    return Judged(setup, steps, replace(agreement, rms=values), plain, agreement.total(agreement.width))


def _turned_round(plain: Judged, setup: Setup) -> tuple[list[Finding], Setup]:
    """Interchanged radii turn the machine by half a turn: commands alone show it where the frame is the base's."""
    turn, shift = plain.agreement.turn, plain.agreement.shift
    half = np.diag([-1.0, -1.0, 1.0])
    if np.isfinite(setup.table.target).any() or np.abs(turn - half).max() > SQUARE or np.abs(shift[:2]).max() > CENTRED:
        return [], setup
    base, platform = drawn(setup).base_radius_mm, drawn(setup).platform_radius_mm
    angle = np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))
    words = (
        f"the readings lie turned by {abs(angle):.1f} deg about z and shifted by only "
        f"{np.linalg.norm(shift[:2]):.1f} mm; with base and platform radius interchanged they lie as the drawing does"
    )
    fix = f"write base_radius_mm = {platform:g} and platform_radius_mm = {base:g}, if the drawing agrees"
    sure = platform > base
    cured = setup.with_drawing(base_radius_mm=platform, platform_radius_mm=base) if sure else setup
    return [Finding("radii-interchanged", words, fix, None, None, sure, setup.table.source)], cured


def _thinned(setup: Setup, most: int) -> Setup:
    """So many rows spread over the run, those with a reading first: every second one may have none."""
    used = used_rows(setup.table)
    read = used & np.isfinite(setup.table.measured).all(axis=1)
    rows = np.flatnonzero(read if read.any() else used)
    if len(rows) > most:
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, most).round().astype(int))]
    return replace(setup, table=take_rows(setup.table, rows)) if len(rows) < setup.table.rows else setup


def _is_broken(agreement: Agreement) -> bool:
    return agreement.worst > BROKEN


def _other_drawing(plain: Judged) -> Judged | None:
    """A length by which targets and commands, that differ by little, agree to their digits: the controller has it."""
    apart = plain.agreement.rms[2]
    if not apart > EXACT[0]:
        return None
    lengths = [item for item in fitted_mistakes(plain.setup) if item.mistake == "drawing-length"]
    judged = _judge_all(plain, lengths)
    return next((item for item in judged if item.agreement.rms[2] < apart / EXACT[1]), None)


def _search(plain: Judged) -> tuple[Judged, list[Judged]] | None:
    """The best one mistake, else the best two; None where nothing is a proof."""
    singles = _leaders([plain])
    best = _best(plain, singles)
    if best is None and singles and plain.total - singles[0].total > np.log(2.0):
        twos = _leaders(singles[:LEADERS])
        best = _best(plain, twos)
        singles = twos
    if best is None:
        return None
    ties = [other for other in singles if other is not best and other.total < best.total + TIE]
    return best, ties


def _leaders(starts: list[Judged]) -> list[Judged]:
    """The most promising next steps from each start, judged, best first."""
    judged = [item for start in starts for item in _judge_all(start, mistakes_in(start.setup))]
    if not any(_is_proof(item.plain, item) and item.worst < BROKEN and not _is_guessed(item) for item in judged):
        judged += [item for start in starts for item in _judge_all(start, list(fitted_mistakes(start.setup)))]
    return sorted(judged, key=lambda item: item.score)


def _is_guessed(item: Judged) -> bool:
    """Whether a slider was turned round and nothing told from where it counts."""
    told = np.isfinite(item.setup.table.target).any()
    return not told and any(step.mistake == "slider-sign" for step in item.steps)


def _judge_all(start: Judged, hypotheses: list[Hypothesis]) -> list[Judged]:
    """The leaders of a screen on fewer rows, judged."""
    thin = _thinned(start.setup, FEW_ROWS)
    setups = [hypothesis.undo(thin) for hypothesis in hypotheses]
    changed = [index for index, other in enumerate(setups) if other is not thin]
    totals = np.array([item.total(start.width) for item in agree([setups[index] for index in changed])])
    order = np.argsort(totals, kind="stable")
    kept = [index for rank, index in enumerate(order) if rank < LEADERS or totals[index] < totals[order[0]] + FALL]
    leaders = [hypotheses[changed[index]] for index in kept[: 2 * LEADERS]]
    return [judge(step.undo(start.setup), (*start.steps, step), start.plain or start) for step in leaders]


def _best(plain: Judged, judged: list[Judged]) -> Judged | None:
    """The first whose fall is a proof."""
    return next((item for item in judged if _is_proof(plain, item)), None)


def _is_proof(plain: Judged | None, item: Judged) -> bool:
    """Whether the error falls by far, from beyond what ordinary faults do to what they do."""
    if plain is None:
        return False
    before, after = plain.agreement.rms, item.agreement.beside(item.width)
    fell = np.isfinite(before) & (before > after)
    steep = np.nanmax(before) > STEEP * np.nanmax(after)
    large = before[fell].max(initial=0.0) > (BROKEN * _size(item) if steep else _least(item))
    deep = plain.total - item.total > len(item.steps) * FALL
    rest = max(float(np.nanmax(after)), FLOOR)
    each = np.nanmax(before) > np.exp(FALL) * rest and rest < BEYOND * _size(item)
    return bool(large and deep and each)


def _least(item: Judged) -> float:
    """How large an error has to be before a mistake is looked for; lengths are seen between targets and commands."""
    length = any(step.mistake == "drawing-length" for step in item.steps)
    return (BROKEN if length else BEYOND) * _size(item)


def _size(item: Judged) -> float:
    """Small machines have small faults."""
    return min(1.0, drawn(item.setup).link_length_mm / 200.0)


def _oddness(turn: np.ndarray) -> float:
    """A tracker stands upright before it stands on its head: parts hypotheses that fit alike."""
    tilt = np.arccos(np.clip(turn[2, 2], -1.0, 1.0))
    angle = np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))
    return float(0.04 * tilt + 0.01 * angle)


def _tell(plain: Judged, best: Judged, ties: list[Judged]) -> list[Finding]:
    pair = int(np.nanargmax(plain.agreement.rms / np.maximum(best.agreement.rms, FLOOR)))
    before, after = (1e3 * float(item.agreement.rms[pair]) for item in (plain, best))
    undone = " and ".join(step.undone for step in best.steps)
    same = _one_of_each(best, ties)
    also = f"; {_listed(same)} would do the same" if same else ""
    words = f"{APART[pair]} {_um(before)} um; with {undone} the error falls to {_um(after)} um{also}"
    source = plain.setup.table.source
    return [
        Finding(step.mistake, words, step.fix, before, after, _is_sure(step, plain, best), source)
        for step in best.steps
    ]


def _is_sure(step: Hypothesis, plain: Judged, best: Judged) -> bool:
    """A frame of the targets' own is followed by the fit; so is a machine built off its drawing."""
    if step.mistake == "target-frame":
        return False
    if step.mistake != "drawing-length":
        return True
    keys = ("link_length_mm", "base_radius_mm")
    moved = max(abs(getattr(best.setup.file.machine, key) - getattr(plain.setup.file.machine, key)) for key in keys)
    apart = plain.agreement.rms[2]
    return bool(moved > BUILT or (np.isfinite(apart) and apart > EXACT[0] and moved > SLIP))


def _one_of_each(best: Judged, ties: list[Judged]) -> list[str]:
    """Other things that are the same, the first of every kind."""
    kinds: dict[tuple[str, ...], str] = {}
    for tie in ties:
        kinds.setdefault(tuple(step.mistake for step in tie.steps), " and ".join(step.undone for step in tie.steps))
    return list(kinds.values())


def _listed(words: list[str], most: int = 3) -> str:
    shown = words[:most]
    return " or ".join(shown) + (f" or {len(words) - most} others" if len(words) > most else "")


def _um(value: float) -> str:
    return f"{value:,.0f}" if value >= 9.95 else f"{value:.1f}"
