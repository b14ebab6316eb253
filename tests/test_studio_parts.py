"""Parts of the studio by themselves: sessions on disk, who is let in, shared processes, the card, ghosts, columns."""

import asyncio
import errno
import json
import re
import shutil
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest
from nicegui import Client

from ptt.challenge.challenge import open_challenge
from ptt.commands.main import run
from ptt.errors import InputError, SetupError
from ptt.files import cannot_write
from ptt.machine import load_machine, parse_machine
from ptt.rig.draw_arm import draw_arm
from ptt.run.readers import load_mapping
from ptt.show.card.bar import bar_html, parts_of_bar
from ptt.show.card.ghost import ghosts_of
from ptt.show.card.scene import legs_at_fault, moved, parts_of, usual_times
from ptt.show.card.solids import arrows
from ptt.show.card.words import how_sure, in_prose, length, parameter_in_words, prefixed, pretty, spoken
from ptt.show.studio import jobs
from ptt.show.studio.arrays import pack_look, unpack_look
from ptt.show.studio.card_figures import ruler_words, unknown_figure
from ptt.show.studio.controller import Studio
from ptt.show.studio.figures_again import error_figure, pair_figure, value_figure
from ptt.show.studio.guard import COOKIE, Guard, same_origin
from ptt.show.studio.keeping import Keeper
from ptt.show.studio.machine_figure import ROOM, chain_figure, machine_figure
from ptt.show.studio.opening import open_both
from ptt.show.studio.outcomes import JobFailedError, SetupFoundError
from ptt.show.studio.page import doing, told_of
from ptt.show.studio.page_again import change, date_in
from ptt.show.studio.page_columns import unit_in_words
from ptt.show.studio.page_machine import PRESETS, arm_text, three_ptt_text
from ptt.show.studio.page_model import ladder_of
from ptt.show.studio.pool import Pool
from ptt.show.studio.results import Learned, Source, Trained
from ptt.show.studio.seal_table import seal_html, truth_in_words
from ptt.show.studio.session import Session
from ptt.show.studio.store import SessionFolder, SessionStore
from ptt.show.studio.tool_tables import dexterity_html
from ptt.show.studio.verbs import use

DATA = Path(__file__).resolve().parents[1] / "data" / "sealed_one"
MACHINE = (DATA / "machine.toml").read_text(encoding="utf-8")
RUN = Source("run.csv")
OWNER = "a" * 43
KEPT = "\N{NO-BREAK SPACE}"


