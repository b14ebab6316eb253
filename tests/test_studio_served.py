"""The studio as a server of browsers: sessions, processes that calculate, and who is refused."""

import re
import urllib.error
import urllib.request
from pathlib import Path

import pandas as pd
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect
from studio_browser import (
    NEEDS_CHROMIUM,
    WAIT,
    Server,
    load_sample,
    open_files,
    show,
)
from studio_browser import browser as browser
from studio_browser import context as context
from studio_browser import page as page
from studio_browser import server as server
from studio_sample import DATA

pytestmark = NEEDS_CHROMIUM


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
    other.close()


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
