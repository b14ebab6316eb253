"""What a fit found and what it could not find: one frozen report, as text in the manner of lmfit and as JSON."""

from collections import Counter
from dataclasses import dataclass
from itertools import groupby
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ptt.fitting.indices import Indices, observability_indices, project_off
from ptt.fitting.observability import Combination, Correlation, correlations, unobservable
from ptt.fitting.orientation import orientation_rms
from ptt.fitting.result import UNMEASURED, FitResult, sound_rows
from ptt.fitting.solve import residual_of
from ptt.fitting.stretches import Stretch, name_stretches
from ptt.fitting.turns import open_turns
from ptt.model.model import Model, parameter_names, told_values
from ptt.record import Record
from ptt.run.axes import AXES_TOTAL, rms
from ptt.run.problem import Problem

# share of a value's standard error below which its difference from the joints' mean counts as measured
KNOWN_APART = 0.5
MOST_SHARE = 10.0  # ratio of standard error to value beyond which a percentage says nothing
FEW_TRACELESS = 3  # combinations of one effect without a trace that are listed; more are counted
SHOWN_LINES = 12  # outliers and correlations that are listed
MOST_LISTED = 8  # values of one curve that are listed: the picture of a longer one says more than its values
MEASURED_WORDS = {
    "yes": "measured", "in part": "measured in combinations", "at least": "known from below",
    "no": "not measured", "fixed": "fixed", "searched": "searched",
}  # fmt: skip


@dataclass(frozen=True)
class Value:
    """One fitted number.

    Attributes:
        effect: key of the effect.
        name: with unit, as in 'gap_mm 2'.
        value: in that unit.
        std: standard error; None where it was held or searched.
        measured: 'yes', 'in part' (only combinations with others are), 'at least' (a larger one would read the same),
            'no', 'fixed' or 'searched'.
        apart: standard error of what it is more than the mean of all joints, where the value by itself is not measured
            and that is; else None.
    """

    effect: str
    name: str
    value: float
    std: float | None
    measured: str
    apart: float | None = None


class Motion(NamedTuple):
    """One motion of the tracker's frame and its standard error, mm or rad."""

    value: float
    std: float


class Far(NamedTuple):
    """A gross error: its line in the file, and how far off it lies."""

    line: int
    distance_mm: float


@dataclass(frozen=True)
class FitReport(Record):
    """A fit in figures and words.

    Attributes:
        status: 'converged' or what kept it from converging.
        rows: readings that counted.
        chi2: weighted sum of squares.
        freedom: degrees of freedom.
        rank: directions that the data see.
        unknowns: numbers that were fitted, frames included.
        iterations: evaluations of the derivative.
        values: effect parameters.
        frames: motions of the tracker frame, by name.
        outliers: gross errors, one by one.
        stretches: rows in a row that are off together, left out as well.
        rms_um: of the drawing 'as read' (before frame alignment) and 'aligned' (after it, by the frame policy), and
            of the model, 'given' (as it was) and 'fitted'.
        noise_um: per axis, in total, and its source.
        correlations: above 0.9, between measured parameters.
        unobservable: combinations that the data cannot see.
        orientation_mrad: root mean square angle between measured and fitted orientations; None where none are read.
        observability: indices O1 to O5 of the effects' parameters, frame and reflector mount projected off.
    """

    keys: ClassVar[str] = (
        "status, rows, chi2, reduced_chi2: reduced, degrees_of_freedom: freedom, rank, unknowns, iterations, "
        "parameters: values, frame: frames, outliers, stretches, rms_um, noise_um, correlations, unobservable, "
        "observability, orientation_rms_mrad: orientation_mrad"
    )

    status: str
    rows: int
    chi2: float
    freedom: int
    rank: int
    unknowns: int
    iterations: int
    values: tuple[Value, ...]
    frames: dict[str, Motion]
    outliers: tuple[Far, ...]
    stretches: tuple[Stretch, ...]
    rms_um: dict[str, dict[str, float]]
    noise_um: dict[str, Any]
    correlations: tuple[Correlation, ...]
    unobservable: tuple[Combination, ...]
    observability: Indices
    orientation_mrad: float | None = None

    @property
    def reduced(self) -> float:
        """Chi-squared per degree of freedom: one where only noise is left."""
        return self.chi2 / self.freedom