def silent(what: str, done: int = 0, of: int = 0) -> None:
    """Progress that nobody watches."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("parts")
    for file in DATA.iterdir():
        shutil.copy(file, place)
    return place


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(folder)
    use(run)
    return folder


@pytest.fixture(scope="module")
def learned(folder: Path) -> Learned:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return jobs.learn(RUN, MACHINE, silent)


def sealed_gaps_um() -> list[float]:
    """What was hidden in the sample, as its seal says."""
    truth = open_challenge(DATA).drawn.truth
    return [1e3 * value for value in truth["backlash"]["backlash_mm"]]


def test_a_session_is_taken_up_as_it_was(here: Path, learned: Learned, tmp_path: Path):
    look = jobs.look(RUN, MACHINE, silent)
    added = jobs.change(RUN, MACHINE, "add", ("backlash",), silent)
    session = Session().opened(RUN, MACHINE).remembering(look=look, learned=learned)
    session = session.changed("add", ("backlash",), added).switched("backlash", False).undone()
    session = session.remembering(trained=Trained({"share": 0.5}, b"zip"))
    place = SessionStore(tmp_path).fresh(OWNER)
    place.save(session)
    again = SessionStore(tmp_path).find(place.key, OWNER)
    assert again is not None
    back = again.load()
    assert (back.source, back.now, back.past, back.future) == (
        session.source,
        session.now,
        session.past,
        session.future,
    )
    assert back.undone().lesson == learned and back.training == session.training
    shown = back.undone().look
    assert shown is not None
    np.testing.assert_array_equal(shown.residual, look.residual)
    assert (
        shown.understood == look.understood
        and shown.columns == look.columns
        and shown.views.keys() == look.views.keys()
    )


def test_the_newest_state_gets_on_the_disk_and_a_full_disk_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    place, said, written = SessionStore(tmp_path).fresh(OWNER), [], []
    states = [replace(Session().opened(RUN, MACHINE), first=f"2026-01-0{day}") for day in (1, 2, 3, 4)]

    def slow(session: Session) -> None:
        time.sleep(0.05)
        written.append(session.first)
        SessionFolder.save(place, session)

    async def keep() -> None:
        keeper = Keeper(place, said.append)
        keeper.keep(states[0])
        await asyncio.sleep(0.02)  # the first is being written
        for state in states[1:3]:
            keeper.keep(state)
        await keeper.kept()
        assert (written, place.load().first) == (["2026-01-01", "2026-01-03"], "2026-01-03")
        keeper.keep(states[3])
        assert keeper.close() == ""  # the server ends before its turn comes
        await keeper.kept()
        assert (written[2:], place.load().first) == (["2026-01-04"], "2026-01-04")

    def full(session: Session) -> None:
        raise cannot_write(place.folder / "session.json", OSError(errno.ENOSPC, "No space left on device"))

    async def fail() -> None:
        keeper = Keeper(place, said.append)
        keeper.keep(states[0])
        await keeper.kept()
        keeper.keep(states[1])
        assert "No space left" in keeper.close()

    monkeypatch.setattr(place, "save", slow)
    asyncio.run(keep())
    assert said == []
    monkeypatch.setattr(place, "save", full)
    asyncio.run(fail())
    assert len(said) == 1 and "cannot be kept on disk" in said[0] and "No space left" in said[0]


def test_a_session_belongs_to_the_browser_that_made_it(here: Path, tmp_path: Path):
    store = SessionStore(tmp_path)
    place = store.fresh(OWNER)
    place.save(Session().opened(RUN, MACHINE))
    assert store.find(place.key, "b" * 43) is None and store.find("../../etc", OWNER) is None
    assert [each.key for each in store.recent(OWNER)] == [place.key] and store.recent("b" * 43) == []
    assert OWNER not in (place.folder / "session.json").read_text()  # whoever reads the disk cannot take its place


def test_what_cannot_be_read_is_worked_out_anew(here: Path, tmp_path: Path):
    place = SessionFolder(tmp_path, "abcdefghijkm", OWNER)
    place.save(Session().opened(RUN, MACHINE).remembering(look=jobs.look(RUN, MACHINE, silent)))
    (found,) = (place.folder / "found").iterdir()
    found.write_bytes(found.read_bytes()[:100])
    assert place.load().ready and place.load().look is None
    (place.folder / "session.json").write_text("{")
    assert not place.load().ready


def test_a_look_travels_without_anything_that_could_run(here: Path):
    look = jobs.look(RUN, MACHINE, silent)
    data = pack_look(replace(look, name=("<b>", *look.name[1:])))
    assert b"pickle" not in data and unpack_look(data).name[0] == "<b>"
    with pytest.raises((ValueError, KeyError)):
        unpack_look(b"PK\x03\x04 no archive")


@pytest.mark.parametrize(
    ("origin", "let_in"),
    [
        (None, True),
        (b"http://127.0.0.1:8317", True),
        (b"http://127.0.0.1:9999", False),
        (b"null", False),
        (b"https://127.0.0.1:8317", False),
        (b"http://evil.example", False),
        (b"http://127.0.0.1:8317.evil.example", False),
    ],
)
def test_only_pages_of_this_server_are_let_in(origin: bytes | None, let_in: bool):
    assert same_origin(origin, b"127.0.0.1:8317") is let_in


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_the_guard_refuses_foreign_pages_and_foreign_browsers(kind: str):
    said: list[dict] = []

    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": [(b"access-control-allow-origin", b"*")]})

    def ask(path: str, cookie: str, origin: bytes) -> dict:
        async def send(message):
            said.append(message)

        headers = [(b"host", b"127.0.0.1:1"), (b"origin", origin), (b"cookie", f"{COOKIE}={cookie}".encode())]
        scope = {"type": kind, "path": path, "headers": headers, "query_string": b"client_id=mine", "method": "GET"}
        asyncio.run(Guard(app, {"mine": OWNER}.get)(scope, None, send))
        return said[-1] if kind == "websocket" else said[-1] | {"first": said[0]}

    good = ask("/", OWNER, b"http://127.0.0.1:1")
    assert good["status"] == 200
    names = {name.lower() for name, _ in good["headers"]}
    assert b"access-control-allow-origin" not in names and b"content-security-policy" in names
    assert b"frame-ancestors 'none'" in dict(good["headers"])[b"content-security-policy"]
    for path, cookie, origin in (("/", OWNER, b"http://evil.example"), ("/", "b" * 43, b"http://127.0.0.1:1")):
        said.clear()
        refused = ask(path, cookie, origin)
        assert refused.get("first", refused).get("status", 403) == 403 and not any(m.get("status") == 200 for m in said)


def test_a_browser_without_a_cookie_gets_one_of_its_own():
    async def fetch() -> list[tuple[bytes, bytes]]:
        kept: list[tuple[bytes, bytes]] = []

        async def app(scope, receive, send):
            kept.extend(value for value in scope["headers"] if value[0] == b"cookie")
            await send({"type": "http.response.start", "status": 200, "headers": []})

        async def send(message):
            kept.extend(message.get("headers", ()))

        await Guard(app, lambda client: None)(
            {"type": "http", "path": "/", "headers": [], "query_string": b""}, None, send
        )
        return kept

    first, again = dict(asyncio.run(fetch())), dict(asyncio.run(fetch()))
    cookie = first[b"set-cookie"].decode()
    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie and first[b"cookie"] != again[b"cookie"]
    assert cookie.startswith(first[b"cookie"].decode())


def test_a_pool_shares_few_processes_gives_them_back_and_is_stopped(folder: Path, monkeypatch: pytest.MonkeyPatch):
    async def course() -> None:
        pool = Pool(most=1, idle=0.2)
        try:
            seen: list[str] = []
            names = pool.run(folder, "names", ("serial", ()), lambda what, done, of: seen.append(what))
            both = await asyncio.gather(pool.run(folder, "names", ("three-ptt", ())), names)
            assert "backlash" in both[0] and "dh-offsets" in both[1] and len(pool._all) == 1
            assert seen[0].startswith("waiting")
            with pytest.raises(JobFailedError, match=r"No such file|no such file"):
                await pool.run(folder, "look", (Source("none.csv"), MACHINE))
            frame = pd.read_csv(folder / "run.csv", dtype=str)
            frame["z_meas"] = (-frame["z_meas"].astype(float)).astype(str)
            frame.to_csv(folder / "left.csv", index=False)
            with pytest.raises(SetupFoundError) as found:
                await pool.run(folder, "look", (Source("left.csv"), MACHINE))
            assert found.value.findings[0]["rms_um"]["after"] < found.value.findings[0]["rms_um"]["before"] / 100.0
            (hand,) = pool._all
            monkeypatch.setattr("ptt.show.studio.pool.LEAVE", 60.0)
            for _ in range(2):  # what is stopped leaves off by itself, and its process takes the next job
                told = await _stopped(pool, folder)
                assert pool._all == {hand} and "drawing it" not in told
                assert "backlash" in await pool.run(folder, "names", ("three-ptt", ()))
            monkeypatch.setattr("ptt.show.studio.pool.LEAVE", 0.0)  # what does not leave off is ended
            await _stopped(pool, folder)
            assert hand not in pool._all and not hand.process.is_alive()
            assert "dh-offsets" in await pool.run(folder, "names", ("serial", ()))
            await asyncio.sleep(1.6)
            assert not pool._all  # without work for longer than it may be
        finally:
            pool.close()

    asyncio.run(course())


async def _stopped(pool: Pool, folder: Path) -> list[str]:
    """Stop a diagnosis in its middle: the stages that it came to."""
    told: list[str] = []
    begun = asyncio.Event()

    def tell(what: str, done: int, of: int) -> None:
        told.append(what)
        begun.set() if what.startswith("which effects") else None

    task = asyncio.create_task(pool.run(folder, "learn", (RUN, MACHINE), tell))
    await begun.wait()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    return told


def test_an_undo_waits_for_nothing_that_is_worked_out(here: Path, tmp_path: Path):
    async def course() -> None:
        async def slow(folder: Path, job: str, arguments: tuple, *given: object, **how: object) -> object:
            return jobs.change(*arguments, silent) if job == "change" else await asyncio.Event().wait()

        studio = Studio(SessionStore(tmp_path).fresh(OWNER), cast(Pool, SimpleNamespace(run=slow)))
        studio.client = cast(Client, SimpleNamespace(is_deleted=True))
        studio.session = Session().opened(RUN, MACHINE).remembering(compared=jobs.compare(RUN, MACHINE, silent))
        adding = asyncio.create_task(studio.change("add", "backlash"))  # of what it leaves no picture comes
        while not studio.session.past:
            await asyncio.sleep(0.01)
        assert studio.session.look is None
        back = asyncio.create_task(studio.undo())
        await asyncio.sleep(0.05)
        assert studio.session.text == MACHINE and studio.session.look is not None
        adding.cancel()
        await back

    asyncio.run(course())


def test_a_mistaken_set_up_is_said_with_its_proof_and_mended(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    frame["z_meas"] = (-frame["z_meas"].astype(float)).astype(str)
    frame.to_csv("mirrored.csv", index=False)
    source = Source("mirrored.csv")
    with pytest.raises(SetupError) as met:
        jobs.look(source, MACHINE, silent)
    assert [finding.mistake for finding in met.value.check.sure] == ["axis-sign"]
    mended, machine = jobs.mend(source, MACHINE, silent)
    assert mended.run == "mended.csv" and parse_machine(machine).machine == parse_machine(MACHINE).machine
    rms = float(np.sqrt(np.mean(jobs.look(mended, machine, silent).size_um ** 2)))
    assert rms == pytest.approx(float(np.sqrt(np.mean(jobs.look(RUN, MACHINE, silent).size_um ** 2))), rel=1e-3)
    assert jobs.look(replace(source, anyway=True), MACHINE, silent).setup[0]["mistake"] == "axis-sign"


def test_columns_are_said_in_a_grid_and_kept(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    odd = {"x_meas": "A", "y_meas": "B", "z_meas": "C", "x_cmd": "goal 1", "y_cmd": "goal 2", "z_cmd": "goal 3"}
    metres = frame.rename(columns=odd)
    for title in ("A", "B", "C"):
        metres[title] = (metres[title].astype(float) / 1000.0).map("{:.9f}".format)
    metres.to_csv("odd.csv", index=False)
    seen = jobs.peek(Source("odd.csv"), silent)
    assert [c["quantity"] for c in seen["columns"] if c["title"] in "ABC"] == ["", "", ""]
    assert next(c for c in seen["columns"] if c["title"] == "A")["cells"][0] == metres["A"][0]
    said = {c["title"]: c["quantity"] or "ignore" for c in seen["columns"]}
    said |= {new: old for old, new in odd.items()}
    source = jobs.columns(Source("odd.csv"), said, dict.fromkeys("ABC", "m"), silent)
    assert load_mapping("columns.toml").units["A"] == "m" and source.options == ("--map", "columns.toml")
    np.testing.assert_allclose(
        jobs.look(source, MACHINE, silent).residual, jobs.look(RUN, MACHINE, silent).residual, atol=2e-6
    )


def test_a_unit_has_one_name_in_questions_and_chips():
    assert [unit_in_words(each) for each in ("mm_min", "um", "c", "row order")] == [
        "mm/min",
        "\N{MICRO SIGN}m",
        "\N{DEGREE SIGN}C",
        "row order",
    ]


def test_the_card_says_side_size_cure_and_how_sure(learned: Learned):
    card = learned.card
    assert (card["verdict"], len(card["findings"])) == ("missing", 1)
    (finding,) = card["findings"]
    values = {value["joint"]: value for value in finding["values"]}
    for joint, truth in enumerate(sealed_gaps_um(), 1):
        value = values[joint]
        assert value["unit"] == "\N{MICRO SIGN}m" and abs(value["size"] - truth) < 5.0 * value["error"] + 0.5
        assert "loses" in value["text"] and value["who"] == f"slider {joint}" and value["side"] == "on reversal"
    assert "raise the reversal compensation of slider" in finding["cure"] and finding["tie"] == ""
    assert finding["probability"] > 0.9 and " um" not in json.dumps(card)
    parts = parts_of_bar(card)
    assert sum(size for _, size, _ in parts) == pytest.approx(card["error_um"], rel=0.02)
    assert parts[0][0] == "left (noise)" and parts[0][1] == card["left_um"] < card["noise_um"]
    assert "backlash" in bar_html(card)
    unknown = parts_of_bar({"error_um": 50.0, "left_um": 20.0, "noise_um": 4.0, "findings": card["findings"]})
    assert [part[:2] for part in unknown[:2]] == [("noise", 4.0), ("without a name", 16.0)]


def test_a_report_from_the_page_diagnoses_nothing_anew(
    here: Path, learned: Learned, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    session = Session().opened(RUN, MACHINE).remembering(learned=learned)
    assert session.lesson_of_drawing is learned
    added = session.changed("add", ("backlash",), jobs.change(RUN, MACHINE, "add", ("backlash",), silent))
    assert added.lesson is None and added.lesson_of_drawing is learned
    anew = jobs.report(RUN, MACHINE, None, b"", b"", silent).decode()
    monkeypatch.setattr("ptt.show.report.gather.choose_diagnosis", lambda problem: pytest.fail)
    handed = jobs.report(RUN, MACHINE, None, learned.whole, b"", silent).decode()
    clock = re.compile(r"\d\d:\d\d(:\d\d)?")
    assert clock.sub("", handed) == clock.sub("", anew)
    # What is on a disk could run where it is unpacked: none of it gets there.
    place = SessionStore(tmp_path).fresh(OWNER)
    place.save(session)
    kept = place.load().lesson
    assert kept is not None and kept.whole == b"" and kept.data == learned.data


def test_one_thing_has_one_number_on_the_page(here: Path, learned: Learned):
    """Head line, ladder and card of a diagnosed model say the same; the comparison has another frame and more rows."""
    compared = jobs.compare(RUN, MACHINE, silent)
    session = Session().opened(RUN, MACHINE).remembering(compared=compared)
    studio = cast(Studio, SimpleNamespace(session=session))
    assert f"error {length(compared.data['rms_um']['total'])} rms" in told_of(studio)
    studio.session = session.remembering(learned=learned)
    assert told_of(studio).endswith(f"error {length(learned.card['error_um'])} rms")
    assert ladder_of(studio)[0][-1].rms_um["total"] == learned.card["error_um"] != compared.data["rms_um"]["total"]
    stepped = replace(studio.session, past=(studio.session.now,))
    assert session.began_um is None and stepped.began_um["total"] == learned.card["error_um"]


def test_a_later_run_is_held_beside_the_first_and_by_date(here: Path):
    """A tenth of every error is left: nine tenths fewer on each axis, and a tenth of each gap."""
    frame = pd.read_csv("run.csv").iloc[:100]
    frame.to_csv("first.csv", index=False)
    for axis in "xyz":
        frame[f"{axis}_meas"] = frame[f"{axis}_cmd"] + 0.1 * (frame[f"{axis}_meas"] - frame[f"{axis}_cmd"])
    frame.to_csv("later.csv", index=False)
    gaps = ", ".join(f"{1e-3 * gap:.5f}" for gap in sealed_gaps_um())
    values = f"gap_mm = {{ value = [{gaps}], std = [1e-4, 2e-4, 1e-4] }}"
    model = f'{MACHINE}\n[[effect]]\nname = "backlash"\n[effect.parameters]\n{values}\n'
    found = jobs.again(Source("first.csv"), model, "2026-01-10", [("later.csv", "2026-02-10")], silent)
    fall = found["pair"]["reduction_percent"]
    assert [fall[axis] for axis in ("x", "y", "z", "total")] == pytest.approx([90.0] * 4, abs=0.05)
    assert found["recheck"]["verdict"] == "changed" and found["recheck"]["changed"]
    shown = [value for value in found["months"]["values"] if "gap" in value["label"]]
    assert len(shown) == 3 and all(value["days"] == ["2026-01-10", "2026-02-10"] for value in shown)
    for value in shown:
        assert value["value"][1] == pytest.approx(0.1 * value["value"][0], abs=0.5)
    for when in ("before", "after"):
        drawn = pair_figure(found["pair"], when)
        figure = go.Figure(drawn["data"], drawn["layout"])
        assert figure.data[1].marker.cmin == 0.0
    drawn = json.dumps([error_figure(found["months"]["history"]), *map(value_figure, shown)])
    assert "\\u00b5m" in drawn and "um]" not in drawn

    session = replace(Session().opened(RUN, MACHINE), first="2026-01-10", later=(("later.csv", "2026-02-10"),))
    place = SessionStore(here / "kept").fresh(OWNER)
    place.save(session)
    assert (place.load().first, place.load().later) == (session.first, session.later)
    assert date_in("mill 2026-03-15 b.csv") == "2026-03-15" and date_in("20260315.csv") == "2026-03-15"
    assert date_in("run 2026-13-45.csv") == date_in("run.csv")


def test_the_fit_goes_through_this_runs_data(learned: Learned):
    fit = learned.fits["backlash"]
    data, through = np.asarray(fit["data_um"]), np.asarray(fit["fit_um"])
    noise = learned.card["noise_um"]
    assert np.std(data - through) < 1.5 * noise < 0.5 * np.std(data)
    number = int(fit["labels"][1].split()[1])
    gap = sealed_gaps_um()[number - 1]
    assert np.ptp(through) == pytest.approx(gap, rel=0.7)  # the frame takes a part of it


def test_the_card_of_an_arm_shows_the_joint_at_fault_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The virtual arm's play of 362 and 300 urad: two branches half the gap from zero, whatever the lever of a pose."""
    monkeypatch.chdir(tmp_path)
    for name in ("run.csv", "machine.toml"):
        (tmp_path / name).write_bytes((DATA.parent / "arm" / name).read_bytes())
    learned = jobs.learn(Source("run.csv"), (tmp_path / "machine.toml").read_text(encoding="utf-8"), silent)
    fit, hidden = learned.fits["backlash"], draw_arm(load_machine("machine.toml").machine, "backlash", 41).rig.faults
    label, name, unit = fit["labels"]
    gaps = [1e6 * gap for gap in hidden.gap.tolist()]
    joint = int(name.split()[1]) - 1
    assert gaps[joint] == max(gaps) and label.startswith(f"angle of joint {joint + 1}") and unit == "urad"
    through = np.asarray(fit["fit_um"])
    for side in (through[through > 0.0], -through[through < 0.0]):
        assert np.median(side) == pytest.approx(0.5 * gaps[joint], rel=0.15)  # the frame takes a part of it
        assert np.quantile(np.abs(side - np.median(side)), 0.9) < 0.25 * np.median(side)
    finding = learned.card["findings"][0]
    assert "screw" not in finding["cause"] and "joint" in finding["cause"]
    middle = ruler_words(finding["values"][0])[2]
    assert middle == "usual 500 \N{MICRO SIGN}rad"


