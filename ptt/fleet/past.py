"""One run of a machine as it stands in the store, and what such runs say that somebody should look at."""

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
    rechecks.result->'changed' AS changed, accepted.toml AS accepted
FROM runs LEFT JOIN outcomes USING (run) LEFT JOIN fits USING (run) LEFT JOIN rechecks USING (run)
    LEFT JOIN (SELECT run, toml FROM models WHERE made = 'accepted') accepted USING (run)
ORDER BY runs.machine, runs.date, runs.place"""
HEADS = {"new": "something that the model does not have", "setup": "a mistake in the set-up", "failed": "not usable"}
ONCE = ("jump", "new")
WHATS = {"new": "new physics", "setup": "set-up", "failed": "run"}


@dataclass(frozen=True)
class Past(Record):
    """One run of a machine.

    Attributes:
        run: SHA-256 of its file.
        file: its name.
        date: when it was measured.
        rows: of the file.
        verdict: None while it waits.
        error_um: what was left with the model.
        expected_um: what had been left when the model was made.
        noise_um: the noise floor.
        words: what was said of it.
        added: effects that were new in it and belong to the model since.
        accepted: whether the model fitted to it was accepted, and is the machine's from it on.
        left_um: what that model leaves of it; None where none was accepted.
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
    """A run as the store has it, a row of `RUNS`."""
    suggested = json.loads(row["suggested"] or "[]") if row["verdict"] == "new" else []
    changed = [(each["effect"], each["parameter"], each["words"]) for each in json.loads(row["changed"] or "[]")]
    accepted = row["accepted"]
    left = None if accepted is None else errors_of(accepted)[0]["after"]
    return Past(
        row["run"], row["file"], row["date"], row["row_count"], row["verdict"], row["error_um"], row["expected_um"],
        row["noise_um"], row["words"] or "", tuple(str(step[0]) for step in suggested),
        accepted is not None, left,
        tuple(changed),
    )  # fmt: skip


def of_runs(past: Sequence[Past]) -> list[Alarm]:
    """What the runs themselves say: physics that came at some time and stays, and a last run that cannot be used.

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


def of_changes(past: Sequence[Past], alarms: Sequence[Alarm]) -> list[Alarm]:
    """What is otherwise in the last run than the model says; a few runs show that before they show a trend.

    Args:
        past: a machine's runs by date.
        alarms: that there are; a value that one of them is about is left out.

    Returns:
        The alarms; of an effect that has changed as a whole one, about no single parameter.
    """
    done = [each for each in past if each.verdict is not None]
    if not done or done[-1].accepted:
        return []
    told, day = {(alarm.effect, alarm.parameter) for alarm in alarms}, done[-1].date.date().isoformat()
    said: dict[tuple[str, str], list[str]] = {}  # values of which one sentence tells are one alarm
    for effect, parameter, words in done[-1].changed:
        if (effect, parameter) not in told:
            said.setdefault((effect, words), []).append(parameter)
    return [
        Alarm(effect, parameters[0] if len(parameters) == 1 else "", "changed", words, when=day)
        for (effect, words), parameters in said.items()
    ]


def unsettled(alarms: Sequence[Alarm], past: Sequence[Past]) -> tuple[Alarm, ...]:
    """Alarms without what happened once, a jump or new physics, up to a run whose model somebody accepted."""
    accepted = max((each.date.date().isoformat() for each in past if each.accepted), default="")
    return tuple(each for each in alarms if each.trend not in ONCE or (each.when or "") > accepted)


def _came(run: Past) -> Alarm:
    """Physics that the model did not have: it was added to it, so later runs are the same again and do not say so."""
    day, names = run.date.date().isoformat(), listed(list(run.added))
    error = ""
    if run.error_um is not None and run.expected_um is not None:
        error = f": the error was {run.error_um:.1f} um, where {run.expected_um:.1f} um was expected"
    return Alarm(run.added[0], "", "new", f"{names} {_is(run)} new in the run of {day}{error}", when=day)


def _is(run: Past) -> str:
    return "are" if len(run.added) > 1 else "is"
