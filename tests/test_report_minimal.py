"""The report of a bare drawing and of an arm, and names of data that would be tags."""

import re
from dataclasses import replace

import numpy as np
import pytest
from report_page import Page
from report_page import minimal as minimal

from ptt.effects import library
from ptt.effects.bench import sample_machine
from ptt.effects.cards import card_of
from ptt.errors import InputError
from ptt.run.table import make_table
from ptt.run.viewing import build_view
from ptt.show.card.words import pretty
from ptt.show.report.contents import Contents
from ptt.show.report.gather import gather
from ptt.show.report.html import render
from ptt.show.report.sections import sections_of
from ptt.show.report.source import MadeOf
from ptt.show.report.words import words_of

HOSTILE = "<script>alert('x')</script>\"><img src=http://evil.example/x>"


@pytest.fixture(scope="module")
def mild(minimal: Contents) -> Page:
    """Its page."""
    return Page(render(minimal))


def test_minimal_model_says_what_is_not_there(minimal: Contents, mild: Page) -> None:
    page = mild
    assert page.faults == [] and minimal.bare and minimal.given.diagnosis is None
    assert "too few for a verdict" in minimal.given.why_not
    assert "The noise floor is unknown" in page.text and "No verdict" in page.text
    assert "The model has no history" in page.text and "No compensator was given" in page.text
    assert "Not computed: the model has no effects and no network" in page.text
    assert "no pose was measured twice" in page.text
    assert "The readings did not come from files" in page.text
    assert minimal.to_dict()["diagnose"] == {"drawing": None, "model": None}


def test_hostile_names_are_words_when_written_from_a_table_and_a_machine(minimal: Contents, mild: Page) -> None:
    table = minimal.problem.table
    table = table.replace(
        run_label=(HOSTILE,), source=HOSTILE, name=np.full(table.rows, HOSTILE), extra={HOSTILE: table.name}
    )
    spec = minimal.file.machine.model_copy(update={"name": HOSTILE})
    source = MadeOf(names={"run": (HOSTILE,)})
    contents = gather(table, replace(minimal.file, machine=spec), source)
    page = Page(render(contents))
    assert page.faults == [] and sorted(set(page.tags)) == sorted(set(mild.tags))
    assert all(one.startswith(("#", "data:image/png;base64,")) for one in page.addresses)
    assert page.text.count("<script>alert('x')</script>") >= 4
    assert [section.key for section in sections_of(contents)][:3] == ["summary", "data", "error"]


def test_serial_arm() -> None:
    file = sample_machine("serial")
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.01}))
    random = np.random.default_rng(3)
    command = random.uniform(-0.8, 0.8, (40, len(file.machine.joint)))
    table = make_table(None, command, joint_prefix="q")
    table = table.replace(measured=build_view(file, table).p.numpy() * 1.0002 + random.normal(0.0, 0.01, (40, 3)))
    contents = gather(table, file)
    page = Page(render(contents))
    assert page.faults == [] and "serial arm" in page.text and "\N{MICRO SIGN}rad" in page.text
    assert contents.given.comparison.rows == 40
    # An arm has no sliders and legs: its effects are told in an arm's words.
    assert "Its signature: " in page.text
    told = page.text.rpartition("What is missing")[2].partition("The ladder")[0].replace("the sliders or joints", "")
    assert not re.findall("slider|the leg that|screw", told)


def test_moving_pictures_embed_plotly_once(minimal: Contents) -> None:
    text = render(minimal, interactive=True)
    page = Page(text)
    assert page.faults == [] and text.count("plotly.js v") == 1
    assert page.tags.count("script") == 3 and not any(one.startswith("http") for one in page.addresses)
    assert len(text) > 1_000_000 and "img" in page.tags


def test_words_in_chinese_come_from_one_file(minimal: Contents) -> None:
    say = words_of("zh")
    html = render(minimal, language="zh", say=say)
    page = Page(html)
    assert re.search(r"<td[^>]*>x_meas</td>\s*<td[^>]*>读数 x</td>", html)  # a title stays as the file has it
    assert (
        page.faults == []
        and "误差报告" in page.text
        and "测量内容" in page.text
        and "What was measured" not in page.text
    )
    assert (
        say("Slider 2 loses 38 \N{MICRO SIGN}m on reversal: backlash.")
        == "滑块 2 反向时丢失 38 \N{MICRO SIGN}m：反向间隙。"
    )
    cures = [f"raise the reversal compensation of slider {slider} by {um} um" for slider, um in ((1, 55), (3, 43))]
    assert say(" and ".join(cures)) == "将滑块 1 的反向补偿增加 55 um；将滑块 3 的反向补偿增加 43 um"
    lost = say("Sliders 1, 2 and 3 lose 55, 16 and 43 um on reversal: backlash.")
    assert lost == "滑块 1、2、3 反向时丢失 55、16、43 um：反向间隙。"
    mended = [pretty(card_of(effect()).remedy.rstrip(".")) for effect in library().values()]
    cards = [card_of(effect()) for effect in library().values()]
    keys = ("cause", "fingerprint", "arm_cause", "arm_fingerprint", "arm_remedy")
    told = [getattr(card, key) for card in cards for key in keys]
    mended += [pretty(words.rstrip(".")) for words in told if words]
    assert [words for words in mended if say(words) == words] == []
    assert words_of("en")("In short") == "In short"
    with pytest.raises(InputError, match="take one of en, zh"):
        words_of("xx")