def test_the_marks_of_a_ruler_are_sizes():
    micro = "\N{MICRO SIGN}m"
    value = {"size": 40.0, "worth": 0.8, "unit": micro}
    assert ruler_words(value) == (f"0.5 {micro}", f"5 {micro}", f"usual 50 {micro}", f"500 {micro}", "5 mm")
    assert ruler_words(value | {"worth": 0.0})[2] == "usual"


def test_an_opened_seal_is_said_in_units_with_prefixes():
    micro = "\N{MICRO SIGN}m"
    said = truth_in_words({"backlash_mm": [0.04028, 0.0179], "kind": "hose", "stiffness_n_per_mm": 0.5662})
    assert said == f"backlash 40, 18 {micro}; kind hose; stiffness 0.57 N/mm"
    assert truth_in_words({"frame_um_per_m_k": 12.84, "slip_time_s": 90.0}) == f"frame 13 {micro}/m/K; slip time 90 s"
    opened = {
        "right": False, "left_um": 0.2, "noise_um": {"total": 5.0},
        "hidden": [{"effect": "backlash", "is": "found", "instead": [], "size_um": 1234.0,
                    "truth": {"backlash_mm": [-0.04]}, "model": [{"name": "gap_mm 1", "value": -0.04, "std": 1e-4}]}],
        "named": [{"effect": "windup", "is": "wrong", "parameters": []}],
        "tool_error_um": {"before": {"x": 1.0, "y": 1.0, "z": 1.0, "total": 1.7}, "after": None},
    }  # fmt: skip
    page = seal_html(opened).replace(KEPT, " ")
    for words in ("1.23 mm", f"\N{MINUS SIGN}40 {micro}", "nothing of the kind", "cannot be followed", "Not right"):
        assert words in page


