"""A browser before the studio: its server, what is clicked, and scripts that say what is wrong with a layout.

A fixture is imported under its own name (`page as page`): no line calls it, pytest finds it in the test file.
"""

import os
import re
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

START = "import sys; from ptt.commands.main import main; sys.argv = ['ptt', *sys.argv[1:]]; main()"
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
NEEDS_CHROMIUM = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium is installed (Debian: apt-get install chromium)"
)
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)  # fmt: skip
WAIT = 150_000  # ms: a busy machine may be slow, nothing here measures it
AXE = files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
RULES = """async () => (await axe.run({exclude: ['#q-loading-bar']},
    {runOnly: ['wcag2a', 'wcag2aa', 'wcag21aa', 'best-practice']}))
  .violations.flatMap(found => found.nodes.map(node => `${found.id}: ${node.html.slice(0, 160)}`))"""
SIZES = ((1440, 900), (1024, 768), (720, 450), (390, 844))  # the third is the first at 200 %
OVERLAPS = """() => {
  const seen = element => { const box = element.getBoundingClientRect();
    return box.width > 0 && box.height > 0 && getComputedStyle(element).visibility !== 'hidden' && box; };
  const found = [...document.querySelectorAll(
    'button, .q-field, .q-tab, .q-toggle, .st-drop, .st-head, .st-verdict, .js-plotly-plot, .st-box > .st-note')]
    .map(element => [element, seen(element)]).filter(([, box]) => box);
  const bad = [];
  for (const [one, a] of found) for (const [other, b] of found)
    if (one !== other && !one.contains(other) && !other.contains(one)
        && a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1)
      bad.push(`${one.className} ${one.innerText} / ${other.className} ${other.innerText}`);
  if (document.documentElement.scrollWidth > innerWidth) bad.push('the page is wider than the screen');
  return bad; }"""
BEYOND = """() => { const wide = document.documentElement.clientWidth, found = [];
  const rolls = e => ['auto', 'scroll'].includes(getComputedStyle(e).overflowX) && e.scrollWidth > e.clientWidth;
  for (const e of document.querySelectorAll('.st-panel.st-here *, header *, .st-status *')) {
    const box = e.getBoundingClientRect(); let at = e.parentElement;
    if (box.width < 2 || getComputedStyle(e).visibility === 'hidden') continue;
    while (at && !rolls(at)) at = at.parentElement;
    if (!at && (box.right > wide + 1 || box.left < -1)) found.push(e.outerHTML.slice(0, 120)); }
  return found; }"""
COVERED = """() => { const found = [], kind = 'label, .q-field, .q-slider, .q-toggle, .q-btn';
  for (const e of document.querySelectorAll('button, input:not([type=file]), [role=switch], [role=slider]')) {
    if (!e.getClientRects().length || getComputedStyle(e).visibility === 'hidden') continue;
    if (e.disabled || e.ariaDisabled === 'true') continue;
    e.scrollIntoView({block: 'center', inline: 'center'});
    const box = e.getBoundingClientRect();
    const at = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    if (!at || !(e.contains(at) || at.contains(e) || (at.closest(kind) && at.closest(kind) === e.closest(kind))))
      found.push(`${e.outerHTML.slice(0, 120)} under ${at?.outerHTML.slice(0, 120)}`); }
  scrollTo(0, 0); document.querySelectorAll('.st-panel.st-here, .st-scroll').forEach(e => { e.scrollTop = 0; });
  return found; }"""
NAMELESS = """() => [...document.querySelectorAll('button, input, [role=tab], [role=img], [role=combobox]')]
  .filter(e => e.getClientRects().length && !(e.ariaLabel || e.innerText.trim() || e.getAttribute('aria-label')
    || (e.labels && [...e.labels].some(l => l.innerText.trim())) || e.closest('label')?.innerText.trim()
    || e.closest('[aria-label]')))
  .map(e => e.outerHTML.slice(0, 200))"""


@dataclass(frozen=True)
class Server:
    """A running studio: where it is, and its process."""

    place: str
    process: subprocess.Popen

    def workers(self) -> set[int]:
        """Its processes that calculate."""
        listed = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return {int(pid) for pid in listed if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()}

    def spent(self, workers: set[int]) -> float:
        """Processor time of those of them that are there, s."""
        stats = [Path(f"/proc/{pid}/stat") for pid in workers & self.workers()]
        return sum(sum(map(int, stat.read_text().split()[13:15])) for stat in stats) / os.sysconf("SC_CLK_TCK")


