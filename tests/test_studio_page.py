"""The studio in a browser: headless Chromium against a server of its own."""

import os
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright
from studio_browser import (
    RULES,
    START,
    WAIT,
    Server,
    check_layout,
    load_sample,
    open_files,
    saved,
    settled,
    show,
    wait_for,
)
from studio_sample import DATA, verb
from typer.testing import CliRunner

from ptt.commands.main import app

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed (Debian: apt-get install chromium)")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)  # fmt: skip
HIDDEN = "Resize must be passed a displayed plot"  # plotly, of a dialog that was just closed
VIEWS = ("Load", "Result", "Look", "Model", "Finish", "Again")

CONTROLS = """() => { window.wanted = [...document.querySelectorAll(
    'button, input:not([type=file]), [role=switch], [role=tab]')].filter(e => e.getClientRects().length && !e.disabled
    && e.getAttribute('aria-disabled') !== 'true' && getComputedStyle(e).visibility !== 'hidden');
  return wanted.length; }"""
MISSED = """() => wanted.filter(e => e.role !== 'tab' || e.ariaSelected === 'true')
  .filter(e => ![...reached].some(r => r === e || r.contains(e) || e.contains(r)))
  .map(e => e.outerHTML.slice(0, 160))"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    log = tmp_path_factory.mktemp("server") / "log.txt"
    # NiceGUI serves otherwise where it finds itself in a test.
    own = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")} | {
        "PYTHONUNBUFFERED": "1"
    }
    command = [sys.executable, "-c", START, "studio", "--port", "0", "--no-show", "--store", str(log.parent / "store")]
    with log.open("w") as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, env=own, cwd=log.parent)
        try:
            yield Server(wait_for(process, log), process)
        finally:
            process.terminate()
            process.wait(20)
    assert "Traceback" not in log.read_text(), log.read_text()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as tools:
        started = tools.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS), headless=True)
        yield started
        started.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    made = browser.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True)
    made.set_default_timeout(WAIT)
    yield made
    made.close()


@pytest.fixture
def page(context: BrowserContext, server: Server) -> Page:
    opened = context.new_page()
    opened.goto(server.place)
    return opened


def test_from_a_sample_to_a_model_that_the_command_line_reads(page: Page, tmp_path: Path):
    """The whole way through the page: nothing is asked of other places, and nothing breaks unseen."""
    asked: list[str] = []
    broken: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: broken.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: broken.append(str(error)))
    load_sample(page)
    _look_at_the_run(page)
    _add_what_is_found(page)
    theirs = verb("add", DATA / "run.csv", "backlash", "--model", DATA / "machine.toml", "--out", tmp_path / "m.toml")
    _read_the_ladder(page, theirs)
    _switch_and_undo(page)
    for view in ("Finish", "Again"):
        show(page, view)
        check_layout(page, view)
    _see_it_in_the_dark(page)
    model = saved(page, "Model (machine.toml)", tmp_path / "mine.toml")
    again = verb("diagnose", DATA / "run.csv", "--model", model)
    assert again["verdict"] == "nothing-missing"
    assert again["rms_um"]["before"]["total"] == pytest.approx(theirs["steps"][-1]["rms_um"]["total"], abs=0.01)
    _correct_targets(page, model, tmp_path)
    # A picture that cannot be drawn says so nowhere else.
    assert [words for words in broken if HIDDEN not in words] == []
    own = page.url.partition("/s/")[0]
    assert [url for url in asked if not url.startswith((own, "data:", "blob:"))] == []


def _look_at_the_run(page: Page) -> None:
    """The field is drawn, readings are picked in it, and both views of the run keep their layout."""
    show(page, "Look")
    expect(page.locator(".st-field canvas").first).to_be_visible(timeout=WAIT)
    _pick_a_box(page)
    check_layout(page, "Look")
    show(page, "Load")
    check_layout(page, "Load")


def _add_what_is_found(page: Page) -> None:
    """The one cause, its card and its cure; once it is added, the rest is diagnosed without being asked for."""
    show(page, "Result")
    expect(page.locator(".st-finding", has_text="backlash")).to_be_visible(timeout=WAIT)
    expect(page.get_by_text("One cause found")).to_be_visible()
    check_layout(page, "Result")
    page.get_by_role("button", name="card of backlash").click()
    expect(page.get_by_role("img", name="readings and the fit of backlash")).to_be_visible(timeout=WAIT)
    expect(page.get_by_text("Mended by")).to_be_visible(timeout=WAIT)
    page.get_by_role("button", name="close").click()
    page.get_by_role("button", name="add backlash", exact=True).click()
    expect(page.get_by_text(re.compile(r"error 5.36\s.m rms"))).to_be_visible(timeout=WAIT)
    expect(page.locator(".st-title", has_text="Nothing is missing")).to_be_visible(timeout=WAIT)


def _read_the_ladder(page: Page, theirs: dict) -> None:
    """Words and bars of the model are the figures of the command line."""
    show(page, "Model")
    ladder = page.get_by_text(re.compile(r"^Now [\d.]+\s.* held out"))
    expect(ladder).to_be_visible(timeout=WAIT)
    last, noise = theirs["steps"][-1], theirs["noise_um"]["total"]
    micro = "\N{NO-BREAK SPACE}\N{MICRO SIGN}m"
    assert ladder.inner_text() == (
        f"Now {last['rms_um']['total']:.2f}{micro} on training rows, {last['heldout_rms_um']['total']:.2f}{micro} "
        f"held out; noise {noise:.2f}{micro}"
    )
    drawn = page.evaluate("document.querySelector('.st-ladder').data.map(trace => trace.y)")
    assert drawn[1] == pytest.approx([step["heldout_rms_um"]["total"] for step in theirs["steps"]], rel=1e-9)
    check_layout(page, "Model")


def _see_it_in_the_dark(page: Page) -> None:
    """Colours keep their contrast."""
    page.get_by_role("button", name="light or dark").click()
    for view in ("Result", "Model", "Finish"):
        show(page, view)
        assert settled(page, RULES) == [], f"{view}, dark"


def _correct_targets(page: Page, model: Path, tmp_path: Path) -> None:
    """The file of commands is that of the command line, byte for byte."""
    with page.expect_download(timeout=WAIT) as waiting:
        page.locator(".st-drop-predict input[type=file]").set_input_files(DATA / "targets.csv")
    waiting.value.save_as(tmp_path / "sliders.csv")
    verb("predict", DATA / "targets.csv", "--model", model, "--out", tmp_path / "theirs.csv")
    assert (tmp_path / "sliders.csv").read_bytes() == (tmp_path / "theirs.csv").read_bytes()


AT_ONCE = """() => { [...document.querySelectorAll('[role=tab]')].find(tab => tab.innerText.includes('Look')).click();
  const canvas = document.querySelector('.st-field canvas');
  return [getComputedStyle(canvas).visibility, canvas.width > 300, location.pathname.endsWith('/look')]; }"""
WHY_AT_ONCE = """() => { document.querySelector('button[aria-label="card of backlash"]').click();
  const card = document.querySelector('dialog[open]'), box = card.getBoundingClientRect();
  return [getComputedStyle(card.querySelector('.main-svg')).visibility,
    card.querySelectorAll('.points path').length > 100,
    card.innerText.includes('Mended by'), box.width > 300 && box.right <= innerWidth]; }"""


def test_look_and_why_are_drawn_before_they_are_asked_for(page: Page):
    """Field and card are there in the moment of the click: nothing is waited for, neither drawing nor the server."""
    load_sample(page)
    field = page.locator(".st-field canvas").first
    field.wait_for(state="attached", timeout=WAIT)
    page.wait_for_function("document.querySelectorAll('.st-look .main-svg').length >= 6", timeout=WAIT)
    assert not field.is_visible()
    page.wait_for_function("document.querySelectorAll('dialog .points path').length > 100", timeout=WAIT)
    assert page.get_by_role("dialog").count() == 0  # hidden from everybody
    assert page.evaluate(WHY_AT_ONCE) == ["visible", True, True, True]
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    assert page.evaluate(AT_ONCE) == ["visible", True, True]
    expect(page.get_by_role("tab", name="Look")).to_have_attribute("aria-selected", "true", timeout=WAIT)
    expect(page.get_by_role("tabpanel")).to_have_count(1)  # all others are hidden from everybody


def _pick_a_box(page: Page) -> None:
    """A box dragged in the time line is highlighted in space and listed."""
    field = page.get_by_role("img", name="residual over time").locator(".nsewdrag")
    expect(field).to_be_attached(timeout=WAIT)
    box = field.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 5, box["y"] + 5)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.6 * box["height"], steps=4)
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.9 * box["height"], steps=4)
    page.mouse.up()
    note = page.get_by_text(re.compile(r"^\d+ picked readings"))
    expect(note).to_be_visible(timeout=WAIT)
    count = int(note.inner_text().split()[0])
    in_space = "document.querySelector('.st-field').data.find(trace => trace.name === 'picked')?.customdata.length"
    page.wait_for_function(f"{in_space} === {count}", timeout=WAIT)
    assert 5 < count < 290


def _switch_and_undo(page: Page) -> None:
    """The switch leaves the effect aside, undo brings it back, undo again takes the step away, redo repeats it."""
    page.get_by_role("switch", name="backlash").click()
    expect(page.get_by_text(re.compile(r"error 70.[5-9]\s.m rms"))).to_be_visible(timeout=WAIT)
    page.get_by_role("button", name="undo").click()
    expect(page.get_by_text(re.compile(r"error 5.36\s.m rms"))).to_be_visible(timeout=WAIT)
    page.get_by_role("button", name="undo").click()
    expect(page.get_by_text("The model has no effects yet")).to_be_visible(timeout=WAIT)
    page.get_by_role("button", name="redo").click()
    expect(page.get_by_role("switch", name="backlash")).to_be_visible(timeout=WAIT)


def test_a_bad_file_gets_the_words_of_the_command_line(page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    frame = pd.read_csv(DATA / "run.csv", dtype=str)
    frame.loc[7, "x_meas"] = "--"
    frame.to_csv("bad.csv", index=False)
    theirs = CliRunner().invoke(app, ["compare", "bad.csv", "--model", str(DATA / "machine.toml")])
    open_files(page, tmp_path / "bad.csv", DATA / "machine.toml")
    alert = page.get_by_role("alert").filter(has_text="bad.csv")
    expect(alert).to_be_visible(timeout=WAIT)
    assert f"error: {alert.locator('.st-trouble').inner_text()}" == theirs.stderr.strip()
    assert "/" not in alert.locator(".st-trouble").inner_text().replace("a/b", "")
    page.get_by_role("button", name="dismiss").click()
    expect(alert).to_be_hidden()


def test_two_tabs_are_two_sessions_and_a_reload_keeps_place_and_steps(
    page: Page, context: BrowserContext, server: Server, browser: Browser
):
    other = context.new_page()
    other.goto(server.place)
    load_sample(page)
    expect(other.get_by_text("No run yet")).to_be_visible()
    show(page, "Look")
    expect(page).to_have_url(re.compile(r"/s/[a-z0-9]{12}/look$"))
    page.reload()
    expect(page.get_by_role("tab", name="Look")).to_have_attribute("aria-selected", "true", timeout=WAIT)
    expect(page.get_by_text(re.compile(r"error 70.[5-9]\s.m rms"))).to_be_visible(timeout=WAIT)
    show(page, "Model")
    page.go_back()
    expect(page.get_by_role("tab", name="Look")).to_have_attribute("aria-selected", "true", timeout=WAIT)
    stranger = browser.new_context().new_page()  # without the cookie it belongs to
    stranger.goto(page.url)
    expect(stranger.get_by_text("No such session")).to_be_visible(timeout=WAIT)
    stranger.context.close()


def test_cancel_stops_the_calculation_and_the_page_goes_on(page: Page, server: Server, tmp_path: Path):
    part = pd.read_csv(DATA.parent / "experiment1.csv", nrows=500, dtype=str, keep_default_na=False)
    part.to_csv(tmp_path / "part.csv", index=False)  # takes long enough to be stopped
    open_files(page, tmp_path / "part.csv", DATA.parent / "machine.toml")
    expect(page.get_by_text(re.compile("finding what is missing: (how|which)"))).to_be_visible(timeout=WAIT)
    before = server.workers()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("finding what is missing: stopped")).to_be_visible(timeout=WAIT)
    least, last = server.spent(before), -1.0
    while (now := server.spent(before)) != last:  # the process that calculated is gone, or has left off
        last = now
        page.wait_for_timeout(1000)
    assert now - least < 5.0  # of some twelve that it would have taken
    expect(page.get_by_text("Not diagnosed yet")).to_be_visible()
    show(page, "Look")
    page.get_by_label("go to line").fill("40")
    expect(page.get_by_text(re.compile(r"^\d+ picked readings?"))).to_be_visible(timeout=WAIT)
    show(page, "Result")
    page.get_by_role("button", name="Find what is missing").click()
    expect(page.get_by_text(re.compile("finding what is missing: (how|which)"))).to_be_visible(timeout=WAIT)
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("finding what is missing: stopped")).to_be_visible(timeout=WAIT)


def test_no_click_on_add_is_lost_and_the_keyboard_undoes(page: Page):
    """Rows stay under the pointer while figures come in; Ctrl+Z and Ctrl+Y step back and forth."""
    load_sample(page)
    expect(page.locator(".st-finding", has_text="backlash")).to_be_visible(timeout=WAIT)
    add = page.get_by_role("button", name="add backlash", exact=True)
    for _ in range(3):
        add.click()
        expect(page.locator(".st-told", has_text="bench, backlash")).to_be_visible(timeout=WAIT)
        page.keyboard.press("Control+z")
        expect(page.locator(".st-told", has_text="no effects")).to_be_visible(timeout=WAIT)
        expect(add).to_be_visible(timeout=WAIT)
    page.keyboard.press("Control+y")
    expect(page.locator(".st-told", has_text="bench, backlash")).to_be_visible(timeout=WAIT)


def test_a_mistaken_set_up_is_shown_and_put_right(page: Page, tmp_path: Path):
    frame = pd.read_csv(DATA / "run.csv", dtype=str)
    frame["z_meas"] = (-frame["z_meas"].astype(float)).astype(str)
    frame.to_csv(tmp_path / "mirrored.csv", index=False)
    open_files(page, tmp_path / "mirrored.csv", DATA / "machine.toml")
    expect(page.get_by_text("First the set-up: something looks wrong")).to_be_visible(timeout=WAIT)
    expect(page.get_by_text("axis sign")).to_be_visible()
    expect(page.get_by_role("button", name="Go on anyway")).to_be_visible()
    check_layout(page, "set-up")
    expect(page.get_by_role("heading", name="What was understood")).to_be_visible()
    page.get_by_role("button", name="Correct it and open").click()
    expect(page.get_by_text(re.compile(r"mended.csv .* error 70.[5-9]\s.m rms"))).to_be_visible(timeout=WAIT)
    show(page, "Load")
    expect(page.get_by_role("heading", name="What was understood of mended.csv")).to_be_visible()
    page.locator(".st-drop-run input[type=file]").set_input_files(tmp_path / "mirrored.csv")
    page.get_by_role("button", name="open the files").click()
    expect(page.get_by_text("mirrored.csv is not open yet, see above. What follows is of mended.csv")).to_be_visible()


@pytest.mark.long
def test_what_a_later_run_leaves_open_is_answered_where_it_was_dropped(page: Page, tmp_path: Path):
    frame = pd.read_csv(DATA / "run.csv", dtype=str)
    stamps = [f"0{1 + row // 60}.03.2026 23:{row % 60:02d}:00" for row in range(len(frame))]
    frame.drop(columns="time_s").assign(timestamp=stamps).to_csv(tmp_path / "dates 2020-01-02.csv", index=False)
    (tmp_path / "empty.csv").write_text("")
    load_sample(page)
    show(page, "Again")
    drop = page.locator(".st-drop-later input[type=file]")
    drop.set_input_files([tmp_path / "dates 2020-01-02.csv", tmp_path / "empty.csv"])
    expect(page.get_by_text(re.compile("Left out. empty.csv: the file is empty"))).to_be_visible(timeout=WAIT)
    expect(page.get_by_text(re.compile("dates 2020-01-02.csv was measured before run.csv"))).to_be_visible()
    check_layout(page, "Again, with questions")
    answer = page.get_by_role("button", name="answer day-first")
    expect(answer).to_be_visible(timeout=WAIT)
    answer.click()
    expect(answer).to_be_hidden(timeout=WAIT)
    page.get_by_label("date of run.csv").fill("2020-01-01")
    expect(page.get_by_text("was measured before")).to_be_hidden(timeout=WAIT)
    expect(page.get_by_text("date as you said")).to_be_visible()
    page.get_by_role("button", name="Compare the runs").click()
    expect(page.get_by_text(re.compile("after: dates 2020-01-02.csv"))).to_be_visible(timeout=WAIT)
    expect(page.get_by_text(re.compile("Left out. empty.csv: the file is empty"))).to_be_visible()


@pytest.mark.long
def test_a_run_of_20000_rows_stays_usable(page: Page, tmp_path: Path):
    random = np.random.default_rng(1)
    target = np.round(random.uniform(-50.0, 50.0, (20_000, 3)), 4)
    measured = target + 0.05 * np.sin(target / 20.0) + random.normal(0.0, 0.004, target.shape)
    columns = dict(
        zip(("x_cmd", "y_cmd", "z_cmd", "x_meas", "y_meas", "z_meas"), (*target.T, *measured.T), strict=True)
    )
    pd.DataFrame(columns | {"time_s": 2.0 * np.arange(len(target))}).to_csv(tmp_path / "large.csv", index=False)
    open_files(page, tmp_path / "large.csv", DATA / "machine.toml")
    expect(page.get_by_role("tab", name="Result")).to_have_attribute("aria-selected", "true", timeout=WAIT)
    drawn = "(document.querySelector('PLOT')?.data ?? []).some(t => t.name === 'readings' && t.x.length > 60)"
    page.wait_for_function(drawn.replace("PLOT", ".st-machine"), timeout=WAIT)
    page.get_by_role("button", name="Cancel").click()
    show(page, "Look")
    page.wait_for_function(drawn.replace("PLOT", ".st-field"), timeout=WAIT)
    expect(page.locator(".st-field canvas").first).to_be_visible(timeout=WAIT)
    expect(page.get_by_text("20000 readings; each arrow is the mean error of readings near each other")).to_be_visible()
    page.get_by_label("go to line").fill("15001")
    expect(page.get_by_text(re.compile(r"^1 picked reading$"))).to_be_visible(timeout=WAIT)
    assert "15001" in page.locator(".st-look table.st-plain td").first.inner_text()
    page.get_by_label("go to line").fill("30000")
    expect(page.get_by_text("There is no reading in line 30000: they are in lines 2 to 20001.")).to_be_visible()
    page.get_by_label("go to line").fill("7")
    expect(page.get_by_text("There is no reading in line")).to_be_hidden()


def test_every_control_of_a_view_is_reached_by_the_keyboard(page: Page):
    load_sample(page)
    expect(page.locator(".st-finding")).to_be_visible(timeout=WAIT)
    page.evaluate("window.reached = new Set(); document.addEventListener('focusin', e => reached.add(e.target)); null")
    for view in VIEWS:
        show(page, view)
        wanted = page.evaluate(CONTROLS)
        assert wanted > 3
        page.get_by_role("tab", name=view).focus()
        for _ in range(wanted + 25):
            page.keyboard.press("Tab")
        assert page.evaluate(MISSED) == [], view


def test_only_this_computer_is_served_and_large_uploads_are_refused(server: Server):
    foreign = urllib.request.Request(server.place, headers={"Host": "evil.example"})
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(foreign, timeout=20)
    assert refused.value.code == 400
    refused.value.close()
    port = int(server.place.rsplit(":", 1)[1])
    listening = Path("/proc/net/tcp").read_text() + Path("/proc/net/tcp6").read_text()
    places = {line.split()[1] for line in listening.splitlines() if line.split()[1].endswith(f":{port:04X}")
              and line.split()[3] == "0A"}  # fmt: skip
    assert places == {f"0100007F:{port:04X}"}


def test_pages_of_other_places_are_refused(server: Server):
    socket = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"
    for path, data in (("/", None), (socket, None), ("/_nicegui/client/none/upload/1", b"x")):
        asked = urllib.request.Request(server.place + path, data=data, headers={"Origin": "http://evil.example"})
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(asked, timeout=20)
        assert refused.value.code == 403
        refused.value.close()
    with urllib.request.urlopen(server.place, timeout=20) as page:
        assert "frame-ancestors 'none'" in page.headers["Content-Security-Policy"]
        assert not [name for name in page.headers if name.lower().startswith("access-control")]
