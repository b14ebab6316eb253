"""Fitting a model to a log (a run too long for memory), part by part."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch

from ptt.door.handed import Handed, worded
from ptt.door.result import Note, ignore_note
from ptt.effects import library
from ptt.effects.sudden import Sudden
from ptt.errors import ModelError
from ptt.files import sha256
from ptt.fitting.chunks import CHUNK
from ptt.fitting.kept import keep_covariance
from ptt.fitting.layout import Layout, lay_out
from ptt.fitting.prior import usual_prior
from ptt.fitting.result import FitResult
from ptt.fitting.rounds import Settled, settle
from ptt.fitting.search import open_terms
from ptt.fitting.stated import state_fit
from ptt.fleet.log import Log, enter_part, open_log, read_part
from ptt.fleet.log_copy import require_log, to_parquet
from ptt.fleet.shares import Passes, Share
from ptt.fleet.sound import require_sound
from ptt.fleet.workers import cluster
from ptt.machine import MachineFile, load_machine, save_machine
from ptt.model.chain import Prediction
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model, Term
from ptt.progress import Progress
from ptt.run.axes import AXES_TOTAL
from ptt.run.noise import Noise, guessed_noise
from ptt.run.taken import rounded_words


@dataclass(frozen=True)
class LogFit:
    """A model fitted to a log.

    Attributes:
        fitted: the fit; its fields for single rows (residuals, predictions) are empty.
        rows: how many rows were fitted.
        gross: rows left out as gross errors, (m,) int from 0.
        before_um: rms residual of the model as it was given, by x, y, z and total.
        after_um: the same of the fitted model. It stands for the held-out error too: rows are many and values few.
        passes: how often the log was read.
    """

    fitted: FitResult
    rows: int
    gross: np.ndarray
    before_um: dict[str, float]
    after_um: dict[str, float]
    passes: int

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        fitted, keys = self.fitted, [term.effect.key for term in self.fitted.layout.terms]
        rows = zip(fitted.layout.owner, fitted.layout.names, fitted.values, fitted.std, strict=True)
        return {
            "rows": self.rows,
            "gross_rows": self.gross.tolist(),
            "rms_um": {"before": self.before_um, "after": self.after_um},
            "noise_um": fitted.noise.to_dict(),
            "parameters": [
                {"effect": keys[owner], "parameter": name.removeprefix(f"{keys[owner]} "), "value": value, "std": std}
                for owner, name, value, std in rows
                if owner >= 0
            ],
            "passes": self.passes,
            "status": fitted.status,
        }

    def __str__(self) -> str:
        """The fit as a person reads it."""
        told, before, after = self.to_dict(), self.before_um["total"], self.after_um["total"]
        lines = [f"{'value':<44}  {'fitted':>12}  {'std':>9}"]
        for one in told["parameters"]:
            name = f"{one['effect']} {one['parameter']}"
            lines.append(f"{name:<44}  {one['value']:>12.6g}  {one['std']:>9.2g}")
        noise = f"{told['noise_um']['total']:.2f} ({told['noise_um']['source']})"
        lines += ["", f"error in um: {before:.2f} with the old model, {after:.2f} now; noise {noise}"]
        passes = f"{self.rows} rows in {self.passes} passes, {len(self.gross)} left out as gross errors"
        return "\n".join([*lines, f"{passes}; {self.fitted.status}"])

    def to_file(self, log: Log, source: Path) -> MachineFile:
        """The fitted model as a machine file, with its covariance and one more step of its history.

        Args:
            log: the log that it was fitted to.
            source: the log's file as it was given.
        """
        digest = sha256(source)
        step: dict[str, Any] = {
            "date": datetime.now(UTC).isoformat(timespec="seconds"), "command": "fit", "kind": "refit",
            "files": [{"file": source.name, "sha256": digest}], "rows": self.rows, "ranges": log.ranges,
            "helped": self.after_um["total"] < self.before_um["total"], "error_before_um": self.before_um,
            "error_after_um": self.after_um, "heldout_before_um": self.before_um, "heldout_after_um": self.after_um,
            "noise_um": self.fitted.noise.to_dict(), "parameters_before": {},
        }  # fmt: skip
        covariance = keep_covariance(self.fitted, 1e-3 * self.after_um["total"])
        history = (*self.fitted.model.file.history, step)
        return replace(write_model(self.fitted.model, [digest]), history=history, covariance=covariance)


def fit_log(model: Model, log: Log, client: Any = None, tell: Progress | None = None) -> LogFit:
    """Fit a model to a log.

    Args:
        model: the model; effects without values start from a fit to the first rows.
        log: the log.
        client: of a dask cluster whose workers see the file; None to work in this process, a part at a time.
        tell: told what is being done.

    Returns:
        The fit.

    Raises:
        ModelError: the moment of a sudden effect is not known yet.
    """
    noise = log.noise or guessed_noise()
    layout = lay_out(model, log.whole, start_of(model, log, noise))
    passes = Passes(log, layout, noise, client, tell)
    start, none = np.clip(layout.start(), layout.lower, layout.upper), np.zeros(0, dtype=int)
    first = _rms(passes(start, none))
    found = settle(passes, layout, noise, start, none, usual_prior(layout))
    share = passes(found.unknowns, found.choice)
    fitted = _result(model, layout, noise, found, share, passes.count)
    return LogFit(fitted, share.rows, found.choice, first, _rms(share), passes.count)


def fit_file(
    log: Path, model: Path, out: Path, scheduler: str | None = None, workers: int | None = None,
    tell: Progress | None = None, *, anyway: bool = False, effects: Sequence[str] = (), note: Note = ignore_note,
) -> LogFit:  # fmt: skip
    """Fit a model to a log file, and write the fitted model.

    Args:
        log: Parquet, or a CSV, which is copied to Parquet beside `out` for as long as it takes.
        model: machine.toml to start from.
        out: machine.toml to write.
        scheduler: address of a dask scheduler whose workers see the file; None starts `workers` here.
        workers: number of processes to start; None, without a scheduler, to work in this process alone.
        tell: told what is being done.
        anyway: whether to go on although the set-up looks mistaken.
        effects: Python files with effects of the user's own; workers have to see them at the same place.
        note: told what was found in the set-up.

    Returns:
        The fit.

    Raises:
        InputError: a log that cannot be read or fitted.
        SetupError: a mistake in the set-up that is sure, unless `anyway`.
    """
    given = read_model(load_machine(model), library(*effects))
    require_log(log)
    with TemporaryDirectory(dir=out.absolute().parent) as folder:
        rows = log
        if log.suffix.lower() != ".parquet":
            rows = Path(folder) / log.name
            to_parquet(log, rows)
        with worded([Handed(rows, str(log))]):
            require_sound(given.file, rows, log, anyway=anyway, note=note)
            opened = open_log(given.file, rows.absolute())
        if opened.rounded:
            note(rounded_words(opened.rounded, "deg" if given.file.machine.kind == "serial" else "mm"))
        here = scheduler is None and workers is None
        with nullcontext() if here else cluster(scheduler, workers) as client:
            if client is not None and effects:
                client.register_worker_callbacks(partial(library, *effects))  # whoever takes a part knows its effects
            found = fit_log(given, opened, client, tell)
    save_machine(found.to_file(opened, log), out)
    return found


def start_of(model: Model, log: Log, noise: Noise) -> list[Term]:
    """All terms with values; those that have none get them, shape parameters included, from a fit to the first rows.

    Raises:
        ModelError: the moment of a sudden effect is not known yet.
    """
    for term in model.terms:
        if isinstance(term.effect, Sudden) and not len(term.theta):
            fix = "add it on the rows about its moment first: ptt add, then fit"
            raise ModelError(f"{term.effect.key}: its moment may lie anywhere", where=model.file.source, fix=fix)
    part = (0, min(CHUNK, log.rows))
    return open_terms(model.terms, enter_part(read_part(log, part), part, None), noise)


def _rms(share: Share) -> dict[str, float]:
    each = 1e3 * np.sqrt(np.append(share.square, share.square.sum()) / max(share.rows, 1))
    return dict(zip(AXES_TOTAL, map(float, each), strict=True))


def _result(model: Model, layout: Layout, noise: Noise, found: Settled, share: Share, passes: int) -> FitResult:
    none, blank = torch.zeros(0, 3, dtype=torch.float64), np.zeros((0, 0))
    information, _, chi2, count = share.total
    empty = FitResult(
        model, layout, found.unknowns, blank, blank, Prediction(none, none, none, none), np.zeros((0, 3)),
        np.zeros(0, bool), noise, 0.0, 1, 0, blank, found.prior, passes, found.status,
    )  # fmt: skip
    return state_fit(empty, found.unknowns, information, chi2, count)
