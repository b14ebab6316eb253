"""What the page asks of the library: each job opens its files as the command line does and returns plain results."""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.show.studio.looks import Look
from ptt.show.studio.results import ANSWERS, SEAL, Changed, Compared, Learned, Predicted, Source, Trained
from ptt.show.studio.steps import START
from ptt.show.studio.worker import Progress, QuestionError

if TYPE_CHECKING:
    from ptt.door.opened import Opened

MODEL = "model.toml"  # the page's model, as the command line would be given it
COMPENSATOR = "compensator"


def prepare() -> None:
    """Load what every job needs before the first one comes."""


def look(source: Source, model: str, tell: Progress) -> Look:
    """Hold a run against a model, fast."""
    from ptt.show.studio.looks import look_at

    tell("reading the run", 0, 0)
    opened = _open(source, model)
    tell("residual", 0, 0)
    return look_at(opened.model, opened.problem)


def compare(source: Source, model: str, tell: Progress) -> Compared:
    """As `ptt compare`."""
    from ptt.door.result import plain
    from ptt.judge.compare.comparison import compare_run
    from ptt.judge.compare.text import format_comparison
    from ptt.show.studio.looks import look_at

    opened = _open(source, model)
    result = compare_run(opened.model, opened.problem, noise=opened.noise_or_none(), progress=tell)
    setup = opened.check.to_dict()["findings"] if opened.check else []
    data = plain(result.to_dict() | opened.set_up | {"setup": setup})
    return Compared(look_at(opened.model, opened.problem, result), data, format_comparison(result))


def learn(source: Source, model: str, tell: Progress) -> Learned:
    """As `ptt diagnose`, of runs whose rows fit into memory at once."""
    from ptt.diagnosis.verdict import diagnose
    from ptt.door.diagnosing import format_diagnosis
    from ptt.door.result import plain
    from ptt.run.table import table_to_frame

    opened = _open(source, model)
    _refuse_long(opened, f"ptt diagnose {source.words} --model {START}")
    result = diagnose(opened.model, opened.problem, opened.library, progress=lambda what: tell(what, 0, 0))
    poses = None if result.separation is None else result.separation.targets
    csv = "" if poses is None else table_to_frame(poses).to_csv(index=False, lineterminator="\n")
    return Learned(plain(result.to_dict() | opened.set_up), format_diagnosis(result), csv)


def change(source: Source, model: str, verb: str, effects: tuple[str, ...], tell: Progress) -> Changed:
    """As `ptt add`, `ptt remove` or `ptt fit`."""
    from ptt.door.result import plain
    from ptt.effects.registry import library, make_effect, parse_key
    from ptt.fitting.report import format_fit
    from ptt.judge.history import record
    from ptt.judge.ladder.climb import climb, descend
    from ptt.machine import format_machine

    opened = _open(source, model)
    known = opened.library or library()
    problem = opened.noisy(tell)
    if verb == "remove":
        ladder = descend(opened.model, problem, effects, progress=tell)
    else:
        new = [make_effect(known, *parse_key(text)) for text in effects]
        ladder = climb(opened.model, problem, new, progress=tell)
    text = format_machine(record(ladder, verb, opened.files))
    return Changed(text, plain(ladder.to_dict() | opened.set_up), format_fit(ladder.report))


def train(source: Source, model: str, tell: Progress) -> Trained:
    """As train.py."""
    from ptt.correct.training.compensator import save_compensator
    from ptt.correct.training.train import train as train_model
    from ptt.door.result import plain

    opened = _open(source, model)
    training = train_model(opened.model, opened.problem, progress=tell)
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
    return Trained(plain(data), _zipped(folder))


def predict(source: Source, model: str | bytes, targets: str, tell: Progress) -> Predicted:
    """As `ptt predict`, on a model or on a zipped compensator."""
    from ptt.door.model import load
    from ptt.door.options import Reading
    from ptt.door.predicting import predict as invert
    from ptt.door.run import targets_path

    tell("corrected commands", 0, 0)
    loaded, out = load(_place(model), effects=source.effect_files), Path("sliders.csv")
    result = invert(loaded, targets_path(Path(targets), loaded, Reading(json=True)))
    result.to_csv(out)
    return Predicted(result.to_dict(), tuple(f"warning: {line}" for line in result.warnings), out.read_bytes())


def report(source: Source, model: str, archive: bytes | None, tell: Progress) -> bytes:
    """As `ptt report`, with the compensator where one is trained."""
    from ptt.show.report.of_run import report_run

    tell("", 0, 0)
    opened, out = _open(source, model), Path("report.html")
    _refuse_long(opened, f"ptt report {source.words} --model {START} --out report.html")
    trained = None if archive is None else _place(archive)
    report_run(opened, out, run=Path(source.run), model=Path(MODEL), compensator=trained, reading=source.reading())
    return out.read_bytes()


