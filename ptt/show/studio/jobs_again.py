"""Runs of the same machine measured again: before and after, what has changed since, values by date."""

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.errors import PttError
from ptt.progress import Progress
from ptt.show.sizing import spread
from ptt.show.studio.later import ANYWAY
from ptt.show.studio.on_page import on_page
from ptt.show.studio.opening import open_both, place_of, settled
from ptt.show.studio.outcomes import QuestionError
from ptt.show.studio.results import Source

if TYPE_CHECKING:
    import numpy as np

    from ptt.door.opened import Opened
    from ptt.judge.before_after import BeforeAfter

LATER = "later"  # folder of what was answered of later runs
MONTHS = "months"  # folder of the store that the fleet's verbs work on
MACHINE = "machine"
ARROWS = 250  # of one picture
PLACES = 6  # values drawn


def again(
    source: Source, model: str, first: str, later: Sequence[tuple[Source, str]], tell: Progress
) -> Mapping[str, Any]:
    """Hold later runs against the one that is open and against the model; one that cannot be read keeps none back.

    Args:
        source: the run that is open.
        model: its model.
        first: date of that run.
        later: how each is read and its date, the last one last.
        tell: told what is done.

    Returns:
        'pair', 'recheck' and 'months'; one that cannot be worked out has 'why' instead. 'left': what stands against
        each run that was left out, as `vet` has it.
    """
    sound, left, opened = list[tuple[Source, str]](), list[dict[str, Any]](), None
    for number, (each, date) in enumerate(later):
        tell(f"reading {each.run}", 0, 3)
        own, read, trouble = _met(each, model, number)
        if read is None:
            left.append(trouble)
        else:
            opened = read
            sound.append((own, date))
    if opened is None:
        nothing = {"why": "no later run can be read as it is: see what stands against each."}
        return {"pair": nothing, "recheck": nothing, "months": nothing, "left": left}
    last, after = sound[-1][0], opened
    tell("before and after", 0, 3)
    pair = _tried(lambda: _pair(source, after, model))
    tell("what has changed", 1, 3)
    changed = _tried(lambda: _recheck(last, model))
    tell("values by date", 2, 3)
    months = _tried(lambda: _months(source, model, [(replace(source, also=()), first), *sound], tell))
    return {"pair": pair, "recheck": changed, "months": months, "left": left}


def vet(later: Source, model: str, tell: Progress) -> Mapping[str, Any]:
    """Open a run that was measured later, so that it is told at once what stands against it.

    Args:
        later: how it is read.
        model: text of the model.
        tell: told what is done.

    Returns:
        Empty where nothing does; else 'run', 'why' and, of what can be answered, 'about', 'question' and 'choices'.
    """
    tell(f"reading {later.run}", 0, 0)
    return _met(later, model, 0)[2]


def _met(later: Source, model: str, number: int) -> tuple[Source, "Opened | None", dict[str, Any]]:
    """A later run as it is read, opened, and what stands against it; its answers are kept in a file of its own."""
    from ptt.errors import SetupError

    Path(LATER).mkdir(exist_ok=True)
    try:
        own = settled(later, model, Path(LATER) / f"{number}.toml")
        return own, open_both(own, model), {}
    except QuestionError as asked:
        return later, None, _trouble(later, "", asked.about, asked.question, asked.choices)
    except SetupError as error:
        told = "; ".join(f"{item.words}. Cure: {item.fix}" for item in error.check.sure)
        what = f"{later.run}: something in its set-up looks mistaken: {told}"
        return later, None, _trouble(later, "", ANYWAY, on_page(what), (ANYWAY,))
    except PttError as error:
        return later, None, _trouble(later, on_page(" ".join(str(error).split())))


def _trouble(
    later: Source, why: str, about: str = "", question: str = "", choices: Sequence[str] = ()
) -> dict[str, Any]:
    return {"run": later.run, "why": why, "about": about, "question": question, "choices": list(choices)}