def wait_for(process: subprocess.Popen, log: Path) -> str:
    for _ in range(600):
        found = re.search(r"http://127\.0\.0\.1:\d+", log.read_text())
        assert process.poll() is None, log.read_text()
        if found:
            try:
                urllib.request.urlopen(found[0], timeout=10).close()
                return found[0]
            except urllib.error.URLError:
                pass
        time.sleep(0.1)
    raise AssertionError(f"the server did not start: {log.read_text()}")


RUNNING: list[tuple[Server, Path]] = []


@pytest.fixture(scope="module")
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One for all files of a process: as a fixture that is imported it would be another one in each of them."""
    if not RUNNING:
        RUNNING.append(start(tmp_path_factory.mktemp("server") / "log.txt"))
        request.session.addfinalizer(stop)
    running, log = RUNNING[0]
    yield running
    assert "Traceback" not in log.read_text(), log.read_text()


def start(log: Path) -> tuple[Server, Path]:
    # NiceGUI serves otherwise where it finds itself in a test.
    own = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")} | {
        "PYTHONUNBUFFERED": "1"
    }
    command = [sys.executable, "-c", START, "studio", "--port", "0", "--no-show", "--store", str(log.parent / "store")]
    with log.open("w") as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, env=own, cwd=log.parent)
    try:
        return Server(wait_for(process, log), process), log
    except BaseException:
        process.kill()
        process.wait()
        raise


def stop() -> None:
    running, log = RUNNING.pop()
    running.process.terminate()
    running.process.wait(20)
    assert "Traceback" not in log.read_text(), log.read_text()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as tools:
        started = tools.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS), headless=True)
        yield started
        started.close()


@pytest.fixture(scope="module")
def context(browser: Browser) -> Iterator[BrowserContext]:
    """One for all pages of a file, which then have its scripts in their cache; a page has a session of its own."""
    made = browser.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True)
    made.set_default_timeout(WAIT)
    yield made
    made.close()


@pytest.fixture
def page(context: BrowserContext, server: Server) -> Iterator[Page]:
    opened = context.new_page()
    opened.goto(server.place)
    yield opened
    opened.close()


def load_sample(page: Page) -> None:
    page.get_by_role("button", name="Load sample").click()
    expect(page.get_by_role("tab", name="Result")).to_have_attribute("aria-selected", "true", timeout=WAIT)
    expect(page.get_by_text(re.compile(r"error 70.[5-9]\s.m rms"))).to_be_visible(timeout=WAIT)


def open_files(page: Page, run: Path, machine: Path) -> None:
    """Stage both, the run first, and open them with the one button."""
    show(page, "Load")
    page.locator(".st-drop-run input[type=file]").set_input_files(run)
    expect(page.locator(".st-drop-run.st-ready")).to_contain_text(f"{run.name} is here", timeout=WAIT)
    page.locator(".st-drop-machine input[type=file]").set_input_files(machine)
    expect(page.get_by_text("ready to open")).to_be_visible(timeout=WAIT)
    page.get_by_role("button", name="open the files").click()


def show(page: Page, view: str) -> None:
    page.get_by_role("tab", name=view).click()
    expect(page.get_by_role("tab", name=view)).to_have_attribute("aria-selected", "true", timeout=WAIT)


def saved(page: Page, button: str, path: Path) -> Path:
    with page.expect_download(timeout=WAIT) as waiting:
        page.get_by_role("button", name=button).click()
    waiting.value.save_as(path)
    return path


def settled(page: Page, script: str) -> list[str]:
    """What a script objects to once pictures have taken up a new size and colours have faded over."""
    for _ in range(20):
        if not (found := page.evaluate(script)):
            break
        page.wait_for_timeout(250)
    return found


def check_layout(page: Page, view: str) -> None:
    """At all sizes nothing overlaps, sticks out or covers a control, and everything has a name; axe at the smallest."""
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(100)
        assert settled(page, OVERLAPS) == [], (view, width)
        assert page.evaluate(NAMELESS) == [], (view, width)
        assert width > 720 or settled(page, BEYOND) == [], (view, width)
        assert width > 720 or page.evaluate(COVERED) == [], (view, width)
    page.evaluate(AXE)
    assert settled(page, RULES) == [], view
    page.set_viewport_size({"width": 1440, "height": 900})
