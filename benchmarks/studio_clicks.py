"""The page under many clicks: 200 adds and undos, none lost; and how long each thing takes from click to picture.

    python benchmarks/studio_clicks.py [--count 200] [--out table.md]

Starts a studio of its own on a free port, with sessions in a temporary folder, and drives Debian's Chromium.
"""

import argparse
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page, sync_playwright
from playwright.sync_api import TimeoutError as LostError

START = "import sys; from ptt.commands.main import main; sys.argv = ['ptt', *sys.argv[1:]]; main()"
FLAGS = ("--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WAIT = 120_000  # ms
LATE = 30.0  # s
# From the event of a click or a key to the end of the first frame that shows what is waited for, in the browser itself:
# a driver outside waits for a steady button first, and for its turn on a busy machine.
WATCH = """const watch = window.watch = {
  took: null, began: 0,
  until(seen, since = 0) { watch.took = null; watch.began = since;
    const look = () => { let there = false;
      try { there = watch.began > 0 && seen(); } catch { there = false; }
      there ? setTimeout(() => { watch.took = performance.now() - watch.began; }) : requestAnimationFrame(look); };
    requestAnimationFrame(look); },
  text: place => document.querySelector(place)?.innerText ?? '',
  here: view => document.querySelector(`.st-panel.st-here[data-view=${view}]`),
  seen: e => e && e.getClientRects().length > 0 && getComputedStyle(e).visibility === 'visible',
  solid: (view, part) => { const e = watch.here(view)?.querySelector(part), scene = e?._fullLayout?.scene?._scene;
    return scene && e.data.some(t => t.uid === 'errors') && watch.seen(e.querySelector('canvas')); },
  flat: (place, count) => { const e = document.querySelector(place);
    return watch.seen(e) && e.querySelectorAll('.points path, .bars path').length >= count; },
  picture: () => watch.text('.st-title') + JSON.stringify(document.querySelector('.st-machine').data
    .map(t => [t.uid, t.x.length, t.x[0], t.x.at?.(-1), t.intensity?.[0]])),
  arrows: () => JSON.stringify(document.querySelector('.st-machine').data.filter(t => t.uid === 'errors')
    .map(t => [t.x.length, t.x[0], t.intensity?.[0]])),
};
for (const kind of ['click', 'keydown'])
  addEventListener(kind, e => { if (!watch.began) watch.began = e.timeStamp; }, true);"""
SEEN = {
    "Machine": "watch.solid('Result', '.st-machine')",
    "Result": "watch.solid('Result', '.st-machine') && document.querySelector('.st-finding')",
    "Look": "watch.solid('Look', '.st-field') && watch.flat('.st-look .st-plot:not(.st-field)', 100)",
    "Model": "watch.here('Model') && watch.flat('.st-ladder', 1)",
    "Finish": "watch.here('Finish')?.innerText.includes('For the controller')",
    "why": "watch.flat('[role=dialog] .js-plotly-plot, dialog[open] .js-plotly-plot', 100)",
}


def main() -> None:
    """Drive the page and print the table."""
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--count", type=int, default=200)
    reader.add_argument("--out", type=Path)
    given = reader.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        process, place = start(Path(folder))
        try:
            chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
            browser = tools.chromium.launch(executable_path=chromium, args=list(FLAGS))
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.set_default_timeout(WAIT)
            lines = _walk(page, place, given.count)
            browser.close()
        finally:
            process.terminate()
            process.wait(20)
    text = "\n".join(lines)
    print(text)
    if given.out:
        given.out.write_text(f"{text}\n", encoding="utf-8")


def start(folder: Path, port: int = 0) -> tuple[subprocess.Popen, str]:
    """A studio of its own on a free port, its sessions in a folder: the process, and where it is."""
    log = folder / "log.txt"
    command = [
        sys.executable,
        "-c",
        START,
        "studio",
        "--port",
        str(port),
        "--no-show",
        "--store",
        str(folder / "store"),
    ]
    process = subprocess.Popen(
        command, stdout=log.open("w"), stderr=subprocess.STDOUT, env=os.environ | {"PYTHONUNBUFFERED": "1"}
    )
    for _ in range(600):
        if found := re.search(r"http://127\.0\.0\.1:\d+", log.read_text()):
            try:
                urllib.request.urlopen(found[0], timeout=10).close()
                return process, found[0]
            except OSError:
                pass
        time.sleep(0.1)
    raise SystemExit(log.read_text())


class Times:
    """What took how long on a page, s."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.took: dict[str, list[float]] = {}
        page.add_init_script(WATCH)

    def timed(self, what: str, act: Callable[[], object], seen: str, since: str = "0") -> None:
        """Act, wait in the browser until it is on the screen, and keep how long that took from the click on.

        Args:
            what: is timed.
            act: clicks or presses.
            seen: JavaScript, true once it is there.
            since: JavaScript, when the click was; 0 for the next one.
        """
        self.page.evaluate(f"watch.until(() => {seen}, {since}); null")
        act()
        self.page.wait_for_function("watch.took !== null", timeout=WAIT)
        self.took.setdefault(what, []).append(self.page.evaluate("watch.took") / 1e3)

    def loaded(self, what: str, act: Callable[[], object], seen: str) -> None:
        """The same of a page that is loaded: from its address on."""
        start = time.perf_counter()
        act()
        self.page.wait_for_function(seen, timeout=WAIT)
        self.took.setdefault(what, []).append(time.perf_counter() - start)

    def lines(self) -> list[str]:
        """A table."""
        head = ["| from click to picture | median s | worst s | times |", "| --- | ---: | ---: | ---: |"]
        rows = [(what, statistics.median(each), max(each), len(each)) for what, each in self.took.items()]
        return [*head, *(f"| {what} | {middle:.2f} | {worst:.2f} | {count} |" for what, middle, worst, count in rows)]


def _walk(page: Page, place: str, count: int) -> list[str]:
    times = Times(page)
    sample = page.get_by_role("button", name="Load sample")
    times.loaded("first page", lambda: page.goto(place), "document.body.innerText.includes('Try a sample')")
    page.wait_for_timeout(4000)  # a process has loaded the library meanwhile
    times.timed("sample: opened, the machine with its errors", sample.click, SEEN["Machine"])
    times.timed("sample: diagnosed, card shown", lambda: None, SEEN["Result"], since="watch.began")
    _tabs(times)
    late, lost, done = _adds(times, count)
    times.loaded("reload", page.reload, SEEN["Result"])
    return [f"{done} adds and undos: {late} seen after more than 30 s, {lost} lost", "", *times.lines()]


def _tabs(times: Times) -> None:
    """Each view, and the card of what was found, three times."""
    page = times.page
    for _ in range(3):
        for view in ("Look", "Model", "Finish", "Result"):
            times.timed(f"tab {view}", page.get_by_role("tab", name=view).click, SEEN[view])
    card = page.get_by_role("button", name="card of backlash")
    for _ in range(3):
        times.timed("why: this run's data with the fit", card.click, SEEN["why"])
        page.keyboard.press("Escape")
        page.wait_for_timeout(300)


def _adds(times: Times, count: int) -> tuple[int, int, int]:
    """Add and undo by turns: how many adds came late, how many never, how many were done.

    Every other undo follows its add at once, the others once the errors that the add leaves are drawn. An undo is
    there once title, figures and the picture of the machine are those from before the add.
    """
    page = times.page
    add = page.get_by_role("button", name="add backlash", exact=True)
    page.evaluate("watch.first = watch.picture(); watch.given = watch.arrows(); null")
    late = lost = 0
    for number in range(count):
        try:
            times.timed("add", add.click, "watch.text('.st-told').includes('bench, backlash')")
        except LostError:  # no more comes of this click
            lost += 1
            continue
        late += number > 0 and times.took["add"][-1] > LATE
        if drawn := bool(number % 2):
            arrows = "watch.arrows() !== watch.given"
            times.timed("add, diagnosed again", lambda: None, arrows, since="watch.began")
        back = "watch.text('.st-told').includes('no effects') && watch.picture() === watch.first"
        times.timed("undo of what is drawn" if drawn else "undo", lambda: page.keyboard.press("Control+z"), back)
    return late, lost, count


if __name__ == "__main__":
    main()
