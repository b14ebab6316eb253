"""The studio without a browser: its state, its jobs against the command line, its figures, its server's limits."""

import asyncio
import io
import json
import re
import runpy
import shutil
import zipfile
from dataclasses import replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import create_autospec

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest
import torch
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.diagnosis.telling.long import WHOLE, choose_diagnosis, diagnose_long
from ptt.diagnosis.telling.verdict import diagnose
from ptt.door.opened import Opened
from ptt.errors import InputError, ModelError, PttError
from ptt.fitting.chunks import CHUNK
from ptt.machine import parse_machine
from ptt.machine_schema import EffectEntry, ParameterEntry
from ptt.mechanisms import build_mechanism
from ptt.run.readers import Mapping
from ptt.show.card.solids import arrows
from ptt.show.report.gather import gather
from ptt.show.report.of_run import report_run
from ptt.show.studio import arrow_figure, figures, jobs, ladder_figures, machine_figure, opening
from ptt.show.studio.answers import agreed
from ptt.show.studio.controller import Studio
from ptt.show.studio.guard import LIMIT
from ptt.show.studio.looks import Look
from ptt.show.studio.outcomes import QuestionError
from ptt.show.studio.page_finish import commands_of
from ptt.show.studio.page_model import ladder_of, words_of
from ptt.show.studio.page_understood import parted
from ptt.show.studio.results import Changed, Source
from ptt.show.studio.samples import ARM, sample_files
from ptt.show.studio.seal_table import seal_html
from ptt.show.studio.server import Opening, keep_opening
from ptt.show.studio.session import Session
from ptt.show.studio.snapshot import Rung, key_of, parameter_rows
from ptt.show.studio.uploads import RESERVED, keep, safe_name

DATA = Path(__file__).resolve().parents[1] / "data" / "sealed_one"
MACHINE = (DATA / "machine.toml").read_text(encoding="utf-8")
RUN = Source("run.csv")


def silent(what: str, done: int = 0, of: int = 0) -> None:
    """Progress that nobody watches."""


def verb(*words: object) -> dict:
    """What a verb prints with --json."""
    outcome = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session's folder with the sample in it."""
    place = tmp_path_factory.mktemp("studio")
    for file in DATA.iterdir():
        shutil.copy(file, place)
    return place


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same as the working folder, as the worker has it."""
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="module")
def added(folder: Path) -> Changed:
    """The sample with the effect that was hidden."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return jobs.change(RUN, MACHINE, "add", ("backlash",), silent)