def test_dexterity_of_both_kinds_of_machine_is_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    home = {"q": [0.1], "condition": 21.5}
    space = {"poses": 9, "condition": {"least": 2.7, "median": 14.0, "largest": 868_894.3}}
    arm = space | {"most_isotropic_q": [-1.0, 0.5], "singular": [{"joints": [2, 3], "share": 0.22, "q": [0.0, 1.0]}]}
    page = dexterity_html({"home": home, "workspace": arm}).replace(KEPT, " ")
    assert "869,000" in page and "singular by joints 2 and 3: 22 % of walks" in page and "57 deg" in page
    page = dexterity_html({"home": home | {"edge_mm": 200.0}, "workspace": space | {"near_singular_share": 0.1}})
    page = page.replace(KEPT, " ")
    assert "200 mm" in page and "10.0 %" in page


def test_a_run_that_got_worse_has_a_change_above_zero():
    assert (change(90.0), change(-60.2)) == (f"\N{MINUS SIGN}90.0{KEPT}%", f"+60.2{KEPT}%")


def test_near_arrows_keep_apart_and_lone_ones_are_as_thick_as_they_are_long():
    start, vector = np.arange(5.0)[:, None] * (1.0, 0.0, 0.0), np.tile((0.0, 0.0, 40.0), (5, 1))
    near, owner = arrows(start, vector, 1.0, 0.4)
    wide = [np.ptp(near.points[owner == number][:, 0]) for number in range(5)]
    assert max(wide) < 0.9 and np.ptp(arrows(start[:1], vector[:1], 1.0)[0].points[:, 0]) > 5.0


