"""Known effects that a run cannot test and that an unknown may be, by what it follows and where it acts."""

import re
from typing import Any

from ptt.dependence.dependence import Dependence
from ptt.effects import library
from ptt.effects.cards import card_of
from ptt.effects.phrases import listed

# The variable of an effect's law, as its card has it -> the variables that an unknown follows if it is that effect, on
# a run that cannot test it: warmth that was not noted shows as time. Positions are left out: most effects vary with
# them.
SHOWS_AS = {
    "b": r"[bq]\d+", "phase": r"[bq]\d+", "temperature": "temperature|time", "time": "time", "speed": r"speed\d+|feed",
    "payload": "payload", "load": "payload", "link force": "payload", "travel": r"direction\d+",
}  # fmt: skip
# Place -> stages of the effects that move it; others act anywhere
ACTS_AT = dict.fromkeys(("slider", "joint"), ("drive",)) | dict.fromkeys(("rail", "link"), ("geometry", "structure"))


def untested(result: Any, strongest: Dependence) -> str:
    """A sentence on effects that may be the unknown, though this run cannot test them.

    Args:
        result: a diagnosis.
        strongest: what the unknown depends on most.

    Returns:
        With a blank before it; '' for none, and where the unknown switches or jumps over time, or follows another joint
        than the one that errs, as no such effect does.
    """
    known, stages = library(), ACTS_AT.get((strongest.acts_on or "").split(" ")[0])
    may_be = [
        name for name in result.not_testable
        if name in known and (stages is None or known[name].stage in stages)
        and re.fullmatch(SHOWS_AS.get(card_of(known[name]).telling, ""), strongest.on)
    ]  # fmt: skip
    sudden = strongest.on == "time" and strongest.shape in ("levels", "step")
    if sudden or _of_another_joint(strongest) or not may_be:
        return ""
    needs = listed(list(dict.fromkeys(result.not_testable[name] for name in may_be)))
    return f" It may be {listed(may_be, ' or ')}; to test that, `ptt diagnose` needs {needs}."


def _of_another_joint(strongest: Dependence) -> bool:
    """Whether one joint, slider, rail or link errs with a variable of another joint."""
    place = re.search(r"\d+", strongest.acts_on or strongest.residual)
    followed = re.fullmatch(r"(?:[bq]|speed|direction)(\d+)", strongest.on)
    return place is not None and followed is not None and place[0] != followed[1]