def challenge(level: str, seed: int | None, tell: Progress) -> tuple[str, str]:
    """As `ptt challenge new`; where the run and the machine are. The seal lies in the session's folder."""
    from ptt.challenge.challenge import new_challenge

    tell("drawing a machine and measuring it", 0, 0)
    for file in Path("challenge").glob("*"):
        file.unlink()
    made = new_challenge("challenge", level, seed=seed).to_dict()  # type: ignore[arg-type]
    Path(made["sealed"]).replace(SEAL)
    return made["run"], made["machine"]


def reveal(model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt challenge reveal`, on the seal in the session's folder."""
    from ptt.door.model import load
    from ptt.door.revealing import reveal as open_seal

    tell("opening the seal", 0, 0)
    return {"text": str(open_seal(load(_place(model)), Path()))}


def card(effect: str, kind: str, files: tuple[str, ...], tell: Progress) -> Mapping[str, Any]:
    """The card of an effect and its sign at usual size on the sample machine."""
    from dataclasses import asdict

    from ptt.effects.bench import sample_view
    from ptt.effects.cards import card_of
    from ptt.effects.registry import library, make_effect, parse_key
    from ptt.show.plots.atlas import effect_sign, picture_theta

    known = library(*files)
    made = make_effect(known, *parse_key(effect))
    family = kind if kind in made.mechanisms else made.mechanisms[0]
    own = card_of(made)
    sign = effect_sign(made, picture_theta(made, family), sample_view(family), own)
    shade = None if sign.shade is None else sign.shade.tolist()
    drawn = {
        "telling": sign.telling.tolist(), "residual": sign.residual.tolist(), "shade": shade, "labels": sign.labels
    }  # fmt: skip
    return {"effect": effect, "stage": made.stage, **asdict(own), "sign": drawn}


def names(kind: str, files: tuple[str, ...], tell: Progress) -> tuple[str, ...]:
    """Effects that fit a mechanism family."""
    from ptt.effects.registry import library

    return tuple(name for name, cls in library(*files).items() if kind in cls.mechanisms)


def _open(source: Source, model: str) -> "Opened":
    """Open run and model as a verb does; what the file leaves open becomes a question to the person."""
    from ptt.door.opened import open_run
    from ptt.errors import TableError

    place = _place(model)
    if source.answers:
        _read_asking(source, place)
    try:
        return open_run(Path(source.run), place, source.reading())
    except TableError:
        if not source.answers:
            _read_asking(source, place)
        raise


def _read_asking(source: Source, place: Path) -> None:
    """Read with the answers given so far and keep them as a file for --map; ask for the first that is missing."""
    from ptt.door.options import parse_settings
    from ptt.machine import load_machine
    from ptt.run.readers import save_mapping
    from ptt.run.table import read_table
    from ptt.show.studio.answers import agreed

    answers = dict(source.answers)

    def ask(question: str, choices: Any) -> str:
        if question not in answers:
            raise QuestionError(question, tuple(choices))
        return answers[question]

    spec = load_machine(place).machine
    serial = spec.kind == "serial"
    understood = [
        read_table(
            run,
            len(spec.joint) if spec.kind == "serial" else 3,
            joint_prefix="q" if serial else "b",
            targets=source.targets or None,
            set_values=parse_settings(source.set_),
            mapping=source.map_ or None,
            ask=ask,
        ).understood
        for run in (source.run, *source.also)
    ]
    if source.answers:
        save_mapping(agreed([each.mapping for each in understood]), ANSWERS)


def _refuse_long(opened: "Opened", instead: str) -> None:
    """Runs that are summed up in chunks need processes of their own, which the page's process may not start."""
    from ptt.errors import TableError
    from ptt.fitting.chunks import LONG

    rows = opened.table.rows
    if rows > LONG:
        raise TableError(f"{rows} rows are too many to diagnose on the page (more than {LONG})", fix=f"run: {instead}")


def _place(model: str | bytes) -> Path:
    """The model as a file, or the compensator as a folder."""
    from ptt.files import write_text

    if isinstance(model, bytes):
        place = Path(COMPENSATOR)
        with zipfile.ZipFile(io.BytesIO(model)) as archive:
            for name in archive.namelist():
                (place / Path(name).name).write_bytes(archive.read(name))
        return place
    write_text(MODEL, model)
    return Path(MODEL)


def _zipped(folder: Path) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.iterdir()):
            archive.write(file, f"{folder.name}/{file.name}")
    return content.getvalue()
