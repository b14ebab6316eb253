"""The diagnosis in words that a machinist understands."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ptt.effects.base import sizes
from ptt.model import Term
from ptt.noise import Noise
from ptt.problem import Problem

if TYPE_CHECKING:
    from ptt.diagnosis.verdict import Diagnosis

# Effect -> (sentence about the joints that have it, parameter to show, factor, unit, decimals). {who} names the joints.
SENTENCES: dict[str, tuple[str, str, float, str, int]] = {
    "homing-offset": ("{who} {is_} off zero by {what}: homing", "offset", 1e3, "um", 0),
    "lead-scale": ("{who} travel{s} too far by {what} of the way: screw lead", "scale", 1e6, "um/m", 0),
    "screw-error-map": (
        "{who} {has} an uneven screw, up to {what} along its length: screw error",
        "curve",
        1e3,
        "um",
        0,
    ),
    "once-per-rev": ("{who} repeat{s} an error of {what} with every turn of the screw", "cosine+sine", 1e3, "um", 1),
    "backlash": ("{who} lose{s} {what} on reversal: backlash", "gap", 1e3, "um", 0),
    "windup": ("{who} change{s} over gradually by {what} after a reversal: wind-up", "height", 2e3, "um", 1),
    "following-error": ("{who} come{s} {what} late while moving: following error", "lag", 1e3, "ms", 1),
    "screw-growth": ("{who} grow{s} with warmth by {what}: screw growth", "growth", 1e6, "um/m/K", 1),
    "axis-compliance": ("{who} give{s} way by {what}: axis compliance", "compliance", 1e3, "um/N", 3),
    "tower-position": ("{who} stand{s} off by {what}: tower position", "radial+tangential", 1e3, "um", 0),
    "tower-tilt": ("{who} lean{s} by {what}: tower tilt", "radial+tangential", 1e3, "mrad", 2),
    "link-length": ("{who} {is_} too long by {what}: link length", "length", 1e3, "um", 0),
    "guide-straightness": (
        "{who} wander{s} sideways by up to {what}: guide straightness",
        "radial+tangential",
        1e3,
        "um",
        0,
    ),
    "joint-offset": (
        "{who} change{s} its length with its angle, {what}: joint offset",
        "rail+tangential",
        1e3,
        "um",
        0,
    ),
    "joint-clearance": ("{who} {has} {what} of play that changes side with the link force", "clearance", 1e3, "um", 0),
    "platform-twist": (
        "{who} {has} skew joint axes of {what}, which turn the platform",
        "radial+upward",
        1e3,
        "mrad",
        2,
    ),
    "joint-error-map": (
        "{who} turn{s} unevenly, alike at every turn, by {what} (all harmonics together): encoder or gear",
        "cosine+sine+fast_cosine+fast_sine",
        1e6,
        "urad",
        0,
    ),
    "self-weight": (
        "the joints sag by up to {what} under the weight of the links behind them: self-weight",
        "along+across",
        1e3,
        "mrad",
        2,
    ),
    "dh-offsets": ("{who} differ{s} from the drawing, in length by {what}: link geometry", "da", 1e3, "um", 0),
    "column-bend": ("the column bends sideways by {what} of payload: column bend", "sway", 1e3, "um/kg", 1),
    "frame-growth": ("frame and links grow with warmth by {what}: frame growth", "radius+link", 1e6, "um/m/K", 1),
    "tracker-frame": ("the readings are shifted by {what}, and turned: tracker frame", "shift", 1e3, "um", 0),
    "tracker-scale": ("the tracker's unit of length is off by {what}", "scale", 1e6, "um/m", 1),
    "tracker-drift": ("the tracker's station drifts by {what} over the run", "drift", 1e3, "um", 0),
    "setup-jump": ("the tracker was knocked part-way: its readings jump by {what}", "shift", 1e3, "um", 0),
}
LEGS = {"link-length", "joint-offset", "joint-clearance", "platform-twist"}
LINKS = {"dh-offsets"}
TOWERS = {"tower-position", "tower-tilt"}
MISSING = "Something is missing that no known effect describes"
EXCESS = 1.5  # times the noise that are worth a word
SIGNIFICANT = 3.0  # standard errors from which a joint's share is worth a word


def explain_step(
    term: Term,
    others: Sequence[str],
    together: Sequence[str],
    heldout_um: tuple[float, float],
    noise: Noise,
    problem: Problem,
) -> str:
    """One step in one or two sentences.

    Args:
        term: the effect, fitted.
        others: effects that would do as well.
        together: effects that would do as well only together.
        heldout_um: held-out error before and after.
        noise: the noise floor.
        problem: for the mechanism family.

    Returns:
        For example 'Sliders 2 and 3 lose 41 and 38 um on reversal: backlash. Nothing else explains it as well;
        held-out error falls from 62 to 9 um, noise is 7 um.'
    """
    head = _sentence(term, problem)
    tie = f"{_listed(list(others))} would explain it as well" if others else "Nothing else explains it as well"
    if together:
        tie = f"{tie}, but {_listed(list(together))} together would do the same"
    before, after = heldout_um
    moved = "falls" if after < before else "goes"
    fall = f"held-out error {moved} from {before:.1f} to {after:.1f} um, noise is {noise.total * 1e3:.1f} um"
    return f"{head[0].upper()}{head[1:]}. {tie[0].upper()}{tie[1:]}; {fall}."


def explain_verdict(result: "Diagnosis", steps: int | None = None) -> str:
    """The verdict in a few sentences.

    Args:
        result: the diagnosis.
        steps: how many effects could be added; None for as many as it takes.

    Returns:
        Text.
    """
    noise = result.noise.total * 1e3
    before, after = result.rms_um["before"]["total"], result.rms_um["after"]["total"]
    told = " ".join(candidate.words for candidate in result.candidates[: len(result.suggested)])
    if result.verdict == "nothing-missing":
        return (
            f"Nothing is missing that these {result.rows} readings could show: the error is {after:.1f} um, "
            f"the noise {noise:.1f} um ({result.noise.source}).{_excess(result)}"
        )
    if result.verdict == "missing":
        return f"{told} With that the error is {after:.1f} um, down from {before:.1f} um.{_excess(result)}"
    partly = f"Helps, but is not all: {told} " if told else ""
    why = "; ".join(result.rest.reasons)
    on = _strongest(result)
    stopped = steps is not None and steps == len(result.suggested)
    what = "More is missing, but no more steps were allowed" if stopped else MISSING
    return f"{partly}{what}: {why}.{on}"


def _excess(result: "Diagnosis") -> str:
    """A word where much more is left than the noise is said to be, though it follows nothing that was recorded."""
    times = result.rms_um["after"]["total"] / max(result.noise.total * 1e3, 1e-12)
    if times < EXCESS:
        return ""
    return (
        f" That is {times:.1f} x the noise by the {result.noise.source}: they understate the scatter of a reading, or "
        "something is missing that follows nothing recorded here."
    )


def _strongest(result: "Diagnosis") -> str:
    if not result.depends_on:
        return ""
    first = result.depends_on[0]
    period = f" with a period of {first.period_mm:.3g} mm" if first.period_mm else ""
    place = f" between {first.place[0]:.0f} and {first.place[1]:.0f}" if first.place else ""
    place = f", in a measure that varies with {first.with_}" if first.with_ else place
    return f" What is left of {first.residual} follows {first.on}{period}{place} ({first.share:.0%} of its variance)."


def _sentence(term: Term, problem: Problem) -> str:
    entry = SENTENCES.get(term.effect.name)
    if entry is None:
        return f"{term.effect.key} explains a part"
    text, stems, factor, unit, decimals = entry
    values, stds = _magnitudes(term, stems.split("+"), problem.view.joints)
    shown_first = next(p for p in term.effect.parameters if p.stem == stems.split("+")[0])
    per_joint = shown_first.per_joint
    if problem.file.machine.kind == "serial" and shown_first.axis and unit in ("um", "um/N"):
        unit = {"um": "urad", "um/N": "urad/Nmm"}[unit]
        factor *= 1e3
    if problem.file.machine.kind == "serial":
        text = text.replace("screw lead", "gear or encoder scale").replace("travel{s}", "turn{s}")
    if not per_joint:
        return text.format(what=f"{np.linalg.norm(values) * factor:.{decimals}f} {unit}")
    shown = [i for i in range(len(values)) if values[i] > SIGNIFICANT * stds[i]] or [int(np.argmax(values))]
    noun = _noun(term.effect.name, problem)
    plural = len(shown) > 1
    who = f"{noun}{'s' if plural else ''} {_listed([str(i + 1) for i in shown])}"
    what = f"{_listed([f'{values[i] * factor:.{decimals}f}' for i in shown])} {unit}"
    verbs = {"s": "" if plural else "s", "is_": "are" if plural else "is", "has": "have" if plural else "has"}
    return text.format(who=who, what=what, **verbs)


def _magnitudes(term: Term, stems: Sequence[str], joints: int) -> tuple[np.ndarray, np.ndarray]:
    """Size and standard error of what each joint (or coordinate) has, several parameters taken together."""
    parts, errors, start = [], [], 0
    for parameter, size in zip(term.effect.parameters, sizes(term.effect, joints), strict=True):
        part = slice(start, start + size)
        start += size
        if parameter.stem not in stems:
            continue
        groups = joints if parameter.per_joint else size
        std = np.full(size, np.nan) if term.std is None else term.std[part].numpy()
        parts.append(np.abs(term.theta[part].numpy()).reshape(groups, -1))
        errors.append(np.nan_to_num(std).reshape(groups, -1))
    values, stds = np.concatenate(parts, axis=1), np.concatenate(errors, axis=1)
    return np.sqrt(np.square(values).sum(axis=1)), np.sqrt(np.square(stds).sum(axis=1))


def _noun(name: str, problem: Problem) -> str:
    if problem.file.machine.kind == "serial":
        return "link" if name in LINKS else "joint"
    return "link" if name in LEGS else "tower" if name in TOWERS else "slider"


def _listed(items: list[str]) -> str:
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"
