"""A run compared with a model: size of the error, its part beyond noise, where it is, and what it depends on."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.dependence.contexts import residual_views
from ptt.dependence.dependence import Dependence
from ptt.dependence.following import dependence_of
from ptt.dependence.where import WhereItFails, WorstRow, rows_by_size, where_it_fails
from ptt.fitting.result import sound_rows
from ptt.fitting.solve import residual_of
from ptt.fitting.stretches import Stretch, name_stretches
from ptt.judge.compare.lack_of_fit import LackOfFit, lack_of_fit_of
from ptt.model.model import Model
from ptt.progress import Progress, unwatched
from ptt.run.axes import AXES, AXES_TOTAL
from ptt.run.noise import Noise
from ptt.run.problem import Problem

LEAST_SHARE = 0.05  # share of the mean square beyond noise, below which the error counts as noise
SURE = 3.0  # standard deviations of the ratio of two mean squares, within which it is one by chance
UM = 1e3  # um per mm
URAD = 1e6  # urad per rad


@dataclass(frozen=True)
class Comparison:
    """A run compared with a model.

    Attributes:
        raw: measured less target without alignment, (n, 3) mm; NaN where not observed.
        unaligned: measured less model without alignment, (n, 3) mm.
        by_base: measured less model in the frame of the base reflectors alone, (n, 3) mm; None unless the frame is
            measured.
        residual: measured less model after the frame policy, (n, 3) mm; a measured frame is fitted to base reflectors
            and all other readings together.
        joint: 'slider 1'.. (n,) mm or 'joint 1'.. (n,) rad, the joint errors that would cause the residual.
        kept: rows that count, (n,) bool.
        outliers: single gross errors, left out of every figure, worst first.
        stretches: consecutive rows with a common gross error, left out as well.
        frame: the frame policy.
        noise: the noise floor, None where nothing tells it.
        lack_of_fit: test against pure error.
        where: where the model fails.
        depends_on: what the residual depends on, largest share first.
        without_values: effects of the model that have no values yet and so count for nothing.
        source: name of the run.
        machine: name of the machine.
        effects: effects of the model.
        files: number of files that the run was read from.
    """

    raw: np.ndarray
    unaligned: np.ndarray
    by_base: np.ndarray | None
    residual: np.ndarray
    joint: Mapping[str, np.ndarray]
    kept: np.ndarray
    outliers: tuple[WorstRow, ...]
    stretches: tuple[Stretch, ...]
    frame: str
    noise: Noise | None
    lack_of_fit: LackOfFit
    where: WhereItFails
    depends_on: tuple[Dependence, ...]
    without_values: tuple[str, ...]
    source: str
    machine: str
    effects: tuple[str, ...]
    files: int = 1

    @property
    def rows(self) -> int:
        """Readings that count."""
        return int(self.kept.sum())

    @property
    def serial(self) -> bool:
        """Whether the machine is an arm."""
        return any(name.startswith("joint") for name in self.joint)

    @property
    def frame_removed(self) -> dict[str, float]:
        """Rms of the readings' displacement by frame alignment, um, per axis and total."""
        return figures((self.unaligned - self.residual)[self.kept])["rms_um"]

    @property
    def lengths(self) -> np.ndarray:
        """Length of the residual of each reading that counts, (m,) mm."""
        return np.asarray(np.linalg.norm(self.residual[self.kept], axis=1))

    @property
    def explainable_share(self) -> float | None:
        """Share of the residual's mean square that is more than noise, 0 to 1; None where the noise is unknown."""
        if self.noise is None:
            return None
        square = float(np.square(self.residual[self.kept]).sum(axis=1).mean())
        return float(np.clip(1.0 - self.noise.total**2 / square, 0.0, 1.0)) if square > 0.0 else 0.0

    @property
    def is_noise(self) -> bool:
        """Whether the residual is no more than noise; False where the noise is unknown."""
        if self.noise is None:
            return False
        doubt = 2.0 / (3.0 * self.rows) + 2.0 / self.noise.freedom  # relative variance of the two mean squares
        return bool(self.explainable_share < max(LEAST_SHARE, SURE * np.sqrt(doubt)))

    def to_dict(self) -> dict[str, Any]:
        """For JSON, keys as documented."""
        unknown: dict[str, Any] = {**dict.fromkeys(AXES_TOTAL), "source": "unknown"}
        return {
            "rows": self.rows,
            "source": self.source,
            "machine": self.machine,
            "effects": list(self.effects),
            "frame": self.frame,
            "frame_removed_um": self.frame_removed,
            **figures(self.residual[self.kept]),
            "length_um": one_figure(self.lengths, UM),
            "raw_um": figures(self.raw[self.kept]),
            "unaligned_um": figures(self.unaligned[self.kept]),
            "base_frame_um": None if self.by_base is None else figures(self.by_base[self.kept]),
            **self._joint_figures(),
            "noise_um": unknown if self.noise is None else self.noise.to_dict(),
            "explainable_share": self.explainable_share,
            "lack_of_fit": self.lack_of_fit.to_dict(),
            "where": self.where.to_dict(),
            "outliers": [row.to_dict() for row in self.outliers],
            "stretches": [stretch.to_dict() for stretch in self.stretches],
            "depends_on": [item.to_dict() for item in self.depends_on],
            "without_values": list(self.without_values),
        }

    def _joint_figures(self) -> dict[str, Any]:
        unit = URAD if self.serial else UM
        parts = {name: one_figure(values[self.kept], unit) for name, values in self.joint.items()}
        return {"joint_urad" if self.serial else "slider_um": parts}


