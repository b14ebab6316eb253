"""Overview of a fleet: each machine's last verdict and error, its trends, and its alarms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from ptt.errors import InputError
from ptt.fleet.alarms import MONTH, SISTERS, Alarm, Names, alarm_of_movement, unlike, unlike_alarm
from ptt.fleet.past import RUNS, Past, alarms_of_changes, alarms_of_runs, past_of, unsettled
from ptt.fleet.store import Store, shown
from ptt.fleet.trends import Movement, Moves, Series, movements
from ptt.notebook import InNotebook
from ptt.record import Record
from ptt.run.dates import days_of

# Share of a value that a run does not determine, from which it is not compared with sister machines
MOST_LEFT_OPEN = 0.5


@dataclass(frozen=True)
class Standing:
    """The present state of one machine, from all its runs.

    Attributes:
        machine: its name.
        drawing: digest of its drawing; sister machines share it.
        past: its runs by date.
        alarms: what somebody should look at.
        names: names of its p values.
        days: dates of the n runs whose fits tell values, (n,) days since 1970.
        moves: drifts and jumps of its values over those runs; None where no run tells any.
    """

    machine: str
    drawing: str
    past: tuple[Past, ...]
    alarms: tuple[Alarm, ...] = ()
    names: Names = field(default_factory=lambda: Names((), (), (), np.zeros(0)))
    days: np.ndarray = field(default_factory=lambda: np.zeros(0))
    moves: Moves | None = None

    @property
    def last(self) -> Past | None:
        """The last run that was processed; None before any."""
        return next((past for past in reversed(self.past) if past.verdict is not None), None)

    @property
    def verdict(self) -> str:
        """Verdict of the last run; 'accepted' where its model was accepted since, 'waiting' before the first one."""
        if self.last is None:
            return "waiting"
        return "accepted" if self.last.accepted else str(self.last.verdict)

    @property
    def error_um(self) -> float | None:
        """Rms error of the last run with the machine's model: the one accepted from it, if there is one."""
        if self.last is None:
            return None
        return self.last.error_um if self.last.left_um is None else self.last.left_um

    @property
    def waiting(self) -> int:
        """Number of runs that were not processed yet."""
        return sum(past.verdict is None for past in self.past)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        last = self.last
        return {
            "machine": self.machine,
            "runs": len(self.past),
            "waiting": self.waiting,
            "last": self.past[-1].date.isoformat() if self.past else None,
            "verdict": self.verdict if last else None,
            "error_um": self.error_um,
            "expected_um": last.expected_um if last else None,
            "noise_um": last.noise_um if last else None,
            "words": last.words if last else "",
            "alarms": [alarm.to_dict() for alarm in self.alarms],
            "trends": self.trends(),
            "history": [past.to_dict() for past in self.past],
        }

    def trends(self) -> list[dict[str, Any]]:
        """Drifts and jumps, whether they are alarms or not, in the units of the machine file."""
        return [self._trend(movement) for movement in self.moves.movements] if self.moves else []

    def _trend(self, movement: Movement) -> dict[str, Any]:
        place, drift = movement.place, movement.kind == "drift"
        effect, _, parameter = self.names.names[place].partition(" ")
        factor = float(self.names.usual[place]) * (MONTH if drift else 1.0)
        return {
            "effect": effect,
            "parameter": parameter,
            "trend": movement.kind,
            "unit": self.names.units[place] + ("/month" if drift else ""),
            "size": movement.size * factor,
            "std": movement.std * factor,
            "p_value": movement.p_value,
        }


@dataclass(frozen=True)
class Overview(InNotebook, Record):
    """The present state of a fleet.

    Attributes:
        machines: in the order of their names.
    """

    keys: ClassVar[str] = "machines"

    machines: tuple[Standing, ...]

    def __str__(self) -> str:
        """A table, and the alarms under it."""
        width = max([7, *(len(shown(machine.machine)) for machine in self.machines)])
        lines = [f"{'machine':<{width}}  runs  last        verdict           error um  alarms"]
        for machine in self.machines:
            day = machine.past[-1].date.date().isoformat() if machine.past else "-"
            error = "-" if machine.error_um is None else f"{machine.error_um:.1f}"
            name, runs, alarms = shown(machine.machine), len(machine.past), len(machine.alarms) or ""
            lines.append(f"{name:<{width}}  {runs:>4}  {day:<10}  {machine.verdict:<16}  {error:>8}  {alarms}".rstrip())
        waiting = sum(machine.waiting for machine in self.machines)
        told = [f"{shown(machine.machine)}: {alarm.words}" for machine in self.machines for alarm in machine.alarms]
        lines += ["", *told] if told else []
        lines += ["", f"{waiting} runs waiting: ptt fleet run"] if waiting else []
        return "\n".join(lines)


