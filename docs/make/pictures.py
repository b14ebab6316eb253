"""Take the pictures of page and report in data/pictures anew: `python docs/make/pictures.py`; needs Chromium."""

import shutil
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright
from typer.testing import CliRunner

from ptt.commands.main import app

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
from studio_clicks import FLAGS, WAIT, start  # noqa: E402

SAMPLE, PICTURES = ROOT / "data" / "sealed_three", ROOT / "data" / "pictures"


def main() -> None:
    """Take both."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        browser = tools.chromium.launch(executable_path=chromium, args=list(FLAGS))
        _report(browser, Path(folder))
        _studio(browser, Path(folder))
        browser.close()


def _report(browser: Browser, folder: Path) -> None:
    """The first screen of a report on the sample with three faults."""
    out = folder / "report.html"
    words = ["report", str(SAMPLE / "run.csv"), "--model", str(SAMPLE / "machine.toml"), "--out", str(out)]
    outcome = CliRunner().invoke(app, words)
    assert outcome.exit_code == 0, outcome.stderr
    page = browser.new_page(viewport={"width": 1100, "height": 900})
    page.goto(out.as_uri())
    page.screenshot(path=PICTURES / "report.png")
    page.close()


def _studio(browser: Browser, folder: Path) -> None:
    """The result of the same sample on the page."""
    process, place = start(folder)
    try:
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.goto(place)
        page.get_by_role("button", name="Try a sample").click(timeout=WAIT)
        page.locator(".st-finding").first.wait_for(timeout=WAIT)
        page.mouse.move(5, 890)
        page.wait_for_timeout(4000)  # until the machine is drawn
        page.screenshot(path=PICTURES / "studio.png")
    finally:
        process.terminate()
        process.wait(30)


if __name__ == "__main__":
    main()
