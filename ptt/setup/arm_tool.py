"""A trusted reflector position or tracker frame of an arm that the readings contradict."""

from dataclasses import replace

import numpy as np

from ptt.mechanisms.serial import Serial
from ptt.setup.arm import BROKEN, LEAST_ROWS, choose_rows
from ptt.setup.arm_fit import arm_spec, judge_arm, mount_of_rows
from ptt.setup.columns import said
from ptt.setup.elsewhere import FREE_FRAME, UNHEARD, listed
from ptt.setup.proof import FALL
from ptt.setup.result import Finding
from ptt.setup.setup import Setup


def find_tool(setup: Setup) -> tuple[list[Finding], Setup]:
    """A trusted reflector position, tracker frame, or both, that the readings of an arm contradict.

    Every other check fits the reflector offset, so none of them shows this.

    Args:
        setup: both files of an arm in which nothing else was found.

    Returns:
        At most one finding, and the files with that fitted.
    """
    rows, tracker = choose_rows(setup), setup.file.tracker
    if len(rows) < LEAST_ROWS or (tracker.tool != "trusted" and setup.free):
        return [], setup
    before = judge_arm(setup, rows, mounted=tracker.tool != "trusted")
    if before < UNHEARD:
        return [], setup
    most = min(before / FALL, BROKEN * Serial.from_spec(arm_spec(setup)).reach_mm)
    for freed in (("tool",), ("frame",), ("tool", "frame")):
        if any(getattr(tracker, each) != "trusted" for each in freed):
            continue
        fitted = tracker.model_copy(update=dict.fromkeys(freed, "fitted"))
        cured = replace(setup, file=replace(setup.file, tracker=fitted))
        after = judge_arm(cured, rows, mounted=fitted.tool != "trusted")
        if after > most:
            continue
        ways = [
            _of_tool(setup, mount_of_rows(cured, rows)) if each == "tool" else (_OF_FRAME, FREE_FRAME) for each in freed
        ]
        words, fix = (" and ".join(parts) for parts in zip(*ways, strict=True))
        sentence = (
            f"the readings differ from the commands by {1e3 * before:,.0f} um; with {words}, "
            f"the error falls to {1e3 * after:,.0f} um"
        )
        found = said(setup, "wrong-reflector", sentence, fix)
        return [replace(found, before_um=1e3 * before, after_um=1e3 * after)], cured
    return [], setup


_OF_FRAME = "the tracker standing elsewhere than the trusted frame says"


def _of_tool(setup: Setup, mount: np.ndarray) -> tuple[str, str]:
    """A reflector offset in words, and the fix."""
    aside, drawn = listed(mount, 1), np.array(arm_spec(setup).tool_mm)
    words = f"the reflector at ({aside}) mm from the tool point, in the tool's own axes"
    fix = f'write tool = "fitted" under [tracker], or tool_mm = [{listed(drawn + mount, 2)}] under [machine]'
    return words, fix
