"""Four walks from the first visit to files for the machine: a 3-PTT, an arm, an unknown and a tie.

    python benchmarks/studio_walks.py [--shots DIR]

In the middle of each the page is loaded anew and the server is ended and started again: the session must be as it was.
Runs of the unknown and the tie are drawn by the virtual machine. What is downloaded is read by the command line.
"""

import argparse
import json
import re
import shutil
import subprocess
import tempfile
import time
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright
from studio_clicks import FLAGS, WAIT, start
from typer.testing import CliRunner

from ptt.commands.main import app

SIZES = ((1440, 900), (1024, 768), (720, 450), (390, 844))
DATA = Path(__file__).resolve().parents[1] / "data"
TIE = """seed = 7
[conditions]
cycles = 2
[drive]
scale_um_per_m = 180.0
[tracker]
rotation_mrad = [-0.03, -0.41, 0.08]
"""


@dataclass
class Walk:
    """One walk: its page, its server, where downloads and pictures go."""

    name: str
    page: Page
    folder: Path
    process: subprocess.Popen
    place: str
    shots: Path | None

    @property
    def title(self) -> Locator:
        """What the view that is seen says in large."""
        return self.page.locator(".st-panel.st-here .st-title").first

    def view(self, name: str) -> None:
        self.page.get_by_role("tab", name=name).click()
        expect(self.page.get_by_role("tab", name=name)).to_have_attribute("aria-selected", "true")

    def look(self, what: str) -> None:
        """Pictures at three sizes; nothing may be wider than the screen."""
        for width, height in SIZES if self.shots else SIZES[:1]:
            self.page.set_viewport_size({"width": width, "height": height})
            self.page.wait_for_timeout(700)
            assert self.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), (self.name, what, width)
            if self.shots:
                self.page.screenshot(path=self.shots / f"{self.name}-{what}-{width}.png")
        self.page.set_viewport_size({"width": SIZES[0][0], "height": SIZES[0][1]})

    def saved(self, act: Callable[[], None]) -> Path:
        with self.page.expect_download(timeout=WAIT) as waiting:
            act()
        path = self.folder / f"{self.name}-{waiting.value.suggested_filename}"
        waiting.value.save_as(path)
        return path

    def press(self, name: str, exact: bool = False) -> Callable[[], None]:
        return lambda: self.page.get_by_role("button", name=name, exact=exact).first.click()

    def restart(self) -> None:
        """Reload, then end the server, start it again on its port, and load the same address."""
        before = self.page.locator(".st-told").inner_text()
        title = self.title.inner_text()
        self.page.reload()
        expect(self.page.locator(".st-told")).to_have_text(before, timeout=WAIT)
        self.process.terminate()
        self.process.wait(30)
        self.process, place = start(self.folder, int(self.place.rsplit(":", 1)[1]))
        assert place == self.place
        self.page.goto(self.page.url)
        expect(self.page.locator(".st-told")).to_have_text(before, timeout=WAIT)
        expect(self.title).to_have_text(title, timeout=WAIT)


def main() -> None:
    """Walk all four and print a table."""
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--shots", type=Path)
    given = reader.parse_args()
    if given.shots:
        given.shots.mkdir(parents=True, exist_ok=True)
    print("| walk | verdict | taken along | s |\n| --- | --- | --- | ---: |")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        browser = tools.chromium.launch(executable_path=chromium, args=list(FLAGS))
        for name in ("three-ptt", "arm", "unknown", "tie"):
            _walk(name, browser, Path(folder), given.shots)
        browser.close()


def _walk(name: str, browser: Browser, folder: Path, shots: Path | None) -> None:
    began = time.monotonic()
    process, place = start(folder)
    page = browser.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True).new_page()
    page.set_default_timeout(WAIT)
    walk = Walk(name, page, folder, process, place, shots)
    try:
        page.goto(place)
        page.get_by_role("button", name="Load sample").wait_for()
        walk.look("first")
        _open(walk)
        page.locator(".st-finding:visible, .st-tie:visible").first.wait_for()
        title = walk.title.inner_text()
        walk.look("result")
        taken = _unknown(walk) if name == "unknown" else [_poses(walk)] if name == "tie" else []
        walk.restart()
        taken += _finish(walk)
        walk.look("finish")
    finally:
        walk.process.terminate()
        walk.process.wait(30)
        page.context.close()
    print(f"| {name} | {title} | {', '.join(taken)} | {time.monotonic() - began:.0f} |", flush=True)


