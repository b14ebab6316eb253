"""Runs of a machine as the store has them, and the alarms that follow from their verdicts."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from ptt.effects.phrases import listed
from ptt.fleet.accept import errors_of
from ptt.fleet.alarms import Alarm
from ptt.record import Record

RUNS = """
SELECT runs.run, runs.machine, runs.date, runs.place, runs.file, runs.row_count, outcomes.* EXCLUDE (run, machine),
    fits.* EXCLUDE (run), rechecks.result->'suggested' AS suggested,
    rechecks.result->'changed' AS changed, accepted.toml AS accepted, solved.run IS NOT NULL AS solved
FROM runs LEFT JOIN outcomes USING (run) LEFT JOIN fits USING (run) LEFT JOIN rechecks USING (run)
    LEFT JOIN (SELECT run, toml FROM models WHERE made = 'accepted') accepted USING (run)
    LEFT JOIN (SELECT run FROM models WHERE made = 'solved') solved USING (run)
ORDER BY runs.machine, runs.date, runs.place"""
# Verdicts that are alarms of the last run -> how their words begin, and what stands in place of an effect.
HEADS = {"new": "something that the model does not have", "setup": "a mistake in the set-up", "failed": "not usable"}
WHATS = {"new": "new physics", "setup": "set-up", "failed": "run"}
ONCE = ("jump", "new")  # alarms of what happened once, which an accepted model settles


@dataclass(frozen=True)
class Past(Record):
    """One run of a machine.

    Attributes:
        run: SHA-256 of its file.
        file: name of its file.
        date: when it was measured.
        rows: number of rows of the file.
        verdict: None while it waits to be processed.
        error_um: rms error with the model that held before the run.
        expected_um: rms error with that model if the machine had not changed.
        noise_um: the noise floor.
        words: the verdict for a person.
        added: effects that were new in this run and were added to the model.
        accepted: whether the model fitted to this run was accepted as the machine's from its date on.
        left_um: rms error of this run with that model; None where none was accepted.
        changed: values that had changed, each as effect, parameter and words.
    """

    run: str
    file: str
    date: datetime
    rows: int
    verdict: str | None
    error_um: float | None
    expected_um: float | None
    noise_um: float | None
    words: str
    added: tuple[str, ...] = ()
    accepted: bool = False
    left_um: float | None = None
    changed: tuple[tuple[str, str, str], ...] = ()


def past_of(row: Mapping[str, Any]) -> Past:
    """A run from its row of the query `RUNS`."""
    added = row["verdict"] == "new" and row["solved"]  # else the set-up is to be settled first
    suggested = json.loads(row["suggested"] or "[]") if added else []
    changed = [(each["effect"], each["parameter"], each["words"]) for each in json.loads(row["changed"] or "[]")]
    accepted = row["accepted"]
    left = None if accepted is None else errors_of(accepted)[0]["after"]
    return Past(
        row["run"], row["file"], row["date"], row["row_count"], row["verdict"], row["error_um"], row["expected_um"],
        row["noise_um"], row["words"] or "", tuple(str(step[0]) for step in suggested),
        accepted is not None, left,
        tuple(changed),
    )  # fmt: skip


def alarms_of_runs(past: Sequence[Past]) -> list[Alarm]:
    """Alarms from verdicts: new physics, in whichever run it appeared, and a last run that is new or cannot be used.

    Args:
        past: a machine's runs by date.

    Returns:
        The alarms.
    """
    done = [each for each in past if each.verdict is not None]
    alarms = [_came(each) for each in done if each.added]
    if done and done[-1].verdict in HEADS and not (done[-1].added or done[-1].accepted):
        last = done[-1]
        day, verdict = last.date.date().isoformat(), str(last.verdict)
        words = f"run of {day}: {HEADS[verdict]}: {last.words.splitlines()[0] if last.words else ''}"
        alarms.append(Alarm(WHATS[verdict], "", verdict, words, when=day))  # type: ignore[arg-type]
    return alarms


def alarms_of_changes(past: Sequence[Past], alarms: Sequence[Alarm]) -> list[Alarm]:
    """Alarms for values that the last run's recheck calls changed: seen after fewer runs than a trend needs.

    Args:
        past: a machine's runs by date.
        alarms: other alarms; values that they are about are left out here.

    Returns:
        The alarms; one for several parameters of an effect that share their words, with an empty `parameter`.
    """
    done = [each for each in past if each.verdict is not None]
    if not done or done[-1].accepted:
        return []
    told, day = {(alarm.effect, alarm.parameter) for alarm in alarms}, done[-1].date.date().isoformat()
    said: dict[tuple[str, str], list[str]] = {}  # effect and words -> the parameters that share them
    for effect, parameter, words in done[-1].changed:
        if (effect, parameter) not in told:
            said.setdefault((effect, words), []).append(parameter)
    return [
        Alarm(effect, parameters[0] if len(parameters) == 1 else "", "changed", words, when=day)
        for (effect, words), parameters in said.items()
    ]


def unsettled(alarms: Sequence[Alarm], past: Sequence[Past]) -> tuple[Alarm, ...]:
    """Alarms without jumps and new physics up to the date of the last run whose model was accepted."""
    accepted = max((each.date.date().isoformat() for each in past if each.accepted), default="")
    return tuple(each for each in alarms if each.trend not in ONCE or (each.when or "") > accepted)


def _came(run: Past) -> Alarm:
    """The alarm for effects that were new in a run: they were added to the model, so no later run shows them as new."""
    day, names = run.date.date().isoformat(), listed(list(run.added))
    error = ""
    if run.error_um is not None and run.expected_um is not None:
        error = f": the error was {run.error_um:.1f} um, where {run.expected_um:.1f} um was expected"
    return Alarm(run.added[0], "", "new", f"{names} {_is(run)} new in the run of {day}{error}", when=day)


def _is(run: Past) -> str:
    return "are" if len(run.added) > 1 else "is"
