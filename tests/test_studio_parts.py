"""Parts of the studio by themselves: sessions on disk, who is let in, shared processes, the card, ghosts, columns."""

import json
import pickle
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest
from studio_sample import DATA, MACHINE, OWNER, RUN, silent
from studio_sample import folder as folder
from studio_sample import here as here

from ptt.challenge.challenge import open_challenge
from ptt.errors import SetupError
from ptt.machine import parse_machine
from ptt.show.card.bar import bar_html, parts_of_bar
from ptt.show.card.result import card_of_diagnosis
from ptt.show.card.scene import legs_at_fault
from ptt.show.card.words import length
from ptt.show.studio import jobs
from ptt.show.studio.controller import Studio
from ptt.show.studio.figures_again import error_figure, pair_figure, value_figure
from ptt.show.studio.later import date_in
from ptt.show.studio.machine_figure import machine_figure
from ptt.show.studio.opening import open_both
from ptt.show.studio.page import told_of
from ptt.show.studio.page_against import AgainstPicture
from ptt.show.studio.page_look import first_of
from ptt.show.studio.page_model import ladder_of
from ptt.show.studio.results import Diagnosed, Source, Trained
from ptt.show.studio.session import Session
from ptt.show.studio.store import SessionStore


@pytest.fixture(scope="module")
def diagnosed(folder: Path) -> Diagnosed:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return jobs.diagnose(RUN, MACHINE, silent)


def sealed_gaps_um() -> list[float]:
    """What was hidden in the sample, as its seal says."""
    truth = open_challenge(DATA).drawn.truth
    return [1e3 * value for value in truth["backlash"]["backlash_mm"]]


def test_a_session_is_taken_up_as_it_was(here: Path, diagnosed: Diagnosed, tmp_path: Path):
    look = jobs.look(RUN, MACHINE, silent)
    added = jobs.change(RUN, MACHINE, "add", ("backlash",), silent)
    session = Session().opened(RUN, MACHINE).remembering(look=look, diagnosed=diagnosed)
    session = session.changed("add", ("backlash",), added).switched("backlash", False).undone()
    session = session.remembering(trained=Trained({"share": 0.5}, b"zip"))
    place = SessionStore(tmp_path).fresh(OWNER)
    place.save(session)
    again = SessionStore(tmp_path).find(place.key, OWNER)
    assert again is not None
    back = again.load()
    assert (back.source, back.now, back.past, back.future) == (
        session.source,
        session.now,
        session.past,
        session.future,
    )
    assert back.undone().diagnosis == diagnosed and back.training == session.training
    shown = back.undone().look
    assert shown is not None
    np.testing.assert_array_equal(shown.residual, look.residual)
    assert (
        shown.understood == look.understood
        and shown.column_rows == look.column_rows
        and shown.views.keys() == look.views.keys()
    )


