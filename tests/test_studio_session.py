"""The studio without a browser: its state, its jobs against the command line, its figures, its server's limits."""

import asyncio
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from studio_sample import MACHINE, RUN, fresh, silent
from studio_sample import added as added
from studio_sample import folder as folder
from studio_sample import here as here
from studio_sample import look as look

from ptt.errors import ModelError
from ptt.machine import parse_machine
from ptt.machine_schema import EffectEntry, ParameterEntry
from ptt.show.studio import jobs, ladder_figures
from ptt.show.studio.controller import Studio
from ptt.show.studio.looks import Look
from ptt.show.studio.page_finish import commands_of
from ptt.show.studio.page_model import ladder_of, words_of
from ptt.show.studio.results import Changed, Source
from ptt.show.studio.session import Session
from ptt.show.studio.snapshot import Rung, parameter_rows


def test_links_of_the_drawing_have_their_length(look: Look):
    ends = look.drawing.chains
    np.testing.assert_allclose(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2), 300.0, atol=1e-6)
    np.testing.assert_allclose(look.drawing.platform, ends[:, :, 1])
    along = (ends[:, :, 0] - look.drawing.rails[None, :, 0])[..., :2]
    np.testing.assert_allclose(along, 0.0, atol=1e-9)  # sliders sit on their upright rails


def test_add_undo_redo_switch_and_remove(added: Changed, look: Look):
    start = fresh(look)
    with_it = start.changed("add", ("backlash",), added)
    assert [entry.key for entry in with_it.effects] == ["backlash"]
    assert with_it.look is None and with_it.undone().look is look
    assert with_it.undone().now == start.now and with_it.undone().redone().now == with_it.now
    off = with_it.switched("backlash", False)
    assert parse_machine(off.text).effect == () and [e.key for e in off.effects] == ["backlash"]
    assert off.switched("backlash", True).text == with_it.text
    assert off.undone().text == with_it.text
    assert off.future == () and with_it.undone().changed("fit", (), added).future == ()
    with pytest.raises(ModelError):
        off.switched("windup", True)
    assert start.undone() is start and with_it.redone() is with_it


def test_an_effect_that_is_off_stays_through_other_changes(here: Path, added: Changed):
    off = fresh().changed("add", ("backlash",), added).switched("backlash", False)
    other = jobs.change(RUN, off.text, "add", ("homing-offset",), silent)
    both = off.changed("add", ("homing-offset",), other)
    assert {entry.key for entry in both.effects} == {"backlash", "homing-offset"}
    assert [entry.key for entry in parse_machine(both.text).effect] == ["homing-offset"]
    back = both.switched("backlash", True)
    own, first = (next(e for e in s.effects if e.name == "backlash") for s in (back, fresh().changed("add", (), added)))
    assert own == first


def test_ladder_and_commands_grow_with_the_steps(here: Path, added: Changed):
    one = fresh().changed("add", ("backlash",), added)
    two = one.changed("remove", ("backlash",), jobs.change(RUN, one.text, "remove", ("backlash",), silent))
    assert one.now is not None and two.now is not None
    assert [rung.words for rung in one.now.rungs] == ["as given", "+ backlash"]
    assert two.now.rungs[-1].words == "\N{MINUS SIGN} backlash" and not two.now.rungs[-1].helped
    assert one.now.rungs[-1].rms_um["total"] == added.data["steps"][-1]["rms_um"]["total"]
    assert two.now.commands == (
        "ptt add run.csv backlash --model machine.toml --out model1.toml",
        "ptt remove run.csv backlash --model model1.toml --out model2.toml",
    )


def in_tab(session: Session, folder: Path | None = None) -> Studio:
    """A tab without a browser and without a process that calculates."""
    studio = object.__new__(Studio)
    studio.session, studio.busy, studio.trouble, studio._epoch = session, None, "", 0
    studio._looking = asyncio.Lock()
    studio.folder = folder or Path()
    studio.tell = lambda topic: None  # type: ignore[method-assign]
    return studio