def test_labels_of_legs_lie_above_and_below_by_turns_and_have_few_lines(learned: Learned, here: Path):
    look = jobs.look(RUN, MACHINE, silent)
    values = [{"who": f"slider {leg}", "size": 10.0, "error": 1.0, "unit": "um"} for leg in (1, 2, 3, 3, 3, 3)]
    ghost = {"shift": learned.ghosts["shift"]["backlash"], "at": 0, "times": 1.0, "values": values}
    scene = machine_figure(look, 0, scale=1.0, ghost=ghost)["layout"]["scene"]
    labels = {label["text"].split("<br>")[0]: label for label in scene["annotations"]}
    order = [labels[f"<b>slider {leg}</b>"] for leg in (1, 3, 2)]  # from left to right
    eye = np.array([scene["camera"]["eye"][axis] for axis in "xyz"])
    right = np.cross(-eye, [0.0, 0.0, 1.0])
    up = np.cross(right, -eye)
    high = [float(up @ [label[axis] for axis in "xyz"]) for label in order]
    middle = -1 if high[1] > (high[0] + high[2]) / 2.0 else 1  # above is below zero
    assert [np.sign(label["ay"]) for label in order] == [-middle, middle, -middle]
    assert labels["<b>slider 3</b>"]["text"].endswith("and 2 more")