def _tried(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    try:
        return work()
    except PttError as error:
        return {"why": on_page(" ".join(str(error).split()))}


def _pair(source: Source, after: "Opened", model: str) -> dict[str, Any]:
    """As `ptt compare --after`, with mean arrows of both."""
    from ptt.judge.before_after import compare_pair

    opened = open_both(source, model)
    pair = compare_pair(opened.table, after.table, opened.model.file)
    return pair.to_dict() | {"arrows": _arrows(pair), "runs": [source.run, after.table.source]}


def _arrows(pair: "BeforeAfter") -> dict[str, Any]:
    import numpy as np

    from ptt.show.plots.field import enlargement

    sides = (pair.before, pair.after)
    span = max(float(np.ptp(np.concatenate([side.place for side in sides]), axis=0).max()), 1e-3)
    size = float(np.quantile(np.linalg.norm(pair.before.error, axis=1), 0.95))
    drawn: dict[str, Any] = {"times": enlargement(span, size)}
    for words, side in (("before", pair.before), ("after", pair.after)):
        rows = spread(len(side.place), ARROWS)
        drawn[words] = {"place": _listed(side.place[rows]), "error": _listed(side.error[rows])}
    return drawn


def _listed(values: "np.ndarray") -> Any:
    import numpy as np

    return np.round(values, 6).tolist()


def _recheck(last: Source, model: str) -> dict[str, Any]:
    """As `ptt recheck`."""
    from ptt.show.studio.verbs import ask

    return ask(["recheck", last.run, "--model", str(place_of(model)), *last.options])


def _months(source: Source, model: str, runs: Sequence[tuple[Source, str]], tell: Progress) -> dict[str, Any]:
    """As `ptt fleet` with one machine: a store of these runs, worked on, and what moves in it.

    A later run that the store refuses, the same rows twice for instance, is left out of it and told.
    """
    from ptt.show.studio.verbs import say

    shutil.rmtree(MONTHS, ignore_errors=True)
    say(["fleet", "init", MONTHS])
    refused = []
    for number, (run, date) in enumerate(runs):
        if number > 0 and run.anyway:  # a store has no such answer
            refused.append(f"{run.run}: its set-up was taken all the same; left out here")
            continue
        place = ["--model", str(place_of(model))] if number == 0 else []
        options = replace(run, effects=(), anyway=False).options
        try:
            say(["fleet", "add", MONTHS, MACHINE, run.run, "--date", date, *place, *options])
        except PttError as error:
            if number == 0:
                raise
            refused.append(on_page(f"{run.run}: {error}"))
    tell("values by date", 2, 3)
    say(["fleet", "run", MONTHS])
    return _standing(Path(MONTHS)) | {"refused": refused}


VALUES = """
SELECT effect, parameter, parameters.label, unit, value, std, usual, strftime(runs.date, '%Y-%m-%d') AS day
FROM parameters JOIN runs USING (run) WHERE std > 0 ORDER BY runs.date, runs.place"""


def _standing(store: Path) -> dict[str, Any]:
    """Errors by date, and each value as each run alone has it; those that move first, then the largest."""
    from ptt.fleet.overview import overview
    from ptt.fleet.store import open_store

    opened = open_store(store)
    machine = overview(opened, MACHINE).machines[0]
    said: dict[str, Any] = json.loads(json.dumps(machine.to_dict(), default=str))
    moving = {(trend["effect"], trend["parameter"]) for trend in machine.trends()}
    values: dict[tuple[str, str], dict[str, Any]] = {}
    for row in opened.ask(VALUES):
        key = row["effect"], row["parameter"]
        own = values.setdefault(
            key, {"label": row["label"], "unit": row["unit"], "moves": key in moving, "size": 0.0, "days": [],
                  "value": [], "std": []},
        )  # fmt: skip
        own["size"] = max(own["size"], abs(row["value"]) / row["usual"])
        for column, name in (("days", "day"), ("value", "value"), ("std", "std")):
            own[column].append(row[name])
    first = sorted(values.values(), key=lambda each: (not each["moves"], -each["size"]))
    return {"alarms": said["alarms"], "history": said["history"], "values": [_shown(each) for each in first[:PLACES]]}


def _shown(value: dict[str, Any]) -> dict[str, Any]:
    """In the unit that sentences use, um for mm."""
    from ptt.effects.phrases import SHOWN_UNITS

    factor, unit = SHOWN_UNITS.get(value["unit"], (1.0, value["unit"]))
    scaled = {key: [factor * each for each in value[key]] for key in ("value", "std")}
    return value | scaled | {"unit": unit}