def _open(walk: Walk) -> None:
    """The samples by their buttons, drawn runs through the files' boxes, the run first."""
    if walk.name in ("three-ptt", "arm"):
        walk.press("Try an arm" if walk.name == "arm" else "Try a sample")()
    else:
        run, machine = _drawn(walk)
        walk.page.locator(".st-drop-run input[type=file]").set_input_files(run)
        walk.page.locator(".st-drop-run.st-ready").wait_for()
        walk.page.locator(".st-drop-machine input[type=file]").set_input_files(machine)
        walk.page.get_by_text("ready to open").wait_for()
        walk.press("open the files")()
    walk.page.wait_for_url("**/result")


def _drawn(walk: Walk) -> tuple[Path, Path]:
    place = walk.folder / f"{walk.name}-files"
    if walk.name == "unknown":
        _verb("challenge", "new", place, "--level", "unknown", "--seed", 7)
        return place / "run.csv", place / "machine.toml"
    place.mkdir()
    machine = DATA / "sealed_one" / "machine.toml"
    (place / "rig.toml").write_text(f'machine = "{machine}"\n{TIE}')
    targets = DATA / "sealed_one" / "targets.csv"
    _verb("simulate", place / "rig.toml", targets, "--out", place / "run.csv")
    return place / "run.csv", machine


def _unknown(walk: Walk) -> list[str]:
    """The curve that the unknown follows becomes an effect."""
    expect(walk.page.get_by_role("button", name="Write this as an effect")).to_be_visible()
    walk.press("Write this as an effect")()
    walk.page.get_by_text(re.compile(r"class \w+")).first.wait_for()
    walk.look("effect")
    walk.page.keyboard.press("Escape")
    return ["effect"]


def _poses(walk: Walk) -> str:
    """A tie is said as one, and the poses that part it are downloaded."""
    expect(walk.page.get_by_text("cannot tell them apart").first).to_be_visible()
    saved = walk.saved(walk.press("Poses that tell them apart"))
    assert len(saved.read_text().splitlines()) > 3
    return "poses"


def _finish(walk: Walk) -> list[str]:
    """Add what was found, write it for a controller, take model and report along; the command line reads the model."""
    add = walk.page.get_by_role("button", name=re.compile("^(Add all|add .*)$")).first
    add.click()
    walk.page.locator(".st-told", has_not_text="no effects").wait_for()
    walk.view("Finish")
    model = walk.saved(walk.press("Model (machine.toml)"))
    run = next(walk.folder.glob("store/*/files/*.csv"))
    told = _verb("compare", _run_of(walk, run), "--model", model)
    assert told["rms_um"]["total"] > 0.0
    walk.page.wait_for_function("!document.querySelector('button[aria-label=\"undo\"]').disabled", timeout=WAIT)
    expect(walk.page.get_by_role("button", name="Write it")).to_be_enabled(timeout=WAIT)
    walk.press("Write it")()
    walk.page.get_by_role("button", name="Download").wait_for()
    export = walk.saved(walk.press("Download"))
    assert export.stat().st_size > 500 and (export.suffix != ".zip" or zipfile.ZipFile(export).testzip() is None)
    report = walk.saved(walk.press("Report (HTML)"))
    assert "<html" in report.read_text(encoding="utf-8")[:500]
    return ["model", "export", "report"]


def _run_of(walk: Walk, kept: Path) -> Path:
    key = walk.page.url.split("/s/")[1].split("/")[0]
    files = walk.folder / "store" / key / "files"
    return next((file for file in files.glob("*run*.csv")), kept)


def _verb(*words: object) -> dict:
    outcome = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


if __name__ == "__main__":
    main()
