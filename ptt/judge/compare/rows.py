"""What a comparison says, for text and report alike: its figures, what they mean, its joints and its worst places."""

from collections.abc import Mapping
from dataclasses import dataclass

from ptt.dependence.said import by_chance
from ptt.dependence.where import WorstRow
from ptt.judge.compare.comparison import UM, Comparison, figures, one_figure

FAR = 3.0  # times the error after alignment, from which the error before it is explained
SURE = 0.01  # p-value below which lack of fit is significant
STANDS = (
    "Before alignment most of the error is the tracker's own position and orientation (an offset or tilt common to all "
    "joints looks the same), so the machine is judged after alignment."
)
NO_PLACE = "No part of the workspace or of the run stands out from noise."
NO_VARIABLE = "The error depends on no recorded variable."


@dataclass(frozen=True)
class JointRow:
    """The error of a run as that of one slider (um) or joint (urad).

    Attributes:
        label: as in 'slider 2'.
        rms: root mean square.
        ways: means of the readings that arrived up and down, or forward and back; None where there are none.
    """

    label: str
    rms: float
    ways: tuple[float | None, float | None]

    @property
    def gap(self) -> float | None:
        """Difference of the two means; None where one is missing."""
        first, second = self.ways
        return None if first is None or second is None else first - second


def error_rows(result: Comparison) -> list[tuple[str, Mapping[str, float]]]:
    """Figures of the error before and after frame alignment, and the noise, um.

    The column `total` holds figures of the length of the error vector: the largest of one axis may be another row's.

    Args:
        result: the comparison.

    Returns:
        Title of each row, and its figures by axis and total.
    """
    after, before = figures(result.residual[result.kept]), figures(result.unaligned[result.kept])
    raw, length = figures(result.raw[result.kept]), one_figure(result.lengths, UM)
    rows: list[tuple[str, Mapping[str, float]]] = [
        ("measured minus target, not aligned: RMS", raw["rms_um"]),
        ("measured minus model, before frame alignment: RMS", before["rms_um"]),
        (f"removed by frame alignment ({result.frame}): RMS", result.frame_removed),
    ]
    if result.by_base is not None:
        rows.append(("aligned by the base reflectors alone: RMS", figures(result.by_base[result.kept])["rms_um"]))
    rows.append(("after frame alignment: RMS", after["rms_um"]))
    for words, key in (("mean |error|", "mean_um"), ("95th percentile", "p95_um"), ("largest", "max_um")):
        rows.append((f"after frame alignment: {words}", after[key] | {"total": length[key]}))
    if result.noise is not None:
        rows.append((f"noise floor, one sigma ({result.noise.source})", result.noise.to_dict()))
    return rows


def meaning(result: Comparison) -> list[str]:
    """What the figures mean: the share of the error beyond noise, and the test of lack of fit.

    Args:
        result: the comparison.

    Returns:
        Sentences.
    """
    share, test = result.explainable_share, result.lack_of_fit
    before, after = (figures(each[result.kept])["rms_um"]["total"] for each in (result.unaligned, result.residual))
    words = [STANDS] if before > FAR * after else []
    if share is None:
        words.append("How much of the error is noise is unknown.")
    elif result.is_noise:
        words.append("The error after frame alignment is no more than noise.")
    else:
        words.append(f"After frame alignment {percent(share)} of the mean-square error is more than noise.")
    if test.p_value is None:
        return [*words, f"Lack of fit was not tested: {test.to_dict()['untested_because']}."]
    verb = "exceed" if test.p_value < SURE else "do not exceed"
    return [*words, f"The model's errors {verb} the scatter of repeats (lack of fit, {by_chance(test.p_value)})."]


def joint_title(result: Comparison) -> str:
    """Title of the table of joints."""
    return f"the same error expressed at the {'joints, urad' if result.serial else 'sliders, um'}"


def joint_head(result: Comparison) -> tuple[str, ...]:
    """Heads of the columns behind the joint's name."""
    return ("RMS", *(f"mean arriving {way}" for way in _ways(result)), "difference")


def joint_rows(result: Comparison) -> list[JointRow]:
    """Errors of the joints that would cause the residual, by side of arrival."""
    factor = 1e6 if result.serial else 1e3
    sides = {part.label: part for part in result.where.by_direction}
    rows = []
    for part in result.where.by_joint:
        first, second = (sides.get(f"{part.label} {way}") for way in _ways(result))
        means = (None if first is None else factor * first.mean, None if second is None else factor * second.mean)
        rows.append(JointRow(part.label, factor * part.rms, means))
    return rows


def _ways(result: Comparison) -> tuple[str, str]:
    return ("forward", "back") if result.serial else ("up", "down")


def worst_part(result: Comparison) -> str | None:
    """The worst part of the workspace; None where none is worse than the others."""
    region = result.where.region
    if region is None:
        return None
    ends = zip("xyz", region.low, region.high, strict=True)
    spans = ", ".join(f"{axis} {low:.0f} to {high:.0f}" for axis, low, high in ends)
    size = f"{1e3 * region.mean:.1f} +- {1e3 * region.error:.1f} um"
    return f"worst part of the workspace: {spans} mm, mean error {size} ({region.rows} readings)"


def place_of(result: Comparison, row: WorstRow) -> str:
    """Where a row stands; the file too where several were read."""
    return f"{row.run} line {row.line}" if result.files > 1 else f"line {row.line}"


def percent(share: float) -> str:
    """A share in percent; one below 1 is never rounded to 100 %."""
    if 0.9995 <= share < 1.0:
        return "> 99.9 %"
    return f"{100.0 * share:.1f} %" if 0.99 <= share < 1.0 else f"{100.0 * share:.0f} %"
