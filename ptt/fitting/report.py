"""What a fit found and what it could not find: one frozen report, as text in the manner of lmfit and as JSON."""

from dataclasses import dataclass
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
from ptt.run.axes import rms
from ptt.run.problem import Problem

# share of a value's standard error below which its difference from the joints' mean counts as measured
KNOWN_APART = 0.5


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