def report_fit(fitted: FitResult, problem: Problem, given: FitResult | None = None) -> FitReport:
    """Gather what a fit found.

    Args:
        fitted: the fit.
        problem: what it was fitted to.
        given: the model as it was before; None where it had no effects.

    Returns:
        The report.
    """
    rows = sound_rows(problem, fitted)
    bare = given is not None and not given.model.terms
    drawn = given if given and bare else residual_of(Model(fitted.model.file), problem, fitted.noise)
    read = problem.table.measured - problem.stated if problem.base is None else problem.measured - problem.target
    as_it_was = (given or drawn).residual
    stages = {"as read": read, "aligned": drawn.residual, "given": as_it_was, "fitted": fitted.residual}
    errors = {stage: rms(error, rows) for stage, error in stages.items()}
    stretches, alone = name_stretches(fitted.outliers, fitted.residual, problem)
    lines, far = problem.table.line[alone].tolist(), np.linalg.norm(fitted.residual[alone], axis=1).tolist()
    return FitReport(
        fitted.status, int(rows.sum()), fitted.chi2, fitted.freedom, fitted.rank, len(fitted.unknowns),
        fitted.iterations, _values(fitted), _frames(fitted), tuple(map(Far, lines, far)), stretches, errors,
        fitted.noise.to_dict(), correlations(fitted), (*unobservable(fitted), *open_turns(fitted)),
        observability_indices(
            project_off(fitted.information, np.flatnonzero(fitted.layout.owner >= 0)), int(rows.sum())
        ),
        orientation_rms(fitted, problem),
    )  # fmt: skip


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


def _values(fitted: FitResult) -> tuple[Value, ...]:
    layout, place = fitted.layout, 0
    unseen = (fitted.unseen**2).sum(axis=1)
    std, apart, found = fitted.std, _apart(fitted), list[Value]()
    kind = fitted.model.file.machine.kind
    for term, free, theta in zip(layout.terms, layout.free, layout.thetas(fitted.unknowns), strict=True):
        names = parameter_names(term.effect, kind, fitted.model.joints)
        told = told_values(term.effect, theta, fitted.model.joints)
        stems = [item.stem for item in term.effect.parameters for _ in range(item.size(fitted.model.joints))]
        for name, stem, flag, value, said in zip(names, stems, free, theta.tolist(), told, strict=True):
            if not said:
                continue
            if flag:
                how = "yes" if fitted.measured[place] else "no" if unseen[place] > UNMEASURED else "in part"
                how = "at least" if layout.names[place] in fitted.least else how
                found.append(Value(term.effect.key, name, value, float(std[place]), how, apart.get(place)))
                place += 1
            else:
                how = "fixed" if stem in term.fixed else "searched"
                found.append(Value(term.effect.key, name, value, None, how))
    return tuple(found)


def _apart(fitted: FitResult) -> dict[int, float]:
    """Of unknowns that are not measured by themselves, standard errors less the mean of all joints, where that is."""
    stems: dict[tuple[int, str], list[int]] = {}
    for place, (owner, name) in enumerate(zip(fitted.layout.owner, fitted.layout.names, strict=True)):
        if owner >= 0 and not fitted.measured[place]:
            stems.setdefault((int(owner), name.rpartition(" ")[0]), []).append(place)
    found = dict[int, float]()
    for places in stems.values():
        own = np.array(places)
        std = fitted.apart(own)
        if len(own) == fitted.model.joints and (std < KNOWN_APART * fitted.std[own]).all():
            found |= dict(zip(places, std.tolist(), strict=True))
    return found


def _frames(fitted: FitResult) -> dict[str, Motion]:
    own = np.flatnonzero(fitted.layout.owner < 0)
    return {fitted.layout.names[i]: Motion(float(fitted.values[i]), float(fitted.std[i])) for i in own}


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
