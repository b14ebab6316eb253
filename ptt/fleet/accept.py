"""Accepting a repair or a change: the model fitted to a run is the machine's from that run on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ptt.errors import InputError, PosesError
from ptt.fleet.database import rows, transaction
from ptt.fleet.models import accept_model, drawing_of, model_at
from ptt.fleet.queue import alone_with, task_of
from ptt.fleet.store import Store, shown
from ptt.fleet.task import Task
from ptt.fleet.which import which_run
from ptt.judge.history import read_entries
from ptt.machine import parse_machine
from ptt.progress import Tell
from ptt.record import Record

Work = Callable[[Task], str]
MADE = "SELECT made, toml FROM models WHERE machine = ? AND run = ? AND made IN ('solved', 'accepted') ORDER BY made"


@dataclass(frozen=True)
class Accepted(Record):
    """A model that was accepted as its machine's.

    Attributes:
        machine: its name.
        run: SHA-256 of the run that the model was fitted to.
        file: name of the run's file.
        date: the model holds from this date on, ISO 8601.
        new: whether it was not the machine's model already.
        error_um: rms errors of that run: 'before' with the model that held until then, 'after' with this one,
            'heldout' with this one on held-out rows; None where the model has no history.
        noise_um: the noise floor of that run.
        waiting: number of later runs that wait to be rechecked against it.
    """

    machine: str
    run: str
    file: str
    date: str
    new: bool
    error_um: dict[str, float | None]
    noise_um: float | None
    waiting: int

    def __str__(self) -> str:
        """Two or three lines."""
        day, name = self.date[:10], shown(self.machine)
        if not self.new:
            return f"{name}: the model of {day} ({shown(self.file)}) is already the machine's from that day on"
        lines = [f"{name}: the model fitted to the run of {day} ({shown(self.file)}) is the machine's from that day on"]
        if self.error_um["before"] is not None:
            lines.append(
                f"error of that run {self.error_um['before']:.1f} um with the model until then, "
                f"{self.error_um['after']:.1f} um now; noise {self.noise_um:.1f} um"
            )
        if self.waiting:
            lines.append(
                f"{self.waiting} later run{'s' if self.waiting > 1 else ''} to be rechecked against it: ptt fleet run"
            )
        return "\n".join(lines)


def accept(
    store: Store, machine: str, which: str | None = None, tell: Tell | None = None, work: Work | None = None
) -> Accepted:
    """Fit a machine's model to one of its runs, and let later runs be rechecked against that.

    Effects that the run cannot test (one of loads, where it has a single load) stay as they were. Earlier models stay
    in the store. Accepting a run again does nothing.

    Args:
        store: the store.
        machine: its name.
        which: the run: file name, date or beginning of its SHA-256; None for the last.
        tell: told what is being done.
        work: fits the model; None for `ptt.fleet.work.refit`.

    Returns:
        The accepted model.

    Raises:
        InputError: no such machine or run, the run has not been processed yet, or another process works on the machine.
        PosesError: the run cannot be used, or no effect was ever fitted to the machine.
    """
    run = _chosen(store, machine, which)
    with alone_with(store, machine, "accept when it is done"):
        return _already(store, run) or _accept(store, run, tell or (lambda what: None), work)


def _accept(store: Store, run: dict[str, Any], tell: Tell, work: Work | None) -> Accepted:
    from ptt.fleet.work import refit

    with transaction(store.file, read_only=True) as connection:
        held = model_at(connection, run["machine"], run["run"])
        drawing = drawing_of(connection, run["machine"])
    if held is None or not parse_machine(held[1], run["machine"]).effect:
        raise PosesError(f"nothing was ever fitted to '{shown(run['machine'])}', so there is nothing to refit")
    tell("refit")
    text = (work or refit)(task_of(store, run, drawing, held[1]))
    with transaction(store.file) as connection:
        later = accept_model(connection, run["machine"], run["run"], text)
    return _told(run, text, new=True, waiting=len(later))


def _already(store: Store, run: dict[str, Any]) -> Accepted | None:
    """The run, where the machine's model was made from it already; None otherwise."""
    with transaction(store.file, read_only=True) as connection:
        made = rows(connection, MADE, run["machine"], run["run"])
    return _told(run, made[0]["toml"], new=False, waiting=0) if made else None


def _told(run: dict[str, Any], text: str, *, new: bool, waiting: int) -> Accepted:
    error, noise = errors_of(text)
    return Accepted(run["machine"], run["run"], run["file"], run["date"].isoformat(), new, error, noise, waiting)


def errors_of(text: str) -> tuple[dict[str, float | None], float | None]:
    """Rms errors of the last step in a model's history ('before', 'after', 'heldout'), and its noise floor, um."""
    entries = read_entries(parse_machine(text, ""))
    if not entries:
        return {"before": None, "after": None, "heldout": None}, None
    last = entries[-1]
    error = {"before": last.before_um, "after": last.after_um, "heldout": last.heldout_after_um}
    return {key: float(value["total"]) for key, value in error.items()}, float(last.noise_um["total"])


def _chosen(store: Store, machine: str, which: str | None) -> dict[str, Any]:
    """The row of the run to accept.

    Raises:
        InputError: there is none or several, or it was not processed yet.
        PosesError: it could not be used.
    """
    run = which_run(store, machine, which)
    if run["verdict"] is None:
        raise InputError(
            f"{shown(run['file'])} has not been processed yet", fix="`ptt fleet run` first, or name another run"
        )
    if run["verdict"] in ("setup", "failed"):
        raise PosesError(f"{shown(run['file'])} cannot be used ({run['verdict']}); name another run")
    return run