def overview(store: Store, machine: str | None = None) -> Overview:
    """Work out the present state of a fleet from its store.

    Args:
        store: the store.
        machine: the one to return, compared with its sisters all the same; None for all.

    Returns:
        Its machines by name.

    Raises:
        InputError: no such machine.
    """
    drawings = {row["machine"]: row["drawing"] for row in store.ask("SELECT * FROM machines ORDER BY machine")}
    if machine is not None and machine not in drawings:
        raise InputError(f"no machine '{shown(machine)}'", where=str(store.folder), fix="`ptt fleet show` lists them")
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in drawings}
    for row in store.ask(RUNS):
        runs[row["machine"]].append(row)
    standings = [_standing(name, drawings[name], rows) for name, rows in runs.items()]
    standings = _beside_sisters(standings)
    return Overview(tuple(each for each in standings if machine in (None, each.machine)))


def _standing(name: str, drawing: str, rows: Sequence[Mapping[str, Any]]) -> Standing:
    past = tuple(past_of(row) for row in rows)
    standing = Standing(name, drawing, past)
    told = [row for row in rows if row["names"]]
    if told:
        names, series = _series(told)
        moves = movements(series)
        alarms = [alarm_of_movement(movement, moves, names, series.days) for movement in moves.movements]
        sound = tuple(alarm for alarm in alarms if alarm is not None)
        standing = Standing(name, drawing, past, sound, names, series.days, moves)
    trends = (*alarms_of_runs(past), *standing.alarms)
    return replace(standing, alarms=unsettled((*trends, *alarms_of_changes(past, trends)), past))


def _series(told: Sequence[Mapping[str, Any]]) -> tuple[Names, Series]:
    """All runs of a machine over the union of their values, in the usual sizes of the last run that has each.

    Zeros where a run's model lacks a value. Each run's sums are stored in usual sizes of its own time.
    """
    known: dict[str, tuple[str, str, float]] = {}
    for row in told:
        known |= dict(zip(row["names"], zip(row["labels"], row["units"], row["usual"], strict=True), strict=True))
    place = {name: index for index, name in enumerate(known)}
    labels, units, usual = zip(*known.values(), strict=True)
    count, common = len(known), np.array(usual)
    information, score = np.zeros((len(told), count, count)), np.zeros((len(told), count))
    for number, row in enumerate(told):
        at = [place[name] for name in row["names"]]
        ratio = common[at] / np.array(row["usual"])
        information[number][np.ix_(at, at)] = np.outer(ratio, ratio) * np.reshape(
            row["information"], (len(at), len(at))
        )
        score[number, at] = ratio * np.array(row["score"])
    days = np.array([days_of(row["date"]) for row in told])
    return Names(tuple(known), labels, units, common), Series(tuple(known), days, information, score)


def _beside_sisters(standings: Sequence[Standing]) -> list[Standing]:
    """Add alarms for machines whose last values or error are unlike those of machines with the same drawing."""
    extra: dict[str, list[Alarm]] = {}
    for drawing in {standing.drawing for standing in standings}:
        beside = {key: values for key, values in _last_values(standings, drawing).items() if len(values) >= SISTERS}
        for (effect, parameter, label, unit), values in beside.items():
            middle = float(np.median([value for value, _ in values.values()]))
            for machine, far in unlike(values, len(beside)).items():
                alarm = unlike_alarm(effect, parameter, label, unit, values[machine][0], middle, far)
                extra.setdefault(machine, []).append(alarm)
    return [replace(each, alarms=(*each.alarms, *extra.get(each.machine, ()))) for each in standings]


def _last_values(
    standings: Sequence[Standing], drawing: str
) -> dict[tuple[str, str, str, str], dict[str, tuple[float, float]]]:
    """Last values of the machines of one drawing.

    Returns:
        (effect, parameter, label, unit) -> machine -> value and standard error in that unit.
    """
    found: dict[tuple[str, str, str, str], dict[str, tuple[float, float]]] = {}
    for standing in standings:
        if standing.drawing != drawing:
            continue
        if standing.error_um is not None:
            found.setdefault(("error", "", "the error left", "um"), {})[standing.machine] = (standing.error_um, 0.0)
        if standing.moves is None:
            continue
        for place, name in enumerate(standing.names.names):
            effect, _, parameter = name.partition(" ")
            key = (effect, parameter, standing.names.labels[place], standing.names.units[place])
            value, std = standing.moves.values[-1, place], standing.moves.scatter * standing.moves.std[-1, place]
            # Of a homing offset two thirds are seen. What is seen of a value mostly unseen may be another value's.
            if np.isfinite(value) and standing.moves.unseen[-1, place] < MOST_LEFT_OPEN:
                usual = float(standing.names.usual[place])
                found.setdefault(key, {})[standing.machine] = (float(value) * usual, float(std) * usual)
    return found
