"""Looks: what the page shows of a run compared with a model, as plain arrays that can be sent between processes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ptt.show.card.scene import MachineLines
from ptt.show.studio.column_rows import ColumnRow, column_rows

if TYPE_CHECKING:
    from ptt.judge.compare.comparison import Comparison
    from ptt.model.model import Model
    from ptt.run.problem import Problem

COVARIATES = {  # field of a table -> in words
    "time_s": "time [s]", "payload_kg": "payload [kg]", "temp_c": "temperature [\N{DEGREE SIGN}C]",
    "feed_mm_s": "feed [mm/s]", "direction": "directions of arrival", "torque": "torque", "std": "tracker deviations",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Look:
    """A run of n rows compared with a model.

    Attributes:
        source: name of the run.
        line: line of each row in the file, (n,) int.
        name: name of each row's point, '' for none, (n,).
        run: label of each row's run, (n,).
        target: (n, 3) mm.
        residual: after frame alignment, (n, 3) mm; NaN where not observed.
        kept: rows that are observed and no gross errors, (n,) bool.
        views: component ('x', 'slider 2') -> residual, (n,) mm or rad.
        contexts: variable that the error may depend on -> values, (n,).
        drawing: the machine at each row.
        serial: whether the machine is a serial arm.
        effects: keys of the model's effects.
        understood: notes of the reader on the file, one finding a line.
        covariates: what the table holds besides targets and readings, in words.
        runs: labels of the runs.
        noise: noise floor by axis and total, um, with its source; None where unknown.
        column_rows: a row for each column that was used, from `ptt.show.studio.column_rows`.
        setup: findings about the set-up, as `ptt check --json` lists them.
    """

    source: str
    line: np.ndarray
    name: tuple[str, ...]
    run: tuple[str, ...]
    target: np.ndarray
    residual: np.ndarray
    kept: np.ndarray
    views: Mapping[str, np.ndarray]
    contexts: Mapping[str, np.ndarray]
    drawing: MachineLines
    serial: bool
    effects: tuple[str, ...]
    understood: tuple[str, ...]
    covariates: tuple[str, ...]
    runs: tuple[str, ...]
    noise: Mapping[str, float | str] | None
    column_rows: tuple[ColumnRow, ...] = ()
    setup: tuple[Mapping[str, Any], ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.line)

    @property
    def size_um(self) -> np.ndarray:
        """Length of the error of each reading, (n,) um."""
        return np.asarray(1e3 * np.linalg.norm(self.residual, axis=1))

    def visits_of(self, row: int, within: float = 1e-3) -> np.ndarray:
        """Kept rows whose target lies near that of a row.

        Args:
            row: number of the row.
            within: largest distance, mm; at least a micrometre.

        Returns:
            Row numbers, (m,).
        """
        distance = np.linalg.norm(self.target - self.target[row], axis=1)
        return np.flatnonzero(self.kept & (distance <= max(within, 1e-3)))

    def why_not_shown(self, line: int) -> str:
        """Why no reading of a line of the file can be shown, in a sentence."""
        if (self.line == line).any():
            return f"Line {line} does not count: base, not observed, or left out as a gross error."
        return f"There is no reading in line {line}: they are in lines {self.line.min()} to {self.line.max()}."


def look_at(
    model: "Model",
    problem: "Problem",
    run: str,
    compared: "Comparison | None" = None,
    setup: Sequence[Mapping[str, Any]] = (),
) -> Look:
    """Make a look: fast, as only the tracker frame is fitted.

    Args:
        model: the model; its effects are held at their values.
        problem: the readings.
        run: path of the file that they were read from, the first where there are several.
        compared: a comparison that was made already, whose residual is taken; None to compute it.
        setup: findings about the set-up.

    Returns:
        The look.
    """
    from ptt.dependence.contexts import path_views, residual_views
    from ptt.fitting.result import sound_rows
    from ptt.fitting.solve import residual_of
    from ptt.show.card.ghost import machine_lines

    if compared is None:
        fitted = residual_of(model, problem)
        residual, kept = fitted.residual, sound_rows(problem, fitted)
    else:
        residual, kept = compared.residual, compared.kept
    noise = problem.noise if compared is None else compared.noise
    table = problem.table
    return Look(
        source=table.source,
        line=np.asarray(table.line),
        name=tuple(map(str, table.name)),
        run=tuple(table.run_label[code] for code in table.run),
        target=np.asarray(problem.target, dtype=float),
        residual=np.asarray(residual),
        kept=np.asarray(kept),
        views=residual_views(problem, residual),
        contexts=path_views(problem),
        drawing=machine_lines(problem),
        serial=problem.file.machine.kind == "serial",
        effects=model.keys,
        understood=tuple(table.understood.lines),
        covariates=tuple(words for name, words in COVARIATES.items() if getattr(table, name) is not None),
        runs=tuple(label for label in table.run_label if label),
        noise=None if noise is None else dict(noise.to_dict()),
        column_rows=tuple(column_rows(table, run)),
        setup=tuple(setup),
    )


def rest_of_arm(file: Any) -> list[list[float]]:
    """Base, joints and tool of an arm with all joints at zero, (m, 3) mm."""
    import torch

    from ptt.mechanisms import build_mechanism
    from ptt.mechanisms.serial import Serial

    arm = build_mechanism(file.machine)
    assert isinstance(arm, Serial)
    q = torch.zeros(1, arm.joints, dtype=torch.float64)
    origins, tool = arm.frames(q)[0][0], arm.forward(q)[0]
    return [[0.0, 0.0, 0.0], *origins.tolist(), tool.tolist()]
