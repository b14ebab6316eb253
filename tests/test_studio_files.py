"""Files of the studio: uploads, samples and challenges, and what they leave open."""

import asyncio
import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
from studio_sample import DATA, MACHINE, RUN, silent
from studio_sample import folder as folder
from studio_sample import here as here
from typer.testing import CliRunner

import ptt
from ptt.commands.main import app
from ptt.errors import InputError, PttError
from ptt.machine import parse_machine
from ptt.run.readers import Mapping
from ptt.show.studio import jobs, page_load
from ptt.show.studio.answers import merge_mappings
from ptt.show.studio.guard import LIMIT
from ptt.show.studio.on_page import CONTROLS, on_page
from ptt.show.studio.outcomes import QuestionError
from ptt.show.studio.page_understood import split_warnings
from ptt.show.studio.results import SEAL, Source
from ptt.show.studio.samples import ARM, sample_files
from ptt.show.studio.seal_table import seal_html
from ptt.show.studio.server import Opening, keep_opening
from ptt.show.studio.uploads import RESERVED, keep_seal, keep_upload, safe_name


def test_uploads_take_the_place_of_nothing(tmp_path: Path):
    assert keep_upload(tmp_path, "run.csv", b"one") == "run.csv"
    assert keep_upload(tmp_path, "../RUN.csv", b"two") == "RUN (2).csv"
    assert keep_upload(tmp_path, "run.csv", b"three") == "run (3).csv"
    assert keep_upload(tmp_path, "run.csv", b"one") == "run.csv"  # the same again
    assert (tmp_path / "run.csv").read_bytes() == b"one"
    for name in RESERVED:
        assert keep_upload(tmp_path, name.upper(), b"mine").casefold() not in {each.casefold() for each in RESERVED}
    assert keep_upload(tmp_path, "Model.toml", b"other") == "Model (3).toml"
    for name in ("own.py", "OWN.PY", "own.py. "):
        with pytest.raises(InputError, match="program"):
            keep_upload(tmp_path, name, b"raise SystemExit")
    with pytest.raises(InputError, match="larger"):
        keep_upload(tmp_path, "large.csv", bytes(LIMIT + 1))


def test_files_of_effects_lie_where_no_upload_gets(tmp_path: Path):
    given = Source("run.csv", map_="answers.toml", effects=("own.py",))
    files = {"run.csv": b"run", "answers.toml": b"", "own.py": b"own = 1"}
    source = keep_opening(tmp_path, Opening(files, given, MACHINE))
    assert source == replace(given, map_="answers (2).toml")
    assert source.effect_files == ("effects/own.py",) and source.options[-2:] == ("--effects", "own.py")
    kept = {keep_upload(tmp_path, name, b"upload") for name in ("effects/own.py.txt", "effects", "own.csv")}
    assert kept == {"own.py.txt", "effects (2)", "own.csv"}
    assert [file.name for file in (tmp_path / "effects").iterdir()] == ["own.py"]
    assert (tmp_path / "effects" / "own.py").read_bytes() == b"own = 1"


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


