"""The studio in a browser: headless Chromium against a server of its own."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from studio_browser import (
    NEEDS_CHROMIUM,
    RULES,
    WAIT,
    check_layout,
    load_sample,
    saved,
    settled,
    show,
)
from studio_browser import browser as browser
from studio_browser import context as context
from studio_browser import page as page
from studio_browser import server as server
from studio_sample import DATA, verb

pytestmark = NEEDS_CHROMIUM

HIDDEN = "Resize must be passed a displayed plot"  # plotly, of a dialog that was just closed
VIEWS = ("Load", "Result", "Look", "Model", "Finish", "Again")

CONTROLS = """() => { window.wanted = [...document.querySelectorAll(
    'button, input:not([type=file]), [role=switch], [role=tab]')].filter(e => e.getClientRects().length && !e.disabled
    && e.getAttribute('aria-disabled') !== 'true' && getComputedStyle(e).visibility !== 'hidden');
  return wanted.length; }"""
MISSED = """() => wanted.filter(e => e.role !== 'tab' || e.ariaSelected === 'true')
  .filter(e => ![...reached].some(r => r === e || r.contains(e) || e.contains(r)))
  .map(e => e.outerHTML.slice(0, 160))"""


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
