"""Base reflectors whose arrangement contradicts the machine file."""

from ptt.run.base_frame import BASE_FIX, odd_base, untrue_base
from ptt.setup.columns import said
from ptt.setup.result import Finding
from ptt.setup.setup import Setup


def find_base(setup: Setup) -> list[Finding]:
    """Base reflectors of a measured frame that contradict the machine file or are missing from it.

    Args:
        setup: both files, the run of one set-up of the tracker.

    Returns:
        At most one finding.
    """
    if setup.file.tracker.frame != "measured":
        return []
    if words := untrue_base(setup.file, setup.table):
        return [said(setup, "base-reflectors", words, BASE_FIX)]
    unknown, off = odd_base(setup.file, setup.table)
    if unknown:
        words = f"the run has readings of base reflectors that the machine file lacks: {', '.join(unknown)}"
        return [said(setup, "base-reflectors", words, "add a [[tracker.base_point]] for each", False)]
    words = f"left out, as distances to the others contradict [[tracker.base_point]]: {', '.join(off)}"
    return [said(setup, "base-reflectors", words, BASE_FIX, False)] if off else []