def test_time_that_goes_back_is_a_question_and_its_answer_a_setting(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    pd.concat([frame[:5], frame[6:7], frame[5:6], frame[7:]]).to_csv("back.csv", index=False)
    source = Source("back.csv")
    with pytest.raises(QuestionError) as met:
        jobs.look(source, MACHINE, silent)
    asked = met.value
    assert (asked.about, asked.choices) == ("order", ("rows", "time"))
    assert "time goes back" in asked.question and "--" not in asked.question
    sorted_ = source.answered(asked.about, asked.question, "time")
    assert sorted_.words == "back.csv --set order=time"
    assert jobs.look(sorted_, MACHINE, silent).line.tolist() == [2, 3, 4, 5, 6, 8, 7, *range(9, len(frame) + 2)]
    kept = jobs.look(source.answered(asked.about, asked.question, "rows"), MACHINE, silent)
    assert kept.line.tolist() == list(range(2, len(frame) + 2))


def test_what_is_wrong_with_a_file_is_said_first(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    frame["q1_cmd_rad"] = "0.1"
    pd.concat([frame[:10], frame[9:]]).to_csv("copied.csv", index=False)
    warnings, lines = split_warnings(jobs.look(Source("copied.csv"), MACHINE, silent).understood)
    assert len(warnings) == 2 and not [line for line in lines if "warning" in line or "not used" in line]
    assert any("taken as repeats" in words for words in warnings) and any("q1_cmd_rad" in words for words in warnings)
    assert split_warnings(jobs.look(RUN, MACHINE, silent).understood)[0] == []


def test_what_a_further_run_leaves_open_becomes_a_question(here: Path):
    frame = pd.read_csv("run.csv", dtype=str).rename(columns={"feed_mm_s": "feed"})
    frame[:-1].to_csv("second.csv", index=False, sep=";")
    source = replace(RUN, also=("second.csv",))
    with pytest.raises(QuestionError) as asked:
        jobs.look(source, MACHINE, silent)
    assert "second.csv" in asked.value.question
    answered = jobs.look(replace(source, answers=((asked.value.question, "mm_s"),)), MACHINE, silent)
    assert answered.rows == 2 * len(frame) - 1 and "feed [mm/s]" in answered.covariates


def test_a_message_names_the_control_of_the_page_and_not_the_option(here: Path):
    sources = "".join(file.read_text(encoding="utf-8") for file in Path(ptt.__file__).parent.rglob("*.py")
                      if file.name != "on_page.py")  # fmt: skip
    assert [said for said in CONTROLS if said not in sources] == []  # what the library says no more
    told = on_page("machine.toml: no column is understood; say what they hold with --map FILE.toml")
    assert told.endswith("say what they hold under 'Check the columns' on Load")
    assert on_page("--set payload_kg=VALUE") == "--set payload_kg=VALUE"  # the page has nothing for it
    assert jobs.vet(Source("machine.toml"), MACHINE, silent)["why"].endswith("under 'Check the columns' on Load")


def test_answers_that_contradict_each_other_are_left_out():
    one = Mapping(delimiter=",", dates="day-first", columns={"a": "x_cmd", "b": "y_cmd"}, units={"a": "m"})
    two = Mapping(delimiter=";", columns={"a": "x_cmd", "b": "ignore"}, targets=Mapping(decimal=","))
    both = Mapping(dates="day-first", columns={"a": "x_cmd"}, units={"a": "m"}, targets=Mapping(decimal=","))
    assert merge_mappings([one, two]) == both and merge_mappings([one]) == one


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
    run, machine, seal = jobs.challenge("single", 3, None, silent)
    again = jobs.challenge("single", 4, None, silent)  # a second one takes the place of the first
    assert again == (run, machine, seal)
    keep_seal(tmp_path, run, (tmp_path / seal).read_bytes())
    text = (tmp_path / machine).read_text()
    assert jobs.look(Source(run), text, silent).rows > 100
    assert "<td" in seal_html(jobs.reveal(Source(run), text, silent))


def test_a_seal_stays_with_its_run_whatever_is_dropped_after_it(tmp_path: Path):
    """A file that was dropped, but never opened, once took the seal of the open challenge away."""
    opened: list[Source] = []

    async def open_(source: Source, machine: str, view: str) -> None:
        opened.append(source)

    studio = SimpleNamespace(folder=tmp_path, open=open_, stage=lambda **staged: None, at_hand=(Source("run.csv"), ""))
    asyncio.run(page_load._take_sample(studio, "sealed_one"))
    asyncio.run(page_load._take_run(studio, "mine.csv", b"x_cmd"))
    asyncio.run(page_load._take_also(studio, "more.csv", b"x_cmd"))
    (challenge,) = opened
    assert (tmp_path / challenge.sealed / SEAL).read_bytes() == (DATA / SEAL).read_bytes()
    for other in (Source("mine.csv"), replace(challenge, also=("more.csv",))):
        assert not (tmp_path / other.sealed / SEAL).exists()


def test_a_challenge_of_an_arm_is_drawn_and_opened_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    drawing = str((DATA.parent / "arm" / "machine.toml").resolve())
    monkeypatch.chdir(tmp_path)
    run, machine, seal = jobs.challenge("single", 5, drawing, silent)
    keep_seal(tmp_path, run, (tmp_path / seal).read_bytes())
    text = (tmp_path / machine).read_text()
    assert jobs.look(Source(run), text, silent).serial and 'kind = "serial"' in text
    assert "<td" in seal_html(jobs.reveal(Source(run), text, silent))


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
