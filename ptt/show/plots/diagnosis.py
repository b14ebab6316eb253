"""A diagnosis as a picture: the held-out error that each candidate takes away, and the noise floor to reach."""

from matplotlib.figure import Figure

from ptt.diagnosis.diagnosis import Diagnosis
from ptt.show.plots.common import BLUE, DPI, ORANGE, PALE

SHOWN = 12  # candidates in a picture


def draw_candidates(result: Diagnosis) -> Figure:
    """Draw the held-out error before and after each candidate, the steps of the path first.

    Args:
        result: the diagnosis.

    Returns:
        The figure; where nothing is missing, the error as given beside the noise.
    """
    steps = {step[0] for step in result.suggested}
    shown = sorted(result.candidates[:SHOWN], key=lambda each: each.effect not in steps)
    figure = Figure(figsize=(8.6, 1.9 + 0.34 * max(len(shown), 1)), dpi=DPI, layout="constrained")
    panel = figure.subplots()
    for row, each in enumerate(shown):
        chosen = each.effect in steps
        panel.plot([each.heldout_after, each.heldout_before], [row, row], color=ORANGE if chosen else PALE, linewidth=4)
        panel.plot(each.heldout_after, row, "o", color=BLUE)
    panel.axvline(1e3 * result.noise.total, color="#6b705c", linestyle="--", linewidth=1.2, label="noise floor")
    if not shown:
        panel.plot(result.rms_um["before"]["total"], 0, "o", color=BLUE)
    names = [("+ " if each.effect in steps else "") + each.effect for each in shown] or ["as given"]
    panel.set_yticks(range(len(names)), names)
    panel.set(xlabel="held-out error before and after [um]", xlim=(0.0, None))
    panel.invert_yaxis()
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(loc="lower right", frameon=False)
    panel.set_title(f"verdict: {result.verdict}; + is a step of the path")
    return figure
