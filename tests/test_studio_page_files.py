"""Files in the page of the studio: bad ones, mistaken ones, those of a later run, and a long one."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from playwright.sync_api import Page, expect
from studio_browser import (
    NEEDS_CHROMIUM,
    WAIT,
    check_layout,
    load_sample,
    open_files,
    show,
)
from studio_browser import browser as browser
from studio_browser import context as context
from studio_browser import page as page
from studio_browser import server as server
from studio_sample import DATA
from typer.testing import CliRunner

from ptt.commands.main import app

pytestmark = NEEDS_CHROMIUM


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
    expect(page.locator(".st-drop-run")).to_contain_text("bad.csv was not opened; drop another", timeout=WAIT)
    expect(page.locator(".st-drop-run.st-ready")).to_have_count(0)
    expect(page.get_by_text("ready to open")).to_have_count(0)
    page.get_by_role("button", name="dismiss").click()
    expect(alert).to_be_hidden()


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