@pytest.fixture(scope="module")
def look(folder: Path) -> Look:
    """The sample held against its drawing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return jobs.look(RUN, MACHINE, silent)


def fresh(look: Look | None = None) -> Session:
    return Session().opened(RUN, MACHINE).remembering(look=look)


def test_comparison_is_the_one_of_the_command_line(here: Path):
    mine, theirs = jobs.compare(RUN, MACHINE, silent).data, verb("compare", "run.csv", "--model", "machine.toml")
    theirs.pop("network_left_aside")
    assert mine == theirs


def test_adding_is_the_one_of_the_command_line(here: Path, added: Changed):
    theirs = verb("add", "run.csv", "backlash", "--model", "machine.toml", "--out", "theirs.toml")
    assert added.data == theirs
    assert parse_machine(added.model).effect == parse_machine((here / "theirs.toml").read_text()).effect


def test_a_look_says_what_the_comparison_says(here: Path, look: Look):
    whole = jobs.compare(RUN, MACHINE, silent)
    rms = float(np.sqrt(np.mean(look.size_um[look.kept] ** 2)))
    assert rms == pytest.approx(whole.data["rms_um"]["total"], rel=0.02)
    exact = float(np.sqrt(np.mean(whole.look.size_um[whole.look.kept] ** 2)))
    assert exact == pytest.approx(whole.data["rms_um"]["total"], rel=1e-12)
    assert look.covariates[:2] == ("time [s]", "payload [kg]")


def test_links_of_the_drawing_have_their_length(look: Look):
    ends = look.drawing.chains
    np.testing.assert_allclose(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2), 300.0, atol=1e-6)
    np.testing.assert_allclose(look.drawing.platform, ends[:, :, 1])
    along = (ends[:, :, 0] - look.drawing.rails[None, :, 0])[..., :2]
    np.testing.assert_allclose(along, 0.0, atol=1e-9)  # sliders sit on their upright rails


def test_add_undo_redo_switch_and_remove(added: Changed, look: Look):
    start = fresh(look)
    with_it = start.changed("add", ("backlash",), added)
    assert [key_of(entry) for entry in with_it.effects] == ["backlash"]
    assert with_it.look is None and with_it.undone().look is look
    assert with_it.undone().now == start.now and with_it.undone().redone().now == with_it.now
    off = with_it.switched("backlash", False)
    assert parse_machine(off.text).effect == () and [key_of(e) for e in off.effects] == ["backlash"]
    assert off.switched("backlash", True).text == with_it.text
    assert off.undone().text == with_it.text
    assert off.future == () and with_it.undone().changed("fit", (), added).future == ()
    with pytest.raises(ModelError):
        off.switched("windup", True)
    assert start.undone() is start and with_it.redone() is with_it


def test_an_effect_that_is_off_stays_through_other_changes(here: Path, added: Changed):
    off = fresh().changed("add", ("backlash",), added).switched("backlash", False)
    other = jobs.change(RUN, off.text, "add", ("homing-offset",), silent)
    both = off.changed("add", ("homing-offset",), other)
    assert {key_of(entry) for entry in both.effects} == {"backlash", "homing-offset"}
    assert [key_of(entry) for entry in parse_machine(both.text).effect] == ["homing-offset"]
    back = both.switched("backlash", True)
    own, first = (next(e for e in s.effects if e.name == "backlash") for s in (back, fresh().changed("add", (), added)))
    assert own == first


def test_ladder_and_commands_grow_with_the_steps(here: Path, added: Changed):
    one = fresh().changed("add", ("backlash",), added)
    two = one.changed("remove", ("backlash",), jobs.change(RUN, one.text, "remove", ("backlash",), silent))
    assert one.now is not None and two.now is not None
    assert [rung.words for rung in one.now.rungs] == ["as given", "+ backlash"]
    assert two.now.rungs[-1].words == "\N{MINUS SIGN} backlash" and not two.now.rungs[-1].helped
    assert one.now.rungs[-1].rms_um["total"] == added.data["steps"][-1]["rms_um"]["total"]
    assert two.now.commands == (
        "ptt add run.csv backlash --model machine.toml --out model1.toml",
        "ptt remove run.csv backlash --model model1.toml --out model2.toml",
    )


def in_tab(session: Session, folder: Path | None = None) -> Studio:
    """A tab without a browser and without a process that calculates."""
    studio = object.__new__(Studio)
    studio.session, studio.busy, studio.trouble, studio._epoch = session, None, "", 0
    studio._looking = asyncio.Lock()
    studio.folder = folder or Path()
    studio.tell = lambda topic: None  # type: ignore[method-assign]
    return studio


def test_a_switched_off_effect_leaves_no_held_out_figure(here: Path, added: Changed):
    start, compared = fresh(), jobs.compare(RUN, MACHINE, silent)
    rungs, noise = ladder_of(in_tab(start.remembering(compared=compared)))
    assert [rung.heldout_rms_um for rung in rungs] == [None]
    plain = compared.data["rms_um"]["total"]
    words = words_of(start, rungs[-1], noise, "total")
    assert f"{plain:.2f}" in words and "plain RMS; no held-out figure" in words and "switched off" not in words
    assert ladder_figures.ladder_figure(rungs, noise)["data"][1]["y"] == []

    with_it = start.changed("add", ("backlash",), added)
    rungs, noise = ladder_of(in_tab(with_it))
    assert re.match(
        r"Now [\d.]+\s.* held out; noise [\d.]+\N{NO-BREAK SPACE}.m$", words_of(with_it, rungs[-1], noise, "total")
    )

    off = with_it.switched("backlash", False)
    waiting = words_of(off, ladder_of(in_tab(off))[0][-1], noise, "total")
    assert waiting == "backlash off: the figures of that are being worked out"
    off = off.remembering(compared=jobs.compare(RUN, off.text, silent))
    rungs, noise = ladder_of(in_tab(off))
    assert [rung.words for rung in rungs] == ["as given", "+ backlash", "backlash off"]
    words = words_of(off, rungs[-1], noise, "total")
    assert f"Now {plain:.2f}" in words and "plain RMS" in words and "switched off: backlash" in words
    drawn = ladder_figures.ladder_figure(rungs, noise)["data"]
    assert [len(trace["y"]) for trace in drawn] == [2, 2, 2, 1]


@pytest.mark.parametrize(
    ("step", "held_out", "helped", "words"),
    [
        ("+ windup", 4.0, True, ""),
        ("+ windup", 4.9, False, "this step is not sure to have helped"),
        ("+ windup", 5.1, False, "this step did not help: the held-out error did not fall"),
        ("\N{MINUS SIGN} backlash", 9.0, False, "what this step removed is needed"),
        ("\N{MINUS SIGN} backlash", 5.0, True, ""),
        ("refit", 5.0, False, ""),
    ],
)
def test_a_step_that_did_not_help_is_said_to_be_what_it_is(here: Path, added: Changed, step, held_out, helped, words):
    session = fresh().changed("add", ("backlash",), added)
    figures = dict.fromkeys((*"xyz", "total"), 5.0)
    before, last = Rung("+ backlash", figures, figures), Rung(step, figures, figures | {"total": held_out}, helped)
    session = replace(session, now=replace(session.now, rungs=(before, last)))
    told = words_of(session, last, figures, "total")
    assert re.findall(r"\((.*)\)", told) == ([words] if words else [])


def test_commands_remove_what_is_switched_off_and_add_it_again(here: Path, added: Changed):
    off = fresh().changed("add", ("backlash",), added).switched("backlash", False)
    steps = (
        "ptt add run.csv backlash --model machine.toml --out model1.toml",
        "ptt remove run.csv backlash --model model1.toml --out model2.toml",
    )
    assert off.commands == steps and off.switched("backlash", True).commands == steps[:1]
    listed = commands_of(in_tab(off))
    assert listed[-1] == "ptt predict targets.csv --model model2.toml --out sliders.csv"
    assert any(line.startswith("#") for line in listed)
    both = off.changed("add", ("homing-offset",), jobs.change(RUN, off.text, "add", ("homing-offset",), silent))
    more = (*steps, "ptt add run.csv homing-offset --model model2.toml --out model3.toml")
    assert both.commands == more and both.now is not None and both.now.fitted == both.text
    assert both.switched("backlash", True).commands == (
        *more, "ptt add run.csv backlash --model model3.toml --out model4.toml"
    )  # fmt: skip
    again = off.changed("add", ("backlash",), added)
    assert again.text == added.model and again.commands[-1].startswith("ptt add run.csv backlash --model model2.toml")


def test_uploads_take_the_place_of_nothing(tmp_path: Path):
    assert keep(tmp_path, "run.csv", b"one") == "run.csv"
    assert keep(tmp_path, "../RUN.csv", b"two") == "RUN (2).csv"
    assert keep(tmp_path, "run.csv", b"three") == "run (3).csv"
    assert keep(tmp_path, "run.csv", b"one") == "run.csv"  # the same again
    assert (tmp_path / "run.csv").read_bytes() == b"one"
    for name in RESERVED:
        assert keep(tmp_path, name.upper(), b"mine").casefold() not in {each.casefold() for each in RESERVED}
    assert keep(tmp_path, "Model.toml", b"other") == "Model (3).toml"
    for name in ("own.py", "OWN.PY", "own.py. "):
        with pytest.raises(InputError, match="program"):
            keep(tmp_path, name, b"raise SystemExit")
    with pytest.raises(InputError, match="larger"):
        keep(tmp_path, "large.csv", bytes(LIMIT + 1))


def test_files_of_effects_lie_where_no_upload_gets(tmp_path: Path):
    given = Source("run.csv", map_="answers.toml", effects=("own.py",))
    files = {"run.csv": b"run", "answers.toml": b"", "own.py": b"own = 1"}
    source = keep_opening(tmp_path, Opening(files, given, MACHINE))
    assert source == replace(given, map_="answers (2).toml")
    assert source.effect_files == ("effects/own.py",) and source.options[-2:] == ("--effects", "own.py")
    kept = {keep(tmp_path, name, b"upload") for name in ("effects/own.py.txt", "effects", "own.csv")}
    assert kept == {"own.py.txt", "effects (2)", "own.csv"}
    assert [file.name for file in (tmp_path / "effects").iterdir()] == ["own.py"]
    assert (tmp_path / "effects" / "own.py").read_bytes() == b"own = 1"


def test_a_look_of_a_run_that_was_replaced_is_not_kept(look: Look):
    studio = in_tab(fresh())
    other = Session().opened(Source("other.csv"), MACHINE)

    async def work(words: str, job: str, *arguments: object, how: str = "asked") -> Look | None:
        studio.session = other  # meanwhile another run was opened
        return look if job == "look" else None

    studio.work = work  # type: ignore[method-assign]
    asyncio.run(studio._look())
    assert studio.session == other and studio.session.look is None


def test_parameters_say_what_is_not_measured():
    entry = EffectEntry(
        name="windup",
        parameters={
            "height_mm": ParameterEntry(value=(0.1, 0.2), std=(0.01, 0.02), measured=(True, False)),
            "length_mm": ParameterEntry(value=3.0),
            "gap_mm": ParameterEntry(value=1.0, fixed=True),
        },
    )
    assert parameter_rows(entry) == [
        ("height_mm 1", 0.1, 0.01, ""),
        ("height_mm 2", 0.2, None, "not measured by this data"),
        ("length_mm", 3.0, None, "searched"),
        ("gap_mm", 1.0, None, "held"),
    ]


def test_diagnosis_is_the_one_of_the_command_line(here: Path):
    found = jobs.learn(RUN, MACHINE, silent)
    assert found.data == verb("diagnose", "run.csv", "--model", "machine.toml")
    assert found.data["suggested"] == [["backlash"]] and found.measure_next == "" and found.sizes == []


def test_where_a_size_of_the_drawing_is_found_the_others_can_be_added_as_the_command_line_does(here: Path):
    place, random = np.random.default_rng(1).uniform(-50.0, 50.0, (60, 3)), np.random.default_rng(2)
    robot = build_mechanism(parse_machine(MACHINE, "machine.toml").machine)
    sent = robot.inverse(torch.as_tensor(place))
    stood = robot.forward(sent + torch.tensor([0.0, 0.1, 0.0])).numpy() + random.normal(0.0, 0.003, place.shape)
    columns = [f"{axis}_{kind}" for kind in ("cmd", "meas") for axis in "xyz"]
    pd.DataFrame(np.hstack([place, stood]), columns=columns).to_csv("high.csv", index=False)
    found = jobs.learn(Source("high.csv"), MACHINE, silent)
    assert [step[0] for step in found.data["suggested"]] == ["homing-offset"]
    mine = jobs.change(Source("high.csv"), MACHINE, "add", ("homing-offset", *found.sizes), silent)
    theirs = verb("add", "high.csv", "homing-offset", "--sizes", "--model", "machine.toml", "--out", "theirs.toml")
    assert [step["effect"] for step in mine.data["steps"]] == [step["effect"] for step in theirs["steps"]]
    assert len(found.sizes) > 3 and mine.data["parameters"] == theirs["parameters"]


def test_compensator_and_its_commands_are_read_by_the_command_line(here: Path, added: Changed):
    trained = jobs.train(RUN, added.model, silent)
    mine = jobs.predict(RUN, trained.archive, "targets.csv", silent)
    with zipfile.ZipFile(io.BytesIO(trained.archive)) as archive:
        archive.extractall(here / "unpacked")
    verb("predict", "targets.csv", "--model", "unpacked/compensator", "--out", "theirs.csv")
    assert mine.content == (here / "theirs.csv").read_bytes()
    assert mine.data["rows"] == 296 and mine.data["network"]


def test_the_report_is_that_of_the_verb(here: Path, added: Changed, monkeypatch: pytest.MonkeyPatch):
    def write(opened: Opened, out: Path, *, model: Path, **more: object) -> None:
        assert opened.table.rows and parse_machine(model.read_text()).effect == parse_machine(added.model).effect
        out.write_text("<!doctype html>")

    as_written = create_autospec(report_run, side_effect=write)  # a changed signature fails here
    monkeypatch.setattr("ptt.show.report.of_run.report_run", as_written)
    assert jobs.report(replace(RUN, set_=("payload_kg=2",)), added.model, None, b"", b"", silent) == b"<!doctype html>"
    assert list(as_written.call_args.kwargs["reading"].set_) == ["payload_kg=2"]


def test_what_a_file_leaves_open_becomes_a_question(here: Path):
    frame = pd.read_csv("run.csv", dtype=str).rename(columns={"feed_mm_s": "feed"})
    frame.to_csv("open.csv", index=False)
    source = Source("open.csv")
    with pytest.raises(QuestionError) as asked:
        jobs.look(source, MACHINE, silent)
    assert "feed" in asked.value.question and "mm_s" in asked.value.choices
    answered = Source("open.csv", answers=((asked.value.question, "mm_s"),))
    assert "feed [mm/s]" in jobs.look(answered, MACHINE, silent).covariates
    assert answered.words == "open.csv --map answers.toml"


def test_what_is_wrong_with_a_file_is_said_first(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    frame["q1_cmd_rad"] = "0.1"
    pd.concat([frame[:10], frame[9:]]).to_csv("copied.csv", index=False)
    warnings, lines = parted(jobs.look(Source("copied.csv"), MACHINE, silent).understood)
    assert len(warnings) == 2 and not [line for line in lines if "warning" in line or "not used" in line]
    assert any("taken as repeats" in words for words in warnings) and any("q1_cmd_rad" in words for words in warnings)
    assert parted(jobs.look(RUN, MACHINE, silent).understood)[0] == []


def test_what_a_further_run_leaves_open_becomes_a_question(here: Path):
    frame = pd.read_csv("run.csv", dtype=str).rename(columns={"feed_mm_s": "feed"})
    frame[:-1].to_csv("second.csv", index=False, sep=";")
    source = replace(RUN, also=("second.csv",))
    with pytest.raises(QuestionError) as asked:
        jobs.look(source, MACHINE, silent)
    assert "second.csv" in asked.value.question
    answered = jobs.look(replace(source, answers=((asked.value.question, "mm_s"),)), MACHINE, silent)
    assert answered.rows == 2 * len(frame) - 1 and "feed [mm/s]" in answered.covariates


def test_answers_that_contradict_each_other_are_left_out():
    one = Mapping(delimiter=",", dates="day-first", columns={"a": "x_cmd", "b": "y_cmd"}, units={"a": "m"})
    two = Mapping(delimiter=";", columns={"a": "x_cmd", "b": "ignore"}, targets=Mapping(decimal=","))
    both = Mapping(dates="day-first", columns={"a": "x_cmd"}, units={"a": "m"}, targets=Mapping(decimal=","))
    assert agreed([one, two]) == both and agreed([one]) == one


def test_the_diagnosis_is_chosen_by_rows_and_kind_of_machine(here: Path):
    problem = opening.open_both(RUN, MACHINE).problem
    table, file = problem.table, problem.file

    def of(rows: int, kind: str) -> Any:
        return SimpleNamespace(
            table=SimpleNamespace(rows=rows), file=SimpleNamespace(machine=SimpleNamespace(kind=kind))
        )

    assert choose_diagnosis(problem) is diagnose and table.rows <= WHOLE[file.machine.kind]
    for kind in ("three-ptt", "serial"):
        assert choose_diagnosis(of(WHOLE[kind], kind)) is diagnose
        chosen = choose_diagnosis(of(WHOLE[kind] + 1, kind))
        assert isinstance(chosen, partial) and chosen.func is diagnose_long and chosen.keywords == {"size": CHUNK}
    assert WHOLE["serial"] < WHOLE["three-ptt"]
    assert choose_diagnosis(problem, 1000).keywords == {"size": 1000}


def test_a_report_of_a_long_run_is_diagnosed_in_chunks(here: Path, monkeypatch: pytest.MonkeyPatch):
    def in_chunks(*given: object, size: int, progress: object) -> None:
        raise InputError(f"chunks of {size}")

    monkeypatch.setitem(WHOLE, "three-ptt", 200)
    monkeypatch.setattr("ptt.diagnosis.telling.long.diagnose_long", in_chunks)
    opened = opening.open_both(RUN, MACHINE)
    assert gather(opened.table, opened.model.file).drawing.why_not == f"chunks of {CHUNK}"


def test_a_bad_file_gets_the_words_of_the_command_line(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    frame.loc[7, "x_meas"] = "--"
    frame.to_csv("bad.csv", index=False)
    with pytest.raises(PttError) as mine:
        jobs.look(Source("bad.csv"), MACHINE, silent)
    theirs = CliRunner().invoke(app, ["compare", "bad.csv", "--model", "machine.toml"])
    assert theirs.exit_code == 2 and theirs.stderr.strip() == f"error: {mine.value}"
    assert "row 9" in str(mine.value) and "x_meas" in str(mine.value)


def test_the_sample_of_an_arm_is_what_its_script_writes_and_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    runpy.run_path(str(DATA.parent / "make_arm.py"))["main"](tmp_path)
    found = {file.name: file for file in sample_files(ARM) or ()}
    assert set(found) == {"run.csv", "machine.toml", "targets.csv"}
    for name, file in found.items():
        assert (tmp_path / "arm" / name).read_bytes() == file.read_bytes()
    monkeypatch.chdir(tmp_path / "arm")
    look = jobs.look(RUN, found["machine.toml"].read_text(encoding="utf-8"), silent)
    assert look.serial and look.rows == 220 and look.drawing.chains.shape[0] == 220
    assert set(sample_files("sealed_one") or ()) >= {DATA / "sealed.json"} and sample_files("nothing") is None


def test_a_fresh_challenge_can_be_read_and_its_seal_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    run, machine = jobs.challenge("single", 3, None, silent)
    again = jobs.challenge("single", 4, None, silent)  # a second one takes the place of the first
    assert again == (run, machine)
    text = (tmp_path / machine).read_text()
    assert jobs.look(Source(run), text, silent).rows > 100
    assert "<td" in seal_html(jobs.reveal(text, silent))


def test_a_challenge_of_an_arm_is_drawn_and_opened_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    drawing = str((DATA.parent / "arm" / "machine.toml").resolve())
    monkeypatch.chdir(tmp_path)
    run, machine = jobs.challenge("single", 5, drawing, silent)
    text = (tmp_path / machine).read_text()
    assert jobs.look(Source(run), text, silent).serial and 'kind = "serial"' in text
    assert "<td" in seal_html(jobs.reveal(text, silent))


def test_figures_are_valid_plotly_and_say_their_units(look: Look, added: Changed):
    picked = look.visits_of(5).tolist()
    rungs = fresh().changed("add", ("backlash",), added).now.rungs  # type: ignore[union-attr]
    drawn = [
        machine_figure.machine_figure(look, 5, picked=picked, scale=200.0),
        machine_figure.machine_figure(look, 0, scale=200.0, machine=False, near=True),
        *(figures.against_figure(look, view, "direction1", picked, ("other", look)) for view in look.views),
        *(figures.against_figure(look, "x", context) for context in look.contexts),
        ladder_figures.ladder_figure(rungs, added.data["noise_um"], "y"),
        ladder_figures.ladder_figure(rungs[:1], added.data["noise_um"]),
    ]
    for figure in drawn:
        checked = go.Figure(data=figure["data"], layout=figure["layout"])  # refuses what plotly does not know
        assert "[" in str(checked.layout) and json.dumps(checked.to_plotly_json(), default=list)
    traces = drawn[0]["data"]
    assert {"rails", "sliders", "links", "platform", "errors", "readings", "picked"} == {t["name"] for t in traces}
    assert next(t for t in traces if t["name"] == "picked")["customdata"] == picked
    colours = next(t for t in traces if t["name"] == "errors")
    assert colours["cmin"] == 0.0 and colours["colorscale"] == "Cividis"


def test_colours_of_curves_stand_out_on_light_and_dark_cards():
    """The contrast of WCAG for what is drawn, 3 to 1 with rounding; the pale ones lie behind others on purpose."""
    style = files("ptt.show.studio").joinpath("style.css").read_text(encoding="utf-8")
    cards = re.findall(r"--card:(#[0-9a-f]+)", style)

    def light(colour: str) -> float:
        whole = colour if len(colour) == 7 else "#" + "".join(2 * digit for digit in colour[1:])
        parts = np.asarray([int(whole[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
        return float(
            np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ (0.2126, 0.7152, 0.0722)
        )

    assert len(cards) == 2
    for colour in (figures.BLUE, figures.VIOLET, figures.ORANGE, figures.GREY):
        for card in cards:
            low, high = sorted((light(colour), light(card)))
            assert (high + 0.05) / (low + 0.05) > 2.95, (colour, card)


def test_arrows_are_means_of_poses_and_as_long_as_stated(look: Look):
    means = arrow_figure.mean_arrows(look)
    place, mean, count = means.place, means.error, means.count
    assert count.sum() == look.kept.sum() and len(place) < look.rows
    solid, owner = arrows(place, 250.0 * mean, 1.0)
    for number in (0, len(place) // 2, len(place) - 1):
        rows = look.kept & (np.linalg.norm(look.target - place[number], axis=1) < 1e-2)
        assert rows.sum() == count[number]
        np.testing.assert_allclose(mean[number], look.residual[rows].mean(axis=0), atol=1e-12)
        tip = place[number] + 250.0 * look.residual[rows].mean(axis=0)
        assert np.linalg.norm(solid.points[owner == number] - tip, axis=1).min() < 1e-9


def test_a_large_run_is_thinned_but_what_is_picked_is_drawn(look: Look):
    many = np.tile(np.arange(look.rows), 30)
    spread = look.target[many] + np.random.default_rng(0).normal(size=(len(many), 3))
    large = replace(look, line=np.arange(len(many)), target=spread, residual=look.residual[many], kept=look.kept[many])
    rows = figures.shown_rows(large, [3, 1001])
    assert figures.MOST_READINGS <= len(rows) <= figures.MOST_READINGS + 2 and {3, 1001} <= set(rows.tolist())
    means = arrow_figure.mean_arrows(large)
    assert len(means.place) <= arrow_figure.SHOWN_ARROWS and means.count.sum() == large.kept.sum()
    whole = (means.count[:, None] * means.error).sum(axis=0)  # every reading is in one mean, and once
    np.testing.assert_allclose(whole, large.residual[large.kept].sum(axis=0), atol=1e-9)
    apart = np.linalg.norm(large.target[means.row] - means.place, axis=1)
    assert (
        large.kept[means.row].all() and apart.max() < np.ptp(large.target, axis=0).max() / 4.0
    )  # a reading of its own
    assert arrow_figure.mean_arrows(large) is means


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\runs\\a b.csv", "a b.csv"),
        ("<img src=x>.csv", "_img src_x_.csv"),
        ("...", "file"),
        ("跟踪仪.csv", "跟踪仪.csv"),
    ],
)
def test_names_of_uploads_lose_their_folders(given: str, kept: str):
    assert safe_name(given) == kept


def test_uploads_have_a_limit():
    from ptt.show.studio.guard import UploadLimit

    seen: list[int] = []

    async def inner(scope, receive, send):
        while (message := await receive())["type"] != "http.disconnect" and message.get("more_body"):
            seen.append(len(message["body"]))
        seen.append(-1 if message["type"] == "http.disconnect" else len(message["body"]))

    async def post(length: bytes | None, chunks: list[bytes]) -> int | None:
        status = None
        bodies = iter(chunks)

        async def receive():
            return {"type": "http.request", "body": next(bodies), "more_body": True}

        async def send(message):
            nonlocal status
            status = message.get("status", status)

        headers = [] if length is None else [(b"content-length", length)]
        await UploadLimit(inner)({"type": "http", "method": "POST", "headers": headers}, receive, send)
        return status

    assert asyncio.run(post(str(LIMIT * 2).encode(), [])) == 413
    assert asyncio.run(post(None, [])) == 413
    assert seen == []
    assert asyncio.run(post(b"10", [b"12345", b"1234567"])) is None
    assert seen == [5, -1]  # more than was said: cut off


def test_files_of_the_command_line_are_taken_by_name(tmp_path: Path):
    from ptt.commands.studio import read_opening

    opening = read_opening(DATA / "run.csv", DATA / "machine.toml", None, None, ["payload_kg=2"], None, None)
    assert set(opening.files) == {"run.csv"} and opening.source is not None
    assert opening.source.words == "run.csv --set payload_kg=2"
    assert parse_machine(opening.machine) == parse_machine(MACHINE)
    with pytest.raises(InputError, match="no such file"):
        read_opening(tmp_path / "none.csv", None, None, None, None, None, None)
    with pytest.raises(InputError, match="two files of one name"):
        read_opening(DATA / "run.csv", None, [DATA / "run.csv"], None, None, None, None)