def test_a_mistaken_set_up_is_said_with_its_proof_and_mended(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    frame["z_meas"] = (-frame["z_meas"].astype(float)).astype(str)
    frame.to_csv("mirrored.csv", index=False)
    source = Source("mirrored.csv")
    with pytest.raises(SetupError) as met:
        jobs.look(source, MACHINE, silent)
    assert [finding.mistake for finding in met.value.check.sure] == ["axis-sign"]
    mended, machine = jobs.mend(source, MACHINE, silent)
    assert mended.run == "mended.csv" and parse_machine(machine).machine == parse_machine(MACHINE).machine
    rms = float(np.sqrt(np.mean(jobs.look(mended, machine, silent).size_um ** 2)))
    assert rms == pytest.approx(float(np.sqrt(np.mean(jobs.look(RUN, MACHINE, silent).size_um ** 2))), rel=1e-3)
    assert jobs.look(replace(source, anyway=True), MACHINE, silent).setup[0]["mistake"] == "axis-sign"


def test_a_run_too_short_for_any_variable_is_shown_without_the_picture_of_the_run_before(here: Path):
    """Five readings are fewer than are held against a variable: Look and Model once failed, with nothing drawn."""
    from nicegui import Client
    from nicegui.page import page

    lines = (DATA / "run.csv").read_text(encoding="utf-8").splitlines()
    (here / "few.csv").write_text("\n".join(lines[:6]) + "\n", encoding="utf-8")
    whole, few = (jobs.look(source, MACHINE, silent) for source in (RUN, Source("few.csv")))
    assert not few.contexts
    with Client(page("/few")):
        against = AgainstPicture(lambda: None, "residual against a variable")
        for look in (whole, few):
            against.offer(look, *first_of(Session().opened(RUN, MACHINE).remembering(look=look), look))
            assert against.draw(look, {}, []) == bool(look.contexts) == bool(against.plot.figure["data"])


def test_the_card_says_side_size_cure_and_how_sure(diagnosed: Diagnosed):
    card = diagnosed.card
    assert (card["verdict"], len(card["findings"])) == ("missing", 1)
    (finding,) = card["findings"]
    values = {value["joint"]: value for value in finding["values"]}
    for joint, truth in enumerate(sealed_gaps_um(), 1):
        value = values[joint]
        assert value["unit"] == "\N{MICRO SIGN}m" and abs(value["size"] - truth) < 5.0 * value["error"] + 0.5
        assert "loses" in value["text"] and value["who"] == f"slider {joint}" and value["side"] == "on reversal"
    assert "raise the reversal compensation of slider" in finding["cure"] and finding["tie"] == ""
    assert finding["probability"] > 0.9 and " um" not in json.dumps(card)
    parts = parts_of_bar(card)
    assert sum(size for _, size, _ in parts) == pytest.approx(card["error_um"], rel=0.02)
    assert parts[0][0] == "left (noise)" and parts[0][1] == card["left_um"] < card["noise_um"]
    assert "backlash" in bar_html(card)
    unknown = parts_of_bar({"error_um": 50.0, "left_um": 20.0, "noise_um": 4.0, "findings": card["findings"]})
    assert [part[:2] for part in unknown[:2]] == [("noise", 4.0), ("without a name", 16.0)]


def test_the_card_says_that_an_unknown_may_do_a_part_of_what_is_named(here: Path, diagnosed: Diagnosed):
    opened, found = open_both(RUN, MACHINE), pickle.loads(diagnosed.whole)
    sure = card_of_diagnosis(found, opened.problem).words
    chances = {"missing": 0.78, "unknown": 0.22, "nothing-missing": 0.0}
    doubtful = card_of_diagnosis(replace(found, verdict_probability=chances), opened.problem).words
    said = "There is a 22% probability that part of this is something that no known effect describes."
    assert said in doubtful and doubtful.replace(f" {said}", "") == sure


def test_a_report_from_the_page_diagnoses_nothing_anew(
    here: Path, diagnosed: Diagnosed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    session = Session().opened(RUN, MACHINE).remembering(diagnosed=diagnosed)
    assert session.diagnosis_of_drawing is diagnosed
    added = session.changed("add", ("backlash",), jobs.change(RUN, MACHINE, "add", ("backlash",), silent))
    assert added.diagnosis is None and added.diagnosis_of_drawing is diagnosed
    anew = jobs.report(RUN, MACHINE, None, b"", b"", silent).decode()
    monkeypatch.setattr("ptt.show.report.gather.diagnose_run", lambda *of, **more: pytest.fail("diagnosed again"))
    handed = jobs.report(RUN, MACHINE, None, diagnosed.whole, b"", silent).decode()
    clock = re.compile(r"\d\d:\d\d(:\d\d)?")
    assert clock.sub("", handed) == clock.sub("", anew)
    # What is on a disk could run where it is unpacked: none of it gets there.
    place = SessionStore(tmp_path).fresh(OWNER)
    place.save(session)
    kept = place.load().diagnosis
    assert kept is not None and kept.whole == b"" and kept.data == diagnosed.data


def test_one_thing_has_one_number_on_the_page(here: Path, diagnosed: Diagnosed):
    """Head line, ladder and card of a diagnosed model say the same; the comparison has another frame and more rows."""
    compared = jobs.compare(RUN, MACHINE, silent)
    session = Session().opened(RUN, MACHINE).remembering(compared=compared)
    studio = cast(Studio, SimpleNamespace(session=session))
    assert f"error {length(compared.data['rms_um']['total'])} rms" in told_of(studio)
    studio.session = session.remembering(diagnosed=diagnosed)
    assert told_of(studio).endswith(f"error {length(diagnosed.card['error_um'])} rms")
    assert ladder_of(studio)[0][-1].rms_um["total"] == diagnosed.card["error_um"] != compared.data["rms_um"]["total"]
    stepped = replace(studio.session, past=(studio.session.now,))
    assert session.began_um is None and stepped.began_um["total"] == diagnosed.card["error_um"]


def test_a_later_run_is_held_beside_the_first_and_by_date(here: Path):
    """A tenth of every error is left: nine tenths fewer on each axis, and a tenth of each gap."""
    frame = pd.read_csv("run.csv").iloc[:100]
    frame.to_csv("first.csv", index=False)
    for axis in "xyz":
        frame[f"{axis}_meas"] = frame[f"{axis}_cmd"] + 0.1 * (frame[f"{axis}_meas"] - frame[f"{axis}_cmd"])
    frame.to_csv("later.csv", index=False)
    gaps = ", ".join(f"{1e-3 * gap:.5f}" for gap in sealed_gaps_um())
    values = f"gap_mm = {{ value = [{gaps}], std = [1e-4, 2e-4, 1e-4] }}"
    model = f'{MACHINE}\n[[effect]]\nname = "backlash"\n[effect.parameters]\n{values}\n'
    found = jobs.again(Source("first.csv"), model, "2026-01-10", [(Source("later.csv"), "2026-02-10")], silent)
    fall = found["pair"]["reduction_percent"]
    assert [fall[axis] for axis in ("x", "y", "z", "total")] == pytest.approx([90.0] * 4, abs=0.05)
    assert found["recheck"]["verdict"] == "changed" and found["recheck"]["changed"]
    shown = [value for value in found["months"]["values"] if "gap" in value["label"]]
    assert len(shown) == 3 and all(value["days"] == ["2026-01-10", "2026-02-10"] for value in shown)
    for value in shown:
        assert value["value"][1] == pytest.approx(0.1 * value["value"][0], abs=0.5)
    for when in ("before", "after"):
        drawn = pair_figure(found["pair"], when)
        figure = go.Figure(drawn["data"], drawn["layout"])
        assert figure.data[1].marker.cmin == 0.0
    drawn = json.dumps([error_figure(found["months"]["history"]), *map(value_figure, shown)])
    assert "\\u00b5m" in drawn and "um]" not in drawn

    session = replace(Session().opened(RUN, MACHINE), first="2026-01-10", later=(("later.csv", "2026-02-10"),))
    place = SessionStore(here / "kept").fresh(OWNER)
    place.save(session)
    assert (place.load().first, place.load().later) == (session.first, session.later)
    assert date_in("mill 2026-03-15 b.csv") == "2026-03-15" and date_in("20260315.csv") == "2026-03-15"
    assert date_in("run 2026-13-45.csv") == date_in("run.csv")


def test_the_fit_goes_through_this_runs_data(diagnosed: Diagnosed):
    fit = diagnosed.fits["backlash"]
    data, through = np.asarray(fit["data_um"]), np.asarray(fit["fit_um"])
    noise = diagnosed.card["noise_um"]
    assert np.std(data - through) < 1.5 * noise < 0.5 * np.std(data)
    number = int(fit["labels"][1].split()[1])
    gap = sealed_gaps_um()[number - 1]
    assert np.ptp(through) == pytest.approx(gap, rel=0.7)  # the frame takes a part of it


def test_labels_of_legs_lie_above_and_below_by_turns_and_have_few_lines(diagnosed: Diagnosed, here: Path):
    look = jobs.look(RUN, MACHINE, silent)
    values = [{"who": f"slider {leg}", "size": 10.0, "error": 1.0, "unit": "um"} for leg in (1, 2, 3, 3, 3, 3)]
    ghost = {"shift": diagnosed.ghosts["shift"]["backlash"], "at": 0, "times": 1.0, "values": values}
    scene = machine_figure(look, 0, scale=1.0, ghost=ghost)["layout"]["scene"]
    labels = {label["text"].split("<br>")[0]: label for label in scene["annotations"]}
    order = [labels[f"<b>slider {leg}</b>"] for leg in (1, 3, 2)]  # from left to right
    eye = np.array([scene["camera"]["eye"][axis] for axis in "xyz"])
    right = np.cross(-eye, [0.0, 0.0, 1.0])
    up = np.cross(right, -eye)
    high = [float(up @ [label[axis] for axis in "xyz"]) for label in order]
    middle = -1 if high[1] > (high[0] + high[2]) / 2.0 else 1  # above is below zero
    assert [np.sign(label["ay"]) for label in order] == [-middle, middle, -middle]
    assert labels["<b>slider 3</b>"]["text"].endswith("and 2 more")


def test_a_ghost_moves_the_slider_that_lags_and_no_rail(diagnosed: Diagnosed):
    shift = diagnosed.ghosts["shift"]["backlash"]
    gaps = np.asarray(sealed_gaps_um()) / 2e3
    along = np.abs(np.asarray(shift["sliders"])[:, :, 2])
    np.testing.assert_allclose(along.max(axis=0), gaps, rtol=0.1)
    assert np.abs(shift["rails"]).max() == 0.0
    kind, legs = legs_at_fault(shift)
    assert kind == "slider" and int(np.argmax(gaps)) in legs