def test_an_arm_is_drawn_whole(tmp_path: Path):
    """A long thin arm lies within its axes, and its box is no longer for the camera than a cube."""
    drawn = chain_figure([[0.0, 0.0, 0.0], [0.0, 0.0, 127.0], [-1184.0, 0.0, 127.0], [-1184.0, -256.0, 12.0]])
    scene, ratio = drawn["layout"]["scene"], drawn["layout"]["scene"]["aspectratio"]
    for axis in "xyz":
        low, high = scene[f"{axis}axis"]["range"]
        values = [value for trace in drawn["data"] for value in trace[axis]]
        assert low < min(values) and max(values) < high
    assert np.linalg.norm([ratio[axis] for axis in "xyz"]) == pytest.approx(ROOM)
    spans = [np.ptp(scene[f"{axis}axis"]["range"]) / ratio[axis] for axis in "xyz"]
    assert spans == pytest.approx([spans[0]] * 3)  # no axis is stretched


def test_a_ghost_moves_the_slider_that_lags_and_no_rail(learned: Learned):
    shift = learned.ghosts["shift"]["backlash"]
    gaps = np.asarray(sealed_gaps_um()) / 2e3
    along = np.abs(np.asarray(shift["sliders"])[:, :, 2])
    np.testing.assert_allclose(along.max(axis=0), gaps, rtol=0.1)
    assert np.abs(shift["rails"]).max() == 0.0
    kind, legs = legs_at_fault(shift)
    assert kind == "slider" and int(np.argmax(gaps)) in legs


