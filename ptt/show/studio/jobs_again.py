"""Jobs of the view Again, on later runs of the same machine: before and after, what has changed, values by date."""

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.errors import PttError
from ptt.progress import Progress
from ptt.show.sizing import spread
from ptt.show.studio.later import ANYWAY
from ptt.show.studio.on_page import on_page
from ptt.show.studio.opening import open_both, place_of, with_saved_answers
from ptt.show.studio.outcomes import QuestionError
from ptt.show.studio.results import Source

if TYPE_CHECKING:
    import numpy as np

    from ptt.door.opened import Opened
    from ptt.fleet.store import Store
    from ptt.judge.before_after import BeforeAfter

LATER = "later"  # folder of saved answers on later runs
MONTHS = "months"  # folder of a fleet's store with these runs
MACHINE = "machine"  # name of the machine in it
ARROWS = 250  # of one picture
PLACES = 6  # values that are drawn by date


def again(
    source: Source, model: str, first: str, later: Sequence[tuple[Source, str]], tell: Progress
) -> Mapping[str, Any]:
    """Compare later runs with the one that is open and with the model; runs that cannot be read are left out.

    Args:
        source: the run that is open.
        model: text of its model.
        first: date of that run, ISO 8601.
        later: source and date of each later run, the last one last.
        tell: told what is done.

    Returns:
        'pair': the open run and the last one, before and after; 'recheck': of the last run; 'months': error and values
        by date, from a fleet's store of all runs. A part that cannot be computed has 'why' instead. 'left': for each
        run that was left out what `vet` returns.
    """
    sound, left, after = list[tuple[Source, str]](), list[dict[str, Any]](), None
    for number, (each, date) in enumerate(later):
        tell(f"reading {each.run}", 0, 3)
        own, read, trouble = _open_later(each, model, number)
        if read is None:
            left.append(trouble)
        else:
            after = read
            sound.append((own, date))
    if after is None:
        nothing = {"why": "no later run can be read as it is: see what stands against each."}
        return {"pair": nothing, "recheck": nothing, "months": nothing, "left": left}
    tell("before and after", 0, 3)
    pair = _or_why(partial(_pair, source, after, model))
    tell("what has changed", 1, 3)
    changed = _or_why(partial(_recheck, after))
    tell("values by date", 2, 3)
    months = _or_why(lambda: _months(model, [(replace(source, also=()), first), *sound], tell))
    return {"pair": pair, "recheck": changed, "months": months, "left": left}


def vet(later: Source, model: str, tell: Progress) -> Mapping[str, Any]:
    """Try to open a later run, so that obstacles are shown as soon as it is added.

    Args:
        later: its source.
        model: text of the model.
        tell: told what is done.

    Returns:
        Empty where it can be opened. Else 'run', 'why' it cannot, and 'about', 'question' and 'choices', empty where
        there is nothing to answer.
    """
    tell(f"reading {later.run}", 0, 0)
    return _open_later(later, model, 0)[2]


def _open_later(later: Source, model: str, number: int) -> tuple[Source, "Opened | None", dict[str, Any]]:
    """Open a later run: its source with saved answers, the opened run or None, and the obstacle as from `vet`.

    Answers are saved in a file of the run's own, by its number among the later runs.
    """
    from ptt.errors import SetupError

    Path(LATER).mkdir(exist_ok=True)
    try:
        own = with_saved_answers(later, model, Path(LATER) / f"{number}.toml")
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


def _or_why(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    try:
        return work()
    except PttError as error:
        return {"why": on_page(" ".join(str(error).split()))}


def _pair(source: Source, after: "Opened", model: str) -> dict[str, Any]:
    """As `ptt compare --after`, with errors of both runs for arrows."""
    from ptt.judge.before_after import compare_pair

    opened = open_both(source, model)
    pair = compare_pair(opened.table, after.table, opened.model.file)
    return pair.to_dict() | {"arrows": _arrows(pair), "runs": [source.run, after.table.source]}


def _arrows(pair: "BeforeAfter") -> dict[str, Any]:
    import numpy as np

    from ptt.show.plots.field import enlargement

    factor, _ = enlargement(np.concatenate([pair.before.place, pair.after.place]), pair.before.error)
    drawn: dict[str, Any] = {"times": factor}
    for words, side in (("before", pair.before), ("after", pair.after)):
        rows = spread(len(side.place), ARROWS)
        drawn[words] = {"place": _listed(side.place[rows]), "error": _listed(side.error[rows])}
    return drawn


def _listed(values: "np.ndarray") -> Any:
    import numpy as np

    return np.round(values, 6).tolist()


def _recheck(last: "Opened") -> dict[str, Any]:
    """As `ptt recheck`."""
    from ptt.again.recheck import recheck
    from ptt.door.result import plain

    told = recheck(last.model, last.problem, last.library).with_unexplained(last.check.unexplained)
    found: dict[str, Any] = plain(told.to_dict() | last.set_up)
    return found


def _months(model: str, runs: Sequence[tuple[Source, str]], tell: Progress) -> dict[str, Any]:
    """Process all runs as a fleet of one machine, in a new store.

    A later run that the store refuses, such as the same file twice, is left out and listed in 'refused'.
    """
    from ptt.door.model import load
    from ptt.door.reading import read_rows
    from ptt.fleet.run import run_all
    from ptt.fleet.store import add_machine, add_run, create_store, read_date

    shutil.rmtree(MONTHS, ignore_errors=True)
    store, place, refused = create_store(MONTHS), place_of(model), []
    load(place)  # refused here: an unknown effect would fail in every run
    file = add_machine(store, MACHINE, place)
    for number, (run, date) in enumerate(runs):
        if number > 0 and run.anyway:  # `ptt fleet` has no option --anyway
            refused.append(f"{run.run}: its set-up was taken all the same; left out here")
            continue
        how, path, when = run.reading(), Path(run.run), read_date(date)
        try:
            table = read_rows(path, file, how, checked=True)
            add_run(store, MACHINE, path, table, when, ordered=how.ordered, units_said=how.states_units)
        except PttError as error:
            if number == 0:
                raise
            refused.append(on_page(f"{run.run}: {error}"))
    tell("values by date", 2, 3)
    run_all(store)
    return _standing(store) | {"refused": refused}


VALUES = """
SELECT effect, parameter, parameters.label, unit, value, std, usual, strftime(runs.date, '%Y-%m-%d') AS day
FROM parameters JOIN runs USING (run) WHERE std > 0 ORDER BY runs.date, runs.place"""


def _standing(store: "Store") -> dict[str, Any]:
    """Alarms, history, and values by date as fitted to each run: those that move first, then the largest."""
    from ptt.fleet.overview import overview

    machine = overview(store, MACHINE).machines[0]
    said: dict[str, Any] = json.loads(json.dumps(machine.to_dict(), default=str))
    moving = {(trend["effect"], trend["parameter"]) for trend in machine.trends()}
    values: dict[tuple[str, str], dict[str, Any]] = {}
    for row in store.ask(VALUES):
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
    """A value in a workshop's unit, um for mm."""
    from ptt.effects.phrases import SHOWN_UNITS

    factor, unit = SHOWN_UNITS.get(value["unit"], (1.0, value["unit"]))
    scaled = {key: [factor * each for each in value[key]] for key in ("value", "std")}
    return value | scaled | {"unit": unit}
