"""What a fit found, in words and figures."""

from collections import Counter
from itertools import groupby

from ptt.fitting.report import FitReport, Value
from ptt.run.axes import AXES_TOTAL

MOST_SHARE = 10.0  # ratio of standard error to value beyond which a percentage says nothing
FEW_TRACELESS = 3  # combinations of one effect without a trace that are listed; more are counted
SHOWN_LINES = 12  # outliers and correlations that are listed
MOST_LISTED = 8  # values of one curve that are listed: the picture of a longer one says more than its values
MEASURED_WORDS = {
    "yes": "measured", "in part": "measured in combinations", "at least": "known from below",
    "no": "not measured", "fixed": "fixed", "searched": "searched",
}  # fmt: skip


def format_fit(report: FitReport) -> str:
    """The report as a person reads it.

    Args:
        report: the report.

    Returns:
        Several lines.
    """
    parts = [_statistics(report), _errors(report), _parameters(report), _outliers(report)]
    parts += [_pairs(report), _combinations(report)]
    return "\n".join(line for part in parts for line in part)


def _statistics(report: FitReport) -> list[str]:
    noise = report.noise_um
    seen = [f"    {report.observability.text}"] if report.observability.parameters else []
    return [
        "[[fit]]",
        f"    {report.status} after {report.iterations} evaluations",
        f"    {report.rows} readings, {report.unknowns} unknowns (frame included), of which the data see {report.rank}",
        f"    chi-squared {report.chi2:.1f}, per degree of freedom {report.reduced:.3f} ({report.freedom})",
        f"    noise {noise['total']:.2f} um (x {noise['x']:.2f}, y {noise['y']:.2f}, z {noise['z']:.2f}), from the"
        f" {noise['source']}",
        *seen,
    ]


def _errors(report: FitReport) -> list[str]:
    words = {
        "as read": "drawing, frame as read",
        "aligned": "drawing, frame aligned",
        "given": "model as given",
        "fitted": "fitted",
    }
    lines = ["[[errors]]  RMS in um" + "".join(f"{axis:>12}" for axis in AXES_TOTAL)]
    for key, word in words.items():
        if key in report.rms_um:
            figures = report.rms_um[key]
            lines.append(f"    {word:<23}" + "".join(f"{figures[axis]:12.2f}" for axis in AXES_TOTAL))
    noise = report.noise_um
    lines.append(f"    {'noise':<23}" + "".join(f"{noise[axis]:12.2f}" for axis in AXES_TOTAL))
    if report.orientation_mrad is not None:
        lines.append(f"    orientation, positions alone fitted: {report.orientation_mrad:.3f} mrad RMS")
    return lines


def _parameters(report: FitReport) -> list[str]:
    lines = list[str]()
    for effect, own in groupby(report.values, lambda value: value.effect):
        lines.append(f"[[{effect}]]")
        for _, some in groupby(own, lambda value: value.name.rpartition(".")[0] or value.name):
            lines += _lines_of(tuple(some))
    return lines


def _lines_of(values: tuple[Value, ...]) -> list[str]:
    """A line for each value, or one for all that together are one curve: by itself none of its many says anything."""
    if len(values) <= MOST_LISTED:
        return [f"    {value.name:<22} {_words(value)}" for value in values]
    name = f"{values[0].name} to {values[-1].name.rpartition('.')[2]}"
    low, high = (end(value.value for value in values) for end in (min, max))
    counts = Counter(value.measured for value in values)
    kinds = ", ".join(f"{counts[kind]} {words}" for kind, words in MEASURED_WORDS.items() if counts[kind])
    text = f"{low:.3g} to {high:.3g}, {len(values)} values of a curve: {kinds}; to_dict() and --json have each"
    return [f"    {name:<22} {text}"]


def _words(value: Value) -> str:
    if value.std is None:
        return f"{value.value:.6g}  ({value.measured})"
    if value.measured == "at least":
        return f"at least {value.value:.6g}: no move of the run takes a larger one up"
    if value.apart is not None:
        text = f"{value.value:.6g} +- {value.apart:.2g}"
        return f"{text} against the mean of all joints, which is not measured (+- {value.std:.2g})"
    if value.measured == "no":
        return "not measured: held by its usual size"
    seen = abs(value.std) <= MOST_SHARE * abs(value.value) and value.value != 0.0
    share = f" ({abs(value.std / value.value):.1%})" if seen else ""
    text = f"{value.value:.6g} +- {value.std:.2g}{share}"
    return f"{text}  in part: only combinations are measured" if value.measured == "in part" else text


def _outliers(report: FitReport) -> list[str]:
    if not report.outliers:
        return []
    worst = sorted(report.outliers, key=lambda far: -far.distance_mm)[:SHOWN_LINES]
    listed = ", ".join(f"line {far.line} ({far.distance_mm:.3f} mm)" for far in worst)
    more = f", and {len(report.outliers) - len(worst)} more" if len(report.outliers) > len(worst) else ""
    return [f"[[gross errors left out]]  {len(report.outliers)}", f"    {listed}{more}"]


def _pairs(report: FitReport) -> list[str]:
    if not report.correlations:
        return []
    lines = ["[[correlations above 0.9]]"]
    lines += [f"    {pair.first} / {pair.second} = {pair.value:+.3f}" for pair in report.correlations[:SHOWN_LINES]]
    if len(report.correlations) > SHOWN_LINES:
        lines.append(f"    and {len(report.correlations) - SHOWN_LINES} more")
    return lines


def _combinations(report: FitReport) -> list[str]:
    if not report.unobservable:
        return []
    traceless = Counter(item.effect for item in report.unobservable if not item.partners)
    lines, counted = ["[[what this run cannot tell]]"], set[str]()
    for item in report.unobservable:
        count = traceless[item.effect]
        if item.partners or count <= FEW_TRACELESS:
            lines.append(f"    {item.text}")
        elif item.effect not in counted:
            counted.add(item.effect)
            lines.append(
                f"    {item.effect}: {count} values and combinations leave no trace in this run, first {item.what}; "
                "to_dict() and --json have each"
            )
    return lines