def test_a_switched_off_effect_leaves_no_held_out_figure(here: Path, added: Changed):
    start, compared = fresh(), jobs.compare(RUN, MACHINE, silent)
    rungs, noise = ladder_of(in_tab(start.remembering(compared=compared)))
    assert [rung.heldout_rms_um for rung in rungs] == [None]
    plain = compared.data["rms_um"]["total"]
    words = words_of(start, rungs[-1], noise, "total")
    assert f"{plain:.2f}" in words and "plain RMS; no held-out figure" in words and "switched off" not in words
    assert ladder_figures.ladder_figure(rungs, noise)["data"][1]["y"] == []

    with_it = start.changed("add", ("backlash",), added)
    rungs, noise = ladder_of(in_tab(with_it))
    assert re.match(
        r"Now [\d.]+\s.* held out; noise [\d.]+\N{NO-BREAK SPACE}.m$", words_of(with_it, rungs[-1], noise, "total")
    )

    off = with_it.switched("backlash", False)
    waiting = words_of(off, ladder_of(in_tab(off))[0][-1], noise, "total")
    assert waiting == "backlash off: the figures for that are being computed"
    off = off.remembering(compared=jobs.compare(RUN, off.text, silent))
    rungs, noise = ladder_of(in_tab(off))
    assert [rung.words for rung in rungs] == ["as given", "+ backlash", "backlash off"]
    words = words_of(off, rungs[-1], noise, "total")
    assert f"Now {plain:.2f}" in words and "plain RMS" in words and "switched off: backlash" in words
    drawn = ladder_figures.ladder_figure(rungs, noise)["data"]
    assert [len(trace["y"]) for trace in drawn] == [2, 2, 2, 1]


@pytest.mark.parametrize(
    ("step", "held_out", "helped", "words"),
    [
        ("+ windup", 4.0, True, ""),
        ("+ windup", 4.9, False, "this step may not have helped"),
        ("+ windup", 5.1, False, "this step did not help: the held-out error did not fall"),
        ("\N{MINUS SIGN} backlash", 9.0, False, "what this step removed is needed"),
        ("\N{MINUS SIGN} backlash", 5.0, True, ""),
        ("refit", 5.0, False, ""),
    ],
)
def test_a_step_that_did_not_help_is_said_to_be_what_it_is(here: Path, added: Changed, step, held_out, helped, words):
    session = fresh().changed("add", ("backlash",), added)
    figures = dict.fromkeys((*"xyz", "total"), 5.0)
    before, last = Rung("+ backlash", figures, figures), Rung(step, figures, figures | {"total": held_out}, helped)
    session = replace(session, now=replace(session.now, rungs=(before, last)))
    told = words_of(session, last, figures, "total")
    assert re.findall(r"\((.*)\)", told) == ([words] if words else [])


def test_commands_remove_what_is_switched_off_and_add_it_again(here: Path, added: Changed):
    off = fresh().changed("add", ("backlash",), added).switched("backlash", False)
    steps = (
        "ptt add run.csv backlash --model machine.toml --out model1.toml",
        "ptt remove run.csv backlash --model model1.toml --out model2.toml",
    )
    assert off.commands == steps and off.switched("backlash", True).commands == steps[:1]
    listed = commands_of(in_tab(off))
    assert listed[-1] == "ptt predict targets.csv --model model2.toml --out sliders.csv"
    assert any(line.startswith("#") for line in listed)
    both = off.changed("add", ("homing-offset",), jobs.change(RUN, off.text, "add", ("homing-offset",), silent))
    more = (*steps, "ptt add run.csv homing-offset --model model2.toml --out model3.toml")
    assert both.commands == more and both.now is not None and both.now.fitted == both.text
    assert both.switched("backlash", True).commands == (
        *more, "ptt add run.csv backlash --model model3.toml --out model4.toml"
    )  # fmt: skip
    again = off.changed("add", ("backlash",), added)
    assert again.text == added.model and again.commands[-1].startswith("ptt add run.csv backlash --model model2.toml")


def test_a_look_of_a_run_that_was_replaced_is_not_kept(look: Look):
    studio = in_tab(fresh())
    other = Session().opened(Source("other.csv"), MACHINE)

    async def work(words: str, job: str, *arguments: object, how: str = "asked") -> Look | None:
        studio.session = other  # meanwhile another run was opened
        return look if job == "look" else None

    studio.work = work  # type: ignore[method-assign]
    asyncio.run(studio.resume())
    assert studio.session == other and studio.session.look is None


def test_parameters_say_what_is_not_measured():
    entry = EffectEntry(
        name="windup",
        parameters={
            "height_mm": ParameterEntry(value=(0.1, 0.2), std=(0.01, 0.02), measured=(True, False)),
            "length_mm": ParameterEntry(value=3.0),
            "gap_mm": ParameterEntry(value=1.0, fixed=True),
        },
    )
    assert parameter_rows(entry) == [
        ("height_mm 1", 0.1, 0.01, ""),
        ("height_mm 2", 0.2, None, "by itself not measured by this data"),
        ("length_mm", 3.0, None, "searched"),
        ("gap_mm", 1.0, None, "held"),
    ]
