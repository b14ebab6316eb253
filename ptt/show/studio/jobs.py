"""Jobs: functions that worker processes run for the page. Each opens its files as the command line does.

A job runs in the folder of the session, takes picklable arguments and, as `tell`, a function to report progress, and
returns plain values. Further jobs are in `jobs_*`; a worker finds all of them here by name.
"""

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.progress import Progress
from ptt.show.sizing import spread
from ptt.show.studio.jobs_again import again, vet  # noqa: F401
from ptt.show.studio.jobs_effects import card, names, words_of_effect  # noqa: F401
from ptt.show.studio.jobs_export import export, formats  # noqa: F401
from ptt.show.studio.jobs_files import columns, describe, mend, peek  # noqa: F401
from ptt.show.studio.jobs_more import dexterity, iso, plan, write_effects  # noqa: F401
from ptt.show.studio.looks import Look
from ptt.show.studio.opening import COMPENSATOR, MODEL, open_both, place_of, zipped
from ptt.show.studio.results import Changed, Compared, Diagnosed, Predicted, Source, Trained

MOST_READINGS = 1200  # shown in the picture of an unknown

if TYPE_CHECKING:
    from ptt.diagnosis.telling.diagnosis import Diagnosis


def prepare() -> None:
    """Import what most jobs need before the first one comes."""
    import ptt.diagnosis.diagnose
    import ptt.door.opened
    import ptt.show.studio.looks  # noqa: F401


def look(source: Source, model: str, tell: Progress) -> Look:
    """Residual of a run with a model, for the page: fast, as only the frame is fitted."""
    from ptt.show.studio.looks import look_at

    tell("reading the run", 0, 0)
    opened = open_both(source, model)
    tell("residual", 0, 0)
    return look_at(opened.model, opened.problem, source.run, setup=opened.check.to_dict()["findings"])


def compare(source: Source, model: str, tell: Progress) -> Compared:
    """As `ptt compare`."""
    from ptt.door.result import plain
    from ptt.judge.compare.comparison import compare_run
    from ptt.judge.compare.text import format_comparison
    from ptt.show.studio.looks import look_at

    opened = open_both(source, model)
    result = compare_run(opened.model, opened.problem, noise=opened.noise_or_none(), progress=tell)
    setup = opened.check.to_dict()["findings"]
    data = plain(result.to_dict() | opened.set_up | {"setup": setup})
    return Compared(look_at(opened.model, opened.problem, source.run, result, setup), data, format_comparison(result))


def diagnose(source: Source, model: str, tell: Progress) -> Diagnosed:
    """As `ptt diagnose`, with what the page draws of it: the card, the data with fits, the ghosts."""
    from ptt.diagnosis.diagnose import diagnose_run
    from ptt.door.diagnosing import format_diagnosis, poses_of
    from ptt.door.next_command import Given
    from ptt.door.result import plain
    from ptt.fitting.drawn_sizes import unnamed_sizes
    from ptt.run.written import table_to_frame
    from ptt.show.card.fits import fits_of
    from ptt.show.card.ghost import ghosts_of
    from ptt.show.card.result import card_of_diagnosis

    tell("reading the run", 0, 0)
    opened = open_both(source, model)
    problem = opened.problem
    result = diagnose_run(opened.model, problem, opened.library, progress=lambda what: tell(_stage(what), 0, 0))
    result = result.with_unexplained(opened.check.unexplained)
    tell("drawing it", 0, 0)
    poses = poses_of(result, problem)
    csv = "" if poses is None else table_to_frame(poses).to_csv(index=False, lineterminator="\n")
    steps = tuple(step[0] for step in result.suggested)
    family = problem.file.machine.kind
    return Diagnosed(
        plain(result.to_dict() | opened.set_up),
        format_diagnosis(result, problem, Given(source.run, options=source.options)),
        csv,
        card=plain(card_of_diagnosis(result, problem).to_dict()),
        fits=fits_of(result, opened.model, problem),
        ghosts=ghosts_of(result.model, problem, steps),
        unknown=_unknown(result),
        cards=plain({key: words_of_effect(opened.library, key, family) for key in steps}),
        sizes=[size.key for size in unnamed_sizes(result.model.keys, problem)] if result.names_size else [],
        whole=_packed(result),
    )


def _packed(found: "Diagnosis") -> bytes:
    """A diagnosis pickled for another worker of this server; b'' where it cannot be, as with a user's own effect."""
    try:
        return pickle.dumps(found)
    except (pickle.PicklingError, AttributeError, TypeError):
        return b""


STAGES = {  # stages of a diagnosis -> in words
    "linearise": "how each effect would show",
    "search": "which effects explain it",
    "rest": "what is left",
    "measure next": "what to measure next",
    "fit all rows": "all rows",
    "search all rows": "all rows",
}


def _stage(what: str) -> str:
    """A stage of a diagnosis in words, a count at its end in brackets."""
    name = what.rstrip("0123456789 ")
    return f"{STAGES.get(name, name)} ({what[len(name) :].strip()})" if what != name else STAGES.get(name, name)


