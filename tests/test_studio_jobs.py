"""Jobs of the studio against the command line: comparison, addition, diagnosis, compensator, report."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import create_autospec

import numpy as np
import pandas as pd
import pytest
import torch
from studio_sample import MACHINE, RUN, silent, verb
from studio_sample import added as added
from studio_sample import folder as folder
from studio_sample import here as here
from studio_sample import look as look

from ptt.diagnosis.long import MOST_WHOLE_ROWS, chunk_size
from ptt.door.opened import Opened
from ptt.errors import InputError
from ptt.fitting.chunks import CHUNK
from ptt.judge.iso.pose_figures import named_figures
from ptt.machine import parse_machine
from ptt.mechanisms import build_mechanism
from ptt.show.report.gather import gather
from ptt.show.report.of_run import report_run
from ptt.show.studio import jobs, opening
from ptt.show.studio.looks import Look
from ptt.show.studio.results import Changed, Source
from ptt.show.studio.uploads import keep_seal


def test_comparison_is_the_one_of_the_command_line(here: Path):
    mine, theirs = jobs.compare(RUN, MACHINE, silent).data, verb("compare", "run.csv", "--model", "machine.toml")
    theirs.pop("network_left_aside")
    assert mine == theirs


def test_adding_is_the_one_of_the_command_line(here: Path, added: Changed):
    theirs = verb("add", "run.csv", "backlash", "--model", "machine.toml", "--out", "theirs.toml")
    assert added.data == theirs
    assert parse_machine(added.model).effect == parse_machine((here / "theirs.toml").read_text()).effect


def test_a_look_says_what_the_comparison_says(here: Path, look: Look):
    whole = jobs.compare(RUN, MACHINE, silent)
    rms = float(np.sqrt(np.mean(look.size_um[look.kept] ** 2)))
    assert rms == pytest.approx(whole.data["rms_um"]["total"], rel=0.02)
    exact = float(np.sqrt(np.mean(whole.look.size_um[whole.look.kept] ** 2)))
    assert exact == pytest.approx(whole.data["rms_um"]["total"], rel=1e-12)
    assert look.covariates[:2] == ("time [s]", "payload [kg]")


def test_diagnosis_is_the_one_of_the_command_line(here: Path):
    found = jobs.diagnose(RUN, MACHINE, silent)
    assert found.data == verb("diagnose", "run.csv", "--model", "machine.toml")
    assert found.data["suggested"] == [["backlash"]] and found.measure_next == "" and found.sizes == []


def test_where_a_size_of_the_drawing_is_found_the_others_can_be_added_as_the_command_line_does(here: Path):
    place, random = np.random.default_rng(1).uniform(-50.0, 50.0, (60, 3)), np.random.default_rng(2)
    robot = build_mechanism(parse_machine(MACHINE, "machine.toml").machine)
    sent = robot.inverse(torch.as_tensor(place))
    stood = robot.forward(sent + torch.tensor([0.0, 0.1, 0.0])).numpy() + random.normal(0.0, 0.003, place.shape)
    columns = [f"{axis}_{kind}" for kind in ("cmd", "meas") for axis in "xyz"]
    pd.DataFrame(np.hstack([place, stood]), columns=columns).to_csv("high.csv", index=False)
    found = jobs.diagnose(Source("high.csv"), MACHINE, silent)
    assert [step[0] for step in found.data["suggested"]] == ["homing-offset"]
    mine = jobs.change(Source("high.csv"), MACHINE, "add", ("homing-offset", *found.sizes), silent)
    theirs = verb("add", "high.csv", "homing-offset", "--sizes", "--model", "machine.toml", "--out", "theirs.toml")
    assert [step["effect"] for step in mine.data["steps"]] == [step["effect"] for step in theirs["steps"]]
    assert len(found.sizes) > 3 and mine.data["parameters"] == theirs["parameters"]


def test_all_that_an_unknown_follows_is_written_as_the_command_line_does_and_added(here: Path):
    curve = {"at": [180.0, 220.0], "between": [175.0, 225.0]}
    one = {"residual": "slider 1", "on": "b1", "shape": "smooth", "acts_on": "slider 1", "curve": curve}
    found = [one, one | {"on": "b2", "shape": "step", "place": [200.0, 202.0]}]
    Path("found.json").write_text(json.dumps({"depends_on": found}))
    made = jobs.write_effects("my-effect", found, silent)
    theirs = verb("effects", "new", "my-effect", "--like", "found.json")
    assert made["text"] == theirs["text"] and made["names"] == theirs["names"] == ["my-effect", "my-effect-2"]
    source = replace(RUN, effects=(made["file"],))
    changed = jobs.change(source, MACHINE, "add", tuple(made["names"]), silent)
    assert [entry.name for entry in parse_machine(changed.model).effect] == made["names"]
    # The tools of Finish know what was written too.
    assert jobs.dexterity(source, changed.model, silent)["figures"]["kind"] == "three-ptt"
    told = jobs.plan(source, changed.model, 100, "", silent)["told"]["effects"]
    assert {item["effect"] for item in told if item["in_model"]} == set(made["names"])
    keep_seal(here, "run.csv", (here / "sealed.json").read_bytes())
    assert jobs.reveal(source, changed.model, silent)["hidden"]


def test_compensator_and_its_commands_are_read_by_the_command_line(here: Path, added: Changed):
    trained = jobs.train(RUN, added.model, silent)
    mine = jobs.predict(RUN, trained.archive, "targets.csv", silent)
    with zipfile.ZipFile(io.BytesIO(trained.archive)) as archive:
        archive.extractall(here / "unpacked")
    verb("predict", "targets.csv", "--model", "unpacked/compensator", "--out", "theirs.csv")
    assert mine.content == (here / "theirs.csv").read_bytes()
    assert mine.data["rows"] == 296 and mine.data["network"]


def test_the_tools_give_what_the_verbs_print(here: Path, added: Changed):
    Path("solved.toml").write_text(added.model)
    model = ("--model", "solved.toml")
    poses = jobs.plan(RUN, MACHINE, 130, "0,2", silent)
    theirs = verb("plan", "machine.toml", "--rows", 130, "--payloads", "0,2", "--out", "poses.csv")
    assert poses["told"] | {"out": "poses.csv"} == theirs and poses["csv"] == Path("poses.csv").read_text()
    assert jobs.dexterity(RUN, MACHINE, silent)["figures"] == verb("dexterity", "machine.toml")
    table, theirs = (
        jobs.export(RUN, added.model, "table", silent),
        verb("export", *model, "--to", "table", "--out", "t"),
    )
    assert all(table[key] == theirs[key] for key in ("holds", "cannot_hold", "error_um", "notes"))
    figures, theirs = jobs.iso(RUN, added.model, silent), verb("iso", "run.csv", *model)
    assert figures == {"standard": theirs["standard"], "figures": named_figures(theirs)}
    found = jobs.again(RUN, added.model, "2026-01-10", [(RUN, "2026-02-10")], silent)
    assert found["recheck"] == verb("recheck", "run.csv", *model)
    verb("fleet", "init", "store")
    verb("fleet", "add", "store", "machine", "run.csv", *model, "--date", "2026-01-10")
    verb("fleet", "run", "store")
    shown = verb("fleet", "show", "store", "machine")["machines"][0]["history"][0]
    mine = found["months"]["history"][0]
    assert {key: mine[key] for key in ("error_um", "noise_um", "verdict", "date")} == {
        key: shown[key] for key in ("error_um", "noise_um", "verdict", "date")
    }


def test_the_report_is_that_of_the_verb(here: Path, added: Changed, monkeypatch: pytest.MonkeyPatch):
    def write(opened: Opened, out: Path, *, model: Path, **more: object) -> None:
        assert opened.table.rows and parse_machine(model.read_text()).effect == parse_machine(added.model).effect
        out.write_text("<!doctype html>")

    as_written = create_autospec(report_run, side_effect=write)  # a changed signature fails here
    monkeypatch.setattr("ptt.show.report.of_run.report_run", as_written)
    assert jobs.report(replace(RUN, set_=("payload_kg=2",)), added.model, None, b"", b"", silent) == b"<!doctype html>"
    assert list(as_written.call_args.kwargs["reading"].set_) == ["payload_kg=2"]


def test_the_diagnosis_is_chosen_by_rows_and_kind_of_machine(here: Path):
    problem = opening.open_both(RUN, MACHINE).problem
    table, file = problem.table, problem.file

    def of(rows: int, kind: str) -> Any:
        return SimpleNamespace(
            table=SimpleNamespace(rows=rows), file=SimpleNamespace(machine=SimpleNamespace(kind=kind))
        )

    assert chunk_size(problem) is None and table.rows <= MOST_WHOLE_ROWS[file.machine.kind]
    for kind in ("three-ptt", "serial"):
        assert chunk_size(of(MOST_WHOLE_ROWS[kind], kind)) is None
        assert chunk_size(of(MOST_WHOLE_ROWS[kind] + 1, kind)) == CHUNK
    assert MOST_WHOLE_ROWS["serial"] < MOST_WHOLE_ROWS["three-ptt"]
    assert chunk_size(problem, 1000) == 1000


def test_a_report_of_a_long_run_is_diagnosed_in_chunks(here: Path, monkeypatch: pytest.MonkeyPatch):
    def in_chunks(*given: object, size: int, **more: object) -> None:
        raise InputError(f"chunks of {size}")

    monkeypatch.setitem(MOST_WHOLE_ROWS, "three-ptt", 100)
    monkeypatch.setattr("ptt.diagnosis.diagnose.diagnose_long", in_chunks)
    opened = opening.open_both(RUN, MACHINE)
    assert gather(opened.table, opened.model.file).drawing.why_not == f"chunks of {CHUNK}"
