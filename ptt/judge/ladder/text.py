"""The ladder in words: a table of errors after each step, and one plain sentence on what each step did."""

from itertools import pairwise

from ptt.judge.ladder.ladder import CHANCE, Ladder, LadderStep
from ptt.run.axes import AXES_TOTAL
from ptt.run.noise import SATURATED

NOTED = 1.5  # ratio to a stated noise, from which the remaining error is more than noise


def format_ladder(ladder: Ladder) -> str:
    """The ladder as a person reads it.

    Args:
        ladder: the ladder.

    Returns:
        Several lines.
    """
    axes = "".join(f"{axis:>9}" for axis in AXES_TOTAL)
    lines = [f"{'RMS in um':<28}{'training':>36}{'held out':>36}", f"{'':<28}{axes}{axes}"]
    for step in ladder.steps:
        sign = {"added": "+ ", "removed": "- "}.get(step.kind, "")
        figures = [step.rms_um[axis] for axis in AXES_TOTAL] + [step.heldout_rms_um[axis] for axis in AXES_TOTAL]
        lines.append(f"{sign + step.effect:<28}" + "".join(f"{value:9.2f}" for value in figures))
    noise = [ladder.noise_um[axis] for axis in AXES_TOTAL]
    source = f"noise ({ladder.noise_um['source']})"
    lines.append(f"{source:<28}" + "".join(f"{value:9.2f}" for value in noise * 2))
    lines += ["training: all rows, as fitted; 'as given' is the error that compare prints, but for rows set aside"]
    lines += [f"held out: {ladder.protocol}", *verdicts(ladder)]
    lines += left_over(ladder)
    lines += [stretch.words for stretch in ladder.report.stretches]
    lines += ladder.notes
    return "\n".join(lines)


def left_over(ladder: Ladder) -> list[str]:
    """One sentence where the last step leaves clearly more than a noise that no model gave; else none."""
    left, noise = ladder.steps[-1].rms_um["total"], ladder.noise_um["total"]
    if ladder.noise_um["source"] == SATURATED or left <= NOTED * noise:
        return []
    return [f"the remaining error is {left / noise:.1f} x the noise: run `ptt diagnose` with the new model"]


def verdicts(ladder: Ladder) -> list[str]:
    """One sentence on each step that added or removed something."""
    return [_verdict(before, step) for before, step in pairwise(ladder.steps) if step.kind != "refit"]


def _verdict(before: LadderStep, step: LadderStep) -> str:
    old, new = before.heldout_rms_um["total"], step.heldout_rms_um["total"]
    change = f"held-out error {'falls' if new < old else 'rises'} from {old:.2f} to {new:.2f} um"
    if step.kind == "removed":
        return f"{step.effect} was {'not needed' if step.helped else 'needed'}: without it the {change}"
    if step.helped:
        return f"{step.effect} helped: {change}"
    if f"{new:.2f}" != f"{old:.2f}" and new < old:
        sure = f"by {step.fall:.1f} standard errors of the gain per pose, where {CHANCE:g} would be clear"
        return f"{step.effect} may not help: {change}, {sure}"
    return f"{step.effect} did not help: the held-out error did not fall ({old:.2f} to {new:.2f} um)"