def _unknown(found: "Diagnosis") -> Mapping[str, Any] | None:
    """The leading dependence of a verdict 'unknown', with the readings that its picture shows; None for any other."""
    import numpy as np

    if found.verdict != "unknown" or not found.depends_on:
        return None
    first = found.depends_on[0]
    points = np.zeros((0, 2)) if first.points is None else first.points
    points = points[spread(len(points), MOST_READINGS)]
    fine = 1e6 if first.residual.startswith("joint") else 1e3  # urad, um
    at, um = np.round(points[:, 0], 6).tolist(), np.round(fine * points[:, 1], 4).tolist()
    unit = first.unit if first.with_ is None else "" if first.size is None else first.size.unit
    return first.to_dict() | {"points": {"at": at, "um": um, "unit": unit}}


def change(source: Source, model: str, verb: str, effects: tuple[str, ...], tell: Progress) -> Changed:
    """As `ptt add`, `ptt remove` or `ptt fit`."""
    from ptt.door.result import plain
    from ptt.effects.registry import make_effect, parse_key
    from ptt.fitting.report_words import format_fit
    from ptt.judge.history import record
    from ptt.judge.ladder.climb import climb, descend
    from ptt.machine import format_machine
    from ptt.plan.elsewhere import elsewhere_um

    opened = open_both(source, model)
    problem = opened.noisy(tell)
    if verb == "remove":
        ladder = descend(opened.model, problem, effects, progress=tell)
    else:
        new = [make_effect(opened.library, *parse_key(text)) for text in effects]
        ladder = climb(opened.model, problem, new, progress=tell)
    text = format_machine(record(ladder, verb, opened.files))
    figures = ladder.to_dict() | elsewhere_um(ladder.steps[-1].fitted, opened.problem) | opened.set_up
    return Changed(text, plain(figures), format_fit(ladder.report))


def train(source: Source, model: str, tell: Progress) -> Trained:
    """As train.py."""
    from ptt.correct.training.compensator import save_compensator
    from ptt.correct.training.train import train as train_model
    from ptt.door.result import plain

    opened = open_both(source, model)
    training = train_model(opened.model, opened.as_noisy(), progress=tell)
    folder = save_compensator(COMPENSATOR, training, list(opened.files))
    data = {
        "rms_um": training.rms_um,
        "heldout_rms_um": training.heldout_um,
        "noise_um": training.physics.noise.to_dict(),
        "protocol": training.protocol,
        "centres": training.rbf.chosen.centres,
        "learned": dict(zip("xyz", training.rbf.learned.tolist(), strict=True)),
        "share": training.rbf_share,
    }
    return Trained(plain(data), zipped(folder.iterdir(), folder.parent))


def predict(source: Source, model: str | bytes, targets: str, tell: Progress) -> Predicted:
    """As `ptt predict`, on a model or on a zipped compensator."""
    from ptt.door import predicting
    from ptt.door.model import load
    from ptt.door.options import ReadOptions
    from ptt.door.run import targets_path

    tell("corrected commands", 0, 0)
    loaded, out = load(place_of(model), effects=source.effect_files), Path("sliders.csv")
    result = predicting.predict(loaded, targets_path(Path(targets), loaded, ReadOptions(json=True)))
    result.to_csv(out)
    return Predicted(result.to_dict(), tuple(f"warning: {line}" for line in result.warnings), out.read_bytes())


def report(source: Source, model: str, archive: bytes | None, drawing: bytes, given: bytes, tell: Progress) -> bytes:
    """As `ptt report`, with the compensator where one is trained; diagnoses that are known are not repeated.

    Args:
        source: the files.
        model: text of the active model.
        archive: the compensator's folder as a zip; None without one.
        drawing: `Diagnosed.whole` of the bare drawing; b'' where it is not known.
        given: `Diagnosed.whole` of the active model; b'' where it is not known.
        tell: told what is done.

    Returns:
        The report as HTML.
    """
    from ptt.show.report.of_run import report_run

    tell("", 0, 0)
    opened, out = open_both(source, model), Path("report.html")
    trained = None if archive is None else place_of(archive)
    report_run(
        opened,
        out,
        run=Path(source.run),
        model=Path(MODEL),
        compensator=trained,
        reading=source.reading(),
        drawing=_unpacked(drawing),
        given=_unpacked(given),
        progress=tell,
    )
    return out.read_bytes()


def _unpacked(whole: bytes) -> "Diagnosis | None":
    """The diagnosis from `_packed`; safe to unpickle, as the bytes come from a worker of this server, never a file."""
    return pickle.loads(whole) if whole else None


def challenge(level: str, seed: int | None, machine: str | None, tell: Progress) -> tuple[str, str, str]:
    """As `ptt challenge new`; returns the paths of run, machine and seal."""
    from ptt.challenge.challenge import new_challenge
    from ptt.machine import load_machine

    tell("drawing a machine and measuring it", 0, 0)
    for file in Path("challenge").glob("*"):
        file.unlink()
    drawing = None if machine is None else load_machine(machine)
    made = new_challenge("challenge", level, seed=seed, machine=drawing).to_dict()  # type: ignore[arg-type]
    return made["run"], made["machine"], made["sealed"]


def reveal(source: Source, model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt challenge reveal`, on the seal of the run."""
    from ptt.door.model import load
    from ptt.door.revealing import reveal as open_seal

    tell("opening the seal", 0, 0)
    return open_seal(load(place_of(model), effects=source.effect_files), source.sealed).to_dict()
