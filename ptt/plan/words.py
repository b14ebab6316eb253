"""What to measure next, in words that a machinist understands."""

from collections.abc import Iterator, Sequence

import numpy as np

from ptt.plan.contest import GOAL
from ptt.plan.pool import Conditions
from ptt.run.problem import Problem

FARTHER = 1.25  # ratio to the run's radius or height, beyond which new poses are said to go further


def say_separation(
    places: np.ndarray,
    problem: Problem,
    parted: Sequence[tuple[str, str, float, float]],
    conditions: Conditions,
) -> Iterator[str]:
    """Sentences on what to measure, and the separations that it gives.

    Args:
        places: (m, 3) mm, chosen tool positions.
        problem: the run.
        parted: (effect, rival, separation before, after) in sigma.
        conditions: loads, temperatures and speeds.

    Returns:
        Sentences.
    """
    under = _under(conditions)
    yield f"Measure {len(places)} rows{_where(places, problem)}, each pose from both sides of every joint{under}."
    for pick, rival, before, after in parted:
        short = "" if after >= GOAL else f"; {GOAL:g} sigma would need more rows"
        yield f"The separation of {pick} from {rival} rises from {before:.1f} to {after:.1f} sigma{short}."


def say_ambiguity(pick: str, rival: str, instrument: str) -> str:
    """Sentence on two effects that no pose tells apart.

    Args:
        pick: key of one.
        rival: key of the other.
        instrument: what could tell, or why little can.

    Returns:
        A sentence.
    """
    ambiguous = f"No pose tells {pick} from {rival}: the tracker sees the same either way."
    return f"{ambiguous} What may tell them apart: {instrument}."


def _where(places: np.ndarray, problem: Problem) -> str:
    """How the places differ from those of the run."""
    old = problem.view.p.numpy()[problem.used]
    middle = (old.max(axis=0) + old.min(axis=0)) / 2.0
    out, was = (np.percentile(np.linalg.norm((p - middle)[:, :2], axis=1), 90) for p in (places, old))
    tall, flat = np.ptp(places[:, 2]), np.ptp(old[:, 2])
    words = []
    if out > FARTHER * was:
        words.append(f"further out in x and y (to {out:.0f} mm, where the run went to {was:.0f})")
    if tall > FARTHER * max(flat, 1.0):
        words.append(f"over {tall:.0f} mm of height, where the run had {flat:.0f}")
    return f" {', and '.join(words)}" if words else " over the same volume"


def _under(conditions: Conditions) -> str:
    parts = []
    if len(conditions.payloads) > 1:
        parts.append(f"with the payloads of the column payload_kg ({_listed(conditions.payloads)} kg)")
    if len(conditions.temps) > 1:
        low, high = conditions.temps
        parts.append(f"with the machine once at {low:g} C and once at {high:g} C, as in the column temp_c")
    if len(conditions.feeds) > 1:
        parts.append(f"read while moving at {_listed(conditions.feeds)} mm/s")
    return ", " + ", ".join(parts) if parts else ""


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