@pytest.mark.parametrize(
    ("values", "effect", "kind", "leg"),
    [
        ([0.0, 0.2, 0.0], "link-length", "link", 1),
        ([0.0, 0.0, -0.25], "homing-offset", "slider", 2),
    ],
)
def test_a_ghost_is_on_the_part_that_has_the_fault(values: list[float], effect: str, kind: str, leg: int, here: Path):
    entry = {"link-length": "length_mm", "homing-offset": "offset_mm"}[effect]
    text = f'{MACHINE}\n[[effect]]\nname = "{effect}"\n[effect.parameters]\n{entry} = {{ value = {values} }}\n'
    opened = open_both(RUN, text)
    shift = ghosts_of(opened.model, opened.problem, (effect,))["shift"][effect]
    assert legs_at_fault(shift) == (kind, (leg,))
    look = jobs.look(RUN, MACHINE, silent)
    lines = look.drawing.at(5)
    there = moved(lines, shift, 0, 1.0)
    if kind == "link":  # the linear ghost makes the link longer by what it is
        rows = ghosts_of(opened.model, opened.problem, (effect,))["rows"]
        at = look.drawing.at(rows[0])
        grown = np.linalg.norm(np.diff(moved(at, shift, 0, 1.0).chains, axis=1)[:, 0], axis=1) - 300.0
        np.testing.assert_allclose(grown, values, atol=2e-4)
    else:
        assert there.chains[leg, 0, 2] - lines.chains[leg, 0, 2] == pytest.approx(values[leg], abs=1e-6)
    assert 20.0 < usual_times(lines, shift) < 5e4


def test_solids_of_a_machine_are_closed_and_where_the_lines_are(here: Path):
    look = jobs.look(RUN, MACHINE, silent)
    lines = look.drawing.at(0)
    for name, solid in parts_of(lines).items():
        edges = np.sort(
            np.concatenate([solid.faces[:, [0, 1]], solid.faces[:, [1, 2]], solid.faces[:, [2, 0]]]), axis=1
        )
        assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all(), name  # every edge has two sides
        assert np.isfinite(solid.points).all() and solid.faces.max() < len(solid.points)
    middle = parts_of(lines)["platform"].points.mean(axis=0)
    np.testing.assert_allclose(middle, look.target[0], atol=0.1)


