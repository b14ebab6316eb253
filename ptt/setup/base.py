"""Base reflectors that do not lie to each other as the machine file has them."""

from ptt.run.base_frame import BASE_FIX, untrue_base
from ptt.setup.columns import said
from ptt.setup.result import Finding
from ptt.setup.setup import Setup


def find_base(setup: Setup) -> list[Finding]:
    """Base reflectors that would hold the frame and do not fit.

    Args:
        setup: both files, the run of one set-up of the tracker.

    Returns:
        At most one finding.
    """
    words = untrue_base(setup.file, setup.table) if setup.file.tracker.frame == "measured" else ""
    return [said(setup, "base-reflectors", words, BASE_FIX)] if words else []
