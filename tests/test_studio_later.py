"""Later runs of the studio: a file that cannot be read keeps none back, answers are kept, dates are told."""

from pathlib import Path

import pandas as pd
import pytest
from studio_sample import DATA, MACHINE, OWNER, RUN, silent
from studio_sample import folder as folder
from studio_sample import here as here

from ptt.show.studio import jobs
from ptt.show.studio.figures_again import value_figure
from ptt.show.studio.later import ANYWAY, DATE, before_first, date_origin, later_source
from ptt.show.studio.opening import open_both
from ptt.show.studio.results import Source
from ptt.show.studio.session import Session
from ptt.show.studio.store import SessionStore

GAPS = "gap_mm = { value = [0.04, 0.018, 0.025], std = [1e-4, 2e-4, 1e-4] }"
MODEL = f'{MACHINE}\n[[effect]]\nname = "backlash"\n[effect.parameters]\n{GAPS}\n'


@pytest.fixture
def files(here: Path) -> Path:
    """A first run, a sound later one, and four that something stands against."""
    frame = pd.read_csv(DATA / "run.csv", dtype=str).iloc[:100]
    frame.to_csv("first.csv", index=False)
    frame[::-1].drop(columns="time_s").to_csv("later.csv", index=False)
    pd.concat([frame[:5], frame[6:7], frame[5:6], frame[7:]]).to_csv("back.csv", index=False)
    stamps = [f"0{1 + row // 60}.03.2026 23:{row % 60:02d}:00" for row in range(len(frame))]
    frame.drop(columns="time_s").assign(timestamp=stamps).to_csv("dates.csv", index=False)
    frame.assign(z_meas=(-frame["z_meas"].astype(float)).astype(str)).to_csv("mirrored.csv", index=False)
    Path("empty.csv").write_text("")
    return here


def test_a_later_run_is_told_at_once_what_stands_against_it(files: Path):
    told = {name: jobs.vet(Source(f"{name}.csv"), MODEL, silent) for name in ("later", "empty", "back", "dates")}
    assert told["later"] == {}
    assert told["empty"]["why"].startswith("empty.csv: the file is empty") and told["empty"]["question"] == ""
    assert (told["back"]["about"], told["back"]["choices"]) == ("order", ["rows", "time"])
    assert (told["dates"]["about"], told["dates"]["choices"]) == ("columns", ["day-first", "month-first"])
    mirrored = jobs.vet(Source("mirrored.csv"), MODEL, silent)
    assert (mirrored["about"], mirrored["choices"]) == (ANYWAY, [ANYWAY]) and "--" not in mirrored["question"]
    for trouble in (told["back"], told["dates"], mirrored):
        said = (trouble["run"], trouble["about"], trouble["question"], trouble["choices"][-1])
        assert jobs.vet(later_source(Source("first.csv"), trouble["run"], [said]), MODEL, silent) == {}


def test_runs_that_cannot_be_read_keep_none_back(files: Path):
    first = Source("first.csv")
    bad = [(Source(name), "2026-03-01") for name in ("empty.csv", "back.csv", "dates.csv")]
    found = jobs.again(first, MODEL, "2026-01-10", [(Source("later.csv"), "2026-02-10"), *bad], silent)
    assert [each["run"] for each in found["left"]] == ["empty.csv", "back.csv", "dates.csv"]
    assert found["pair"]["runs"] == ["first.csv", "later.csv"] and "verdict" in found["recheck"]
    assert [run["file"] for run in found["months"]["history"]] == ["first.csv", "later.csv"]
    none = jobs.again(first, MODEL, "2026-01-10", bad, silent)
    assert len(none["left"]) == 3 and {*none["pair"], *none["months"]} == {"why"}


def test_answers_on_a_later_run_leave_those_on_the_first_as_they_are(files: Path):
    frame = pd.read_csv("first.csv", dtype=str).rename(columns={"feed_mm_s": "feed"})
    frame.to_csv("open.csv", index=False)
    with pytest.raises(Exception, match="feed") as asked:
        open_both(Source("open.csv"), MODEL)
    first = Source("open.csv", set_=("order=rows",)).answered("columns", asked.value.question, "mm_s")
    open_both(first, MODEL)
    kept = Path("answers.toml").read_text()
    question = jobs.vet(Source("dates.csv"), MODEL, silent)["question"]
    own = later_source(first, "dates.csv", [("dates.csv", "columns", question, "day-first")])
    assert own.set_ == () and own.run == "dates.csv"
    assert jobs.vet(own, MODEL, silent) == {} and Path("answers.toml").read_text() == kept


def test_what_a_date_was_taken_from_is_told_and_a_first_run_that_is_later_than_the_others():
    assert "name" in date_origin("mill-2026-03-15.csv", "2026-03-15", False)
    assert "you said" in date_origin("mill-2026-03-15.csv", "2026-03-20", True)
    assert "enter the day it was measured" in date_origin("run.csv", "2026-03-15", False)
    later = [("b.csv", "2026-03-01"), ("c.csv", "2026-05-01")]
    assert before_first(("a.csv", "2026-03-01"), later) == ""
    assert "b.csv was measured before a.csv" in before_first(("a.csv", "2026-04-01"), later)


def test_what_is_said_of_later_runs_is_taken_up_again(tmp_path: Path):
    said = (("b.csv", DATE, "", "2026-03-01"), ("b.csv", "order", "b.csv: time goes back", "time"))
    place = SessionStore(tmp_path).fresh(OWNER)
    place.save(Session(said=said).opened(RUN, MACHINE))
    assert place.load().said == ()  # another run has later ones of its own
    opened = Session().opened(RUN, MACHINE)
    place.save(Session(opened.source, opened.now, later=(("b.csv", "2026-03-01"),), said=said))
    assert place.load().said == said


@pytest.mark.parametrize(
    ("days", "ends"),
    [
        (["2026-06-01"], ["2026-05-31", "2026-06-02"]),
        (["2026-06-01", "2026-06-03"], ["2026-05-31", "2026-06-04"]),
        (["2026-06-01", "2026-12-01"], None),
    ],
)
def test_an_axis_of_dates_has_no_mark_within_a_day(days: list[str], ends: list[str] | None):
    value = {"unit": "um", "moves": False, "days": days, "value": [1.0] * len(days), "std": [0.1] * len(days)}
    axis = value_figure(value)["layout"]["xaxis"]
    assert axis.get("range") == ends and axis.get("tickvals") == (None if ends is None else days)
