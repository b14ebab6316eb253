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

from playwright.sync_api import Page, expect, sync_playwright

START = "import sys; from ptt.commands.main import main; sys.argv = ['ptt', *sys.argv[1:]]; main()"
FLAGS = ("--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WAIT = 120_000  # ms
LATE = 30.0  # s


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

    def timed(self, what: str, act: Callable[[], object], seen: Callable[[], object]) -> None:
        """Act, wait until it is seen, and keep how long that took."""
        start = time.perf_counter()
        act()
        seen()
        self.took.setdefault(what, []).append(time.perf_counter() - start)

    def shown(self, selector: str) -> Callable[[], object]:
        """What waits for a thing to be seen."""
        return lambda: self.page.locator(selector).first.wait_for(timeout=WAIT)

    def lines(self) -> list[str]:
        """A table."""
        head = ["| from click to picture | median s | worst s | times |", "| --- | ---: | ---: | ---: |"]
        rows = [(what, statistics.median(each), max(each), len(each)) for what, each in self.took.items()]
        return [*head, *(f"| {what} | {middle:.2f} | {worst:.2f} | {count} |" for what, middle, worst, count in rows)]


def _walk(page: Page, place: str, count: int) -> list[str]:
    times = Times(page)
    sample = page.get_by_role("button", name="Load sample")
    times.timed("first page", lambda: page.goto(place), sample.wait_for)
    page.wait_for_timeout(4000)  # a process has loaded the library meanwhile
    times.timed("sample: run and machine opened", sample.click, lambda: page.wait_for_url("**/result"))
    times.timed("sample: diagnosed, card shown", lambda: None, times.shown(".st-finding"))
    _tabs(times)
    late, lost, done = _adds(times, count)
    times.timed("reload", page.reload, times.shown(".st-finding"))
    return [f"{done} adds and undos: {late} seen after more than 30 s, {lost} lost", "", *times.lines()]


def _tabs(times: Times) -> None:
    """Each view, and the card of what was found, three times."""
    page = times.page
    views = {
        "Look": ".st-field canvas",
        "Model": ".st-ladder .main-svg",
        "Finish": "text=For the controller",
        "Result": ".st-finding",
    }
    for _ in range(3):
        for view, selector in views.items():
            times.timed(f"tab {view}", page.get_by_role("tab", name=view).click, times.shown(selector))
    card = page.get_by_role("button", name="card of backlash")
    for _ in range(3):
        times.timed("why: this run's data with the fit", card.click, times.shown("[role=dialog] .main-svg"))
        page.keyboard.press("Escape")
        page.wait_for_timeout(300)


def _adds(times: Times, count: int) -> tuple[int, int, int]:
    """Add and undo by turns: how many adds came late, how many never, how many were done."""
    page = times.page
    add = page.get_by_role("button", name="add backlash", exact=True)
    with_it, without = (page.locator(".st-told", has_text=words) for words in ("bench, backlash", "no effects"))
    late = lost = 0
    for number in range(count):
        start = time.perf_counter()
        add.click()
        try:
            expect(with_it).to_be_visible(timeout=WAIT)
        except AssertionError:  # no more comes of this click
            lost += 1
            continue
        took = time.perf_counter() - start
        late += number > 0 and took > LATE
        times.took.setdefault("add", []).append(took)
        times.timed("undo", lambda: page.keyboard.press("Control+z"), lambda: without.wait_for(timeout=WAIT))
    return late, lost, count


if __name__ == "__main__":
    main()