def compare_run(
    model: Model, problem: Problem, *, noise: Noise | None = None, progress: Progress = unwatched
) -> Comparison:
    """Compare a run with a model; only the tracker frame is fitted, and no network is used.

    Args:
        model: its effects are held at their values.
        problem: the readings.
        noise: the noise floor; None takes the problem's, which may be unknown.
        progress: told what is being done.

    Returns:
        The comparison.
    """
    noise = noise or problem.noise
    progress("residual", 0, 3)
    fitted = residual_of(model, problem, noise)
    stretches, gross = name_stretches(fitted.outliers, fitted.residual, problem)
    kept = sound_rows(problem, fitted)
    residual = np.where(kept[:, None], fitted.residual, np.nan)
    progress("where it fails", 1, 3)
    where = where_it_fails(problem, residual)
    lack = lack_of_fit_of(problem, residual, fitted.rank)
    progress("what it depends on", 2, 3)
    weighed = problem if noise is None else problem.with_noise(noise)
    depends = dependence_of(weighed, residual)
    joint = {name: values for name, values in residual_views(problem, residual).items() if name not in AXES}
    reading, predicted = problem.table.measured, fitted.prediction.reading.numpy()
    return Comparison(
        raw=reading - problem.stated,
        unaligned=reading - predicted,
        by_base=None if problem.base is None else problem.measured - predicted,
        residual=fitted.residual,
        joint=joint,
        kept=kept,
        outliers=rows_by_size(problem, fitted.residual, gross),
        stretches=stretches,
        frame=problem.file.tracker.frame,
        noise=noise,
        lack_of_fit=lack,
        where=where,
        depends_on=depends,
        without_values=tuple(term.effect.key for term in model.terms if not len(term.theta)),
        source=problem.table.source,
        machine=model.file.machine.name,
        effects=model.keys,
        files=max(len(problem.table.files), 1),
    )


def figures(error: np.ndarray) -> dict[str, dict[str, float]]:
    """Figures of an error per axis, and in total as the root of their summed squares.

    The total rms is that of the error vectors' lengths, and the total bias is the length of the mean vector. The other
    totals are no figures of the lengths: take `one_figure` of these.

    Args:
        error: (m, 3) mm.

    Returns:
        mean_um (of the absolute error), bias_um (of the signed error), rms_um, p95_um, max_um, each {x, y, z, total}.
    """
    columns = [one_figure(error[:, axis], UM) for axis in range(3)]
    result = {}
    for name in columns[0]:
        values = [column[name] for column in columns]
        result[name] = {**dict(zip(AXES, values, strict=True)), "total": float(np.linalg.norm(values))}
    return result


def one_figure(values: np.ndarray, unit: float) -> dict[str, float]:
    """Figures of one column.

    Args:
        values: (m,) mm or rad.
        unit: factor from the values to um or urad.

    Returns:
        mean_um (of absolute values), bias_um (signed mean), rms_um, p95_um, max_um; urad where `unit` says so.
    """
    size = np.abs(values) * unit
    return {
        "mean_um": float(size.mean()),
        "bias_um": float(values.mean()) * unit,
        "rms_um": float(np.sqrt(np.square(size).mean())),
        "p95_um": float(np.quantile(size, 0.95)),
        "max_um": float(size.max()),
    }
