"""Picture of a diagnosis: held-out error before and after each candidate, and the noise floor."""

from matplotlib.figure import Figure

from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.show.plots.common import BLUE, DARK, DPI, NOISE, ORANGE, PALE, plain_log

SHOWN_CANDIDATES = 12  # in a picture
DECADES = 1000.0  # ratio of the axis' ends above which only powers of ten are labelled


def draw_candidates(result: Diagnosis) -> Figure:
    """Draw the held-out error before and after each candidate, the steps of the path first.

    Args:
        result: the diagnosis.

    Returns:
        The figure; where nothing is missing, the error as given beside the noise.
    """
    steps = {step[0] for step in result.suggested}
    shown = sorted(result.candidates[:SHOWN_CANDIDATES], key=lambda each: each.effect not in steps)
    figure = Figure(figsize=(8.6, 2.2 + 0.34 * max(len(shown), 1)), dpi=DPI, layout="constrained")
    panel = figure.subplots()
    for row, each in enumerate(shown):
        chosen = each.effect in steps
        ends = [each.heldout_before, each.heldout_after]
        panel.plot(ends, [row, row], color=ORANGE if chosen else PALE, linewidth=4, solid_capstyle="butt")
        panel.plot(ends[0], row, "|", color=DARK, markersize=11, label="before" if row == 0 else None)
        panel.plot(ends[1], row, "o", color=BLUE, label="after" if row == 0 else None)
    panel.axvline(1e3 * result.noise.total, color=NOISE, linestyle="--", linewidth=1.2, label="noise floor")
    if not shown:
        panel.plot(result.rms_um["before"]["total"], 0, "o", color=BLUE)
    names = [("+ " if each.effect in steps else "") + each.effect for each in shown] or ["as given"]
    panel.set_yticks(range(len(names)), names)
    # A candidate may change the error tenfold while a late step takes off the last um: both have to be seen.
    panel.set(xlabel="held-out error before and after [um]", xscale="log")
    panel.margins(x=0.06)
    low, high = panel.get_xlim()
    plain_log(panel.xaxis, (1.0,) if high / low > DECADES else (1.0, 2.0, 5.0))
    panel.invert_yaxis()
    panel.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    panel.set_title(f"verdict: {result.verdict}; + marks the effects to add")
    return figure