def test_words_have_prefixes_that_a_person_uses():
    assert [length(value) for value in (0.0, 5.6, 70.94, 1186.0, 2.5e6)] == [
        f"0{KEPT}\N{MICRO SIGN}m",
        f"5.60{KEPT}\N{MICRO SIGN}m",
        f"70.9{KEPT}\N{MICRO SIGN}m",
        f"1.19{KEPT}mm",
        f"2.5{KEPT}m",
    ]
    assert prefixed([12_000.0, -3.0], "urad") == (1e-3, "mrad") and prefixed([900.0], "um") == (1.0, "\N{MICRO SIGN}m")
    assert prefixed([5e-4], "um")[1] == "nm" and prefixed([0.0, 8e6], "s")[1] == "days"
    assert pretty("falls from 7 to 3 um, 2 urad/N m; a sum of um/m/K -> x") == (
        f"falls from 7 to 3{KEPT}\N{MICRO SIGN}m, 2{KEPT}\N{MICRO SIGN}rad/N{KEPT}m; a sum of \N{MICRO SIGN}m/m/K "
        "\N{RIGHTWARDS ARROW} x"
    )
    assert how_sure(0.999).endswith("(> 99 %)") and how_sure(0.5) == "about even (50 %)"
    micro, off = "\N{MICRO SIGN}", "\N{PLUS-MINUS SIGN}"
    assert parameter_in_words("gap_mm 1", 0.040223, 8.1e-5) == ("gap 1", f"40.22{KEPT}{micro}m", f"{off}{KEPT}0.08")
    assert parameter_in_words("link_per_k", 1.1e-5, 2e-7) == ("link", f"11.00{KEPT}{micro}m/m/K", f"{off}{KEPT}0.20")
    assert parameter_in_words("period_mm", 5.02, None) == ("period", f"5.02{KEPT}mm", "")
    assert parameter_in_words("scale 2", 6.2e-5, 1e-6)[1] == f"62.0{KEPT}{micro}m/m"
    assert doing("x", 3, 12, 6.0) == "x: 3 of 12, 2 s each, 18 s left" and doing("x", 0, 0, 0.5) == "x"


def test_a_figure_stays_on_one_line_with_its_unit():
    for text in ("5.26 um", "201 +- 4 um", "12 %", "1.6 um/m/K", "0.03 um/N", "21.4 \N{DEGREE SIGN}C", "90 s"):
        assert " " not in pretty(text)
    for text in ("3 causes found", "2 sliders", "5 more", "1 is", "read 300 rows and 4 months", "10 kinds"):
        assert pretty(text) == text
    assert spoken("b3", serial=False) == "height of slider 3" and spoken("q2", serial=True) == "angle of joint 2"
    assert spoken("direction1", serial=False) == "direction of slider 1" and spoken("time", serial=True) == "time"


def test_the_machine_form_writes_files_that_are_read(tmp_path: Path):
    values = {
        "base_radius_mm": 210.0,
        "platform_radius_mm": 95.0,
        "link_length_mm": 310.0,
        "least": 100.0,
        "most": 450.0,
    }
    values |= {"screw_lead_mm": None, "platform_mass_kg": 2.0}
    spec = parse_machine(three_ptt_text('say "hi"', False, values)).machine
    assert spec.kind == "three-ptt" and (spec.base_radius_mm, spec.sliders, spec.name) == (210.0, "below", "say hi")
    described = jobs.describe(three_ptt_text("m", True, values), silent)
    assert described["svg"].startswith("<svg") and "b1 =" in described["words"]
    for name, (convention, rows) in PRESETS.items():
        joints = [
            dict(zip(("a_mm", "alpha_deg", "d_mm", "theta_offset_deg"), map(float, row), strict=True)) for row in rows
        ]
        text = arm_text(name, convention, joints)
        assert len(parse_machine(text).machine.joint) == len(rows)
        assert len(jobs.describe(text, silent)["chain"]) == len(rows) + 2


def test_a_store_that_cannot_be_written_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        SessionStore(tmp_path / "file" / "store")


@pytest.mark.parametrize(
    ("on", "unit", "across"),
    [
        ("speed2", "mm/s", "speed of slider 2 [mm/s]"),
        ("temperature", "C", "temperature [\N{DEGREE SIGN}C]"),
        ("time", "s", "time [min]"),
        ("time", "", "reading number"),
        ("coolant", "", "coolant"),
    ],
)
def test_the_picture_of_an_unknown_has_the_unit_of_what_it_follows(on, unit, across):
    at = [0.0, 400.0, 800.0]
    unknown = {
        "residual": "slider 1", "on": on, "with": None, "period_mm": None,
        "curve": {"at": at, "mean_um": [1.0, 2.0, 3.0], "half_width_um": [0.1, 0.1, 0.1]},
        "points": {"at": at, "um": [1.0, 2.0, 3.0], "unit": unit},
    }  # fmt: skip
    assert unknown_figure(unknown, serial=False)["layout"]["xaxis"]["title"]["text"] == across


def test_a_variable_of_a_joint_has_an_article_in_prose_and_a_column_of_ones_own_has_none():
    assert in_prose("b2", False) == "the height of slider 2" and in_prose("q3", True) == "the angle of joint 3"
    assert in_prose("payload", False) == "payload" and in_prose("flow2", False) == "flow2"


def test_a_store_that_is_named_from_here_is_the_same_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store = SessionStore(Path("sessions"))
    assert store.root == tmp_path / "sessions" and store.root.is_dir()
