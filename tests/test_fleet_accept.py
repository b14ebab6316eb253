"""A repair or a change is accepted: later runs of the virtual machine are held against the model fitted to it."""

import json
import shutil
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke

from ptt.commands.main import run as run_verb
from ptt.effects import library
from ptt.fleet.alarms import Alarm
from ptt.fleet.database import insert, transaction
from ptt.fleet.models import OF_RUN, model_at
from ptt.fleet.overview import overview
from ptt.fleet.past import Past, unsettled
from ptt.fleet.queue import alone_with, keep_outcome, next_task
from ptt.fleet.run import run_all
from ptt.fleet.runs import open_task, read_task
from ptt.fleet.store import Store, add_machine, add_run, create_store, open_store
from ptt.fleet.task import Outcome, Task
from ptt.fleet.work import work
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine, parse_machine
from ptt.model.entries import read_model
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.reading import read_table
from ptt.show.fleet.page import render

DRAWING = """[machine]
kind = "three-ptt"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0
[tracker]
frame = "fitted"
sigma_mm = 0.004
"""
fleet = partial(invoke, "fleet")
GAPS, WORN = [0.03, 0.02, 0.045], [0.03, 0.055, 0.045]
EFFECTS = ("backlash", "link-length")


def measure(folder: Path, day: str, gaps: list[float]) -> Path:
    """A run of the machine on a day: its play is given, path, tracker's place and noise are the day's own."""
    seed = int(day.replace("-", ""))
    random = np.random.default_rng(seed)
    tracker = {"white_mm": 0.004, "translation_mm": random.uniform(-1, 1, 3).tolist()}
    machine = parse_machine(DRAWING, "drawing").machine.model_dump(mode="json", exclude_none=True)
    faults = {"drive": {"backlash_mm": gaps}, "geometry": {"link_mm": [0.08, -0.05, 0.0]}, "tracker": tracker}
    rig = parse_rig({"machine": machine, "seed": seed, **faults})
    path = folder / f"mill-{day}.csv"
    write_run(simulate(rig, make_volume(ideal_machine(rig.spec), 70, seed)).frame, path)
    return path


def put(store: Store, path: Path) -> None:
    add_run(store, "mill", path, read_table(path), None, ordered=False, units_said=False)


def first(task: Task, tell) -> Outcome:
    """What a diagnosis ends with, without its search: the effects that the machine has, fitted to its first run."""
    if task.solved is not None:
        return work(task, tell)
    opened = open_task(task, read_task(task)[0])
    ladder = climb(opened.model, opened.problem, [library()[name]() for name in EFFECTS])
    text = format_machine(record(ladder, "add", [{"file": task.file, "sha256": task.run}], date=task.date))
    return Outcome(task.run, task.machine, "diagnosis", "missing", "", 0.0, 7.0, None, 7.0, solved=text)


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of a mill whose slider 2 wears between March and April, and stays so."""
    folder = tmp_path_factory.mktemp("spring")
    store = create_store(folder / "plant")
    (folder / "drawing.toml").write_text(DRAWING)
    add_machine(store, "mill", folder / "drawing.toml")
    for day, gaps in (("2026-03-05", GAPS), ("2026-04-05", WORN), ("2026-05-05", WORN)):
        put(store, measure(folder, day, gaps))
    run_all(store, work=first)
    return store.folder


@pytest.fixture
def plant(spring: Path, tmp_path: Path) -> Store:
    """A copy of that store for one test."""
    shutil.copytree(spring, tmp_path / "plant")
    return open_store(tmp_path / "plant")


def test_after_a_change_is_accepted_later_runs_are_the_same_and_nothing_is_lost(plant: Store, tmp_path: Path) -> None:
    (before,) = overview(plant).machines
    assert [past.verdict for past in before.past] == ["missing", "changed", "changed"]
    models = plant.ask("SELECT run, made, toml FROM models WHERE made IN ('given', 'solved')")
    assert {row["made"] for row in models} == {"given", "solved"}
    told = json.loads(fleet("accept", plant.folder, "mill", "mill-2026-04-05.csv", "--json").stdout)
    assert told["new"] and told["date"][:10] == "2026-04-05" and told["waiting"] == 1
    assert told["error_um"]["before"] > 1.5 * told["error_um"]["after"]
    assert told["error_um"]["after"] < 1.2 * told["noise_um"]
    (now,) = plant.ask(missed_now())  # of April, for May waits
    assert now["verdict"] == "accepted" and now["error_um"] == pytest.approx(told["error_um"]["after"])
    run_all(plant, work=work)
    (after,) = overview(plant).machines
    (now,) = plant.ask(missed_now())
    assert now["verdict"] == "same" and now["error_um"] == pytest.approx(after.error_um)
    assert [past.verdict for past in after.past] == ["missing", "changed", "same"]  # what April showed stays written
    assert after.error_um < 8.0 < before.error_um
    assert all(row in plant.ask("SELECT run, made, toml FROM models") for row in models)
    gap = read_model(parse_machine(next_model(plant), "mill")).terms[0].theta[:3].numpy()
    np.testing.assert_allclose(gap, WORN, atol=0.004)  # the virtual machine's own play


def test_a_run_is_taken_out_with_all_that_came_of_it_and_may_be_added_again(plant: Store, tmp_path: Path) -> None:
    told = json.loads(fleet("remove", plant.folder, "mill", "2026-04-05", "--json").stdout)
    assert (told["file"], told["waiting"]) == ("mill-2026-04-05.csv", 0)
    assert [past.verdict for past in overview(plant).machines[0].past] == ["missing", "changed"]
    for table in (*OF_RUN, "models", "runs"):
        assert not plant.ask(f"SELECT run FROM {table} WHERE run = ?", told["run"])
    assert not list(plant.folder.rglob(f"{told['run']}*"))
    put(plant, measure(tmp_path, "2026-04-05", WORN))
    assert [past.verdict for past in overview(plant).machines[0].past] == ["missing", None, "changed"]
    first_run = fleet("remove", plant.folder, "mill", "mill-2026-03-05.csv")  # whose model the others were held against
    assert "1 run rechecked against its model to be processed again: ptt fleet run" in first_run.stdout
    assert [past.verdict for past in overview(plant).machines[0].past] == [None, None]
    gone = fleet("remove", plant.folder, "mill", "mill-2026-03-05.csv")
    assert gone.exit_code == 2 and "no run of 'mill' is called" in gone.stderr


def missed_now() -> str:
    """The query of docs/fleet.md that lists machines by what they miss."""
    page = (Path(__file__).resolve().parents[1] / "docs" / "fleet.md").read_text()
    return page.split("```sql")[1].split("```")[0].split(";")[1]


def next_model(store: Store) -> str:
    return str(store.ask("SELECT toml FROM models WHERE made = 'accepted'")[0]["toml"])


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Accept without the fit: the model stays what it was."""
    monkeypatch.setattr("ptt.fleet.work.refit", lambda task: task.solved + "# once more\n")


def test_the_same_accept_twice_is_one(plant: Store, quick: None) -> None:
    assert fleet("accept", plant.folder, "mill").exit_code == 0
    before = plant.ask("SELECT * FROM models ORDER BY ALL"), plant.ask("SELECT * FROM outcomes ORDER BY ALL")
    again = fleet("accept", plant.folder, "mill", "2026-05-05")
    assert again.exit_code == 0 and "already" in again.stdout
    assert before == (plant.ask("SELECT * FROM models ORDER BY ALL"), plant.ask("SELECT * FROM outcomes ORDER BY ALL"))
    first_run = fleet("accept", plant.folder, "mill", "mill-2026-03-05.csv", "--json")
    assert json.loads(first_run.stdout)["new"] is False  # the diagnosis of March made the model then


def test_a_run_that_cannot_be_meant_is_refused_and_changes_nothing(plant: Store, tmp_path: Path) -> None:
    put(plant, measure(tmp_path, "2026-06-05", GAPS))
    waits = fleet("accept", plant.folder, "mill")
    assert waits.exit_code == 2 and "has not been processed yet; `ptt fleet run` first" in waits.stderr
    assert "no machine 'press'" in fleet("accept", plant.folder, "press").stderr
    assert "name one by its file: mill-2026-03-05.csv" in fleet("accept", plant.folder, "mill", "may").stderr
    with alone_with(plant, "mill", ""):
        for verb in ("accept", "remove"):
            busy = fleet(verb, plant.folder, "mill", "2026-05-05")
            assert busy.exit_code == 2 and "another `ptt fleet run` is working on 'mill'" in busy.stderr
            assert f"{verb} when it is done" in busy.stderr
    assert not plant.ask("SELECT 1 FROM models WHERE made = 'accepted'")


def test_show_and_report_tell_what_was_accepted(plant: Store, quick: None) -> None:
    assert overview(plant).machines[0].verdict == "changed"
    fleet("accept", plant.folder, "mill")
    (after,) = overview(plant).machines
    assert after.verdict == after.to_dict()["verdict"] == "accepted"
    assert after.to_dict()["history"][-1]["verdict"] == "changed" and after.to_dict()["history"][-1]["accepted"]
    assert "its model is used from here on" in fleet("show", plant.folder, "mill").stdout
    assert "is accepted: " in render(overview(plant))


def test_a_machine_on_which_nothing_was_ever_found_has_nothing_to_refit(tmp_path: Path, plant: Store) -> None:
    (tmp_path / "drawing.toml").write_text(DRAWING)
    add_machine(plant, "press", tmp_path / "drawing.toml")
    for day, solved in (("2026-03-06", DRAWING), ("2026-04-06", None)):
        path = measure(tmp_path, day, GAPS)
        add_run(plant, "press", path, read_table(path), None, ordered=False, units_said=False)
        keep_outcome(plant, Outcome(next_task(plant, "press").run, "press", "recheck", "same", "", 0.0, solved=solved))
    refused = fleet("accept", plant.folder, "press")
    assert refused.exit_code == 3 and "nothing was ever fitted to 'press'" in refused.stderr


def test_a_run_that_is_added_late_is_held_against_the_model_of_its_time(
    plant: Store, quick: None, tmp_path: Path
) -> None:
    fleet("accept", plant.folder, "mill", "2026-05-05")
    accepted = next_model(plant)
    early, late = measure(tmp_path, "2026-03-20", GAPS), measure(tmp_path, "2026-06-20", WORN)
    put(plant, early)
    task = next_task(plant, "mill")
    assert task.solved == accepted.removesuffix("# once more\n")
    keep_outcome(plant, Outcome(task.run, "mill", "recheck", "same", "", 0.0))
    put(plant, late)
    assert next_task(plant, "mill").solved == accepted


def test_a_run_whose_own_model_was_accepted_is_held_against_the_one_before(plant: Store, quick: None) -> None:
    """April is accepted after May: May is worked on again, and its own model would find it unchanged."""
    march, april, may = (row["run"] for row in plant.ask("SELECT run FROM runs ORDER BY date"))
    for day in ("2026-05-05", "2026-04-05"):
        assert fleet("accept", plant.folder, "mill", day).exit_code == 0

    def held(run: str) -> str:
        with transaction(plant.file, read_only=True) as connection:
            return (model_at(connection, "mill", run) or ("", ""))[0]

    assert next_task(plant, "mill").run == may
    assert (held(march), held(april), held(may)) == (april, march, april)
    solved = str(next_task(plant, "mill").solved)
    keep_outcome(plant, Outcome(may, "mill", "recheck", "new", "", 0.0, solved=solved + "# new\n"))
    with transaction(plant.file) as connection:  # a later run: what the user accepted goes before what was added
        insert(connection, "runs", run="june", machine="mill", date=datetime(2026, 6, 5), place=9, file="", kept="",
               readings="", row_count=1, ordered=True, units_said=True)  # fmt: skip
        assert model_at(connection, "mill", "june") == (may, plant_model(connection, may))
    told = json.loads(fleet("remove", plant.folder, "mill", "2026-04-05", "--json").stdout)
    assert told["waiting"] == 1 and next_task(plant, "mill").run == may
    assert overview(plant).machines[0].past[0].verdict == "missing"  # a diagnosis needs no model


def plant_model(connection, run: str) -> str:
    query = "SELECT toml FROM models WHERE run = ? AND made = 'accepted'"
    return str(connection.execute(query, [run]).fetchall()[0][0])


def test_what_happened_before_an_accepted_run_alarms_no_more_but_a_drift_does() -> None:
    kinds = (("jump", "2026-04-05"), ("jump", "2026-06-05"), ("new", "2026-05-05"), ("drift", None))
    alarms = [Alarm("backlash", "gap_mm 2", kind, kind, when=day) for kind, day in kinds]
    runs = [Past("", "", datetime(2026, month, 5), 80, "changed", 20.0, 5.0, 5.0, "") for month in (4, 5)]
    assert unsettled(alarms, runs) == tuple(alarms)
    assert unsettled(alarms, [runs[0], replace(runs[1], accepted=True)]) == (alarms[1], alarms[3])


def test_a_machine_with_an_effect_of_the_users_own_has_a_place_in_a_fleet(tmp_path: Path) -> None:
    own, drawing, log = tmp_path / "own.py", tmp_path / "m.toml", measure(tmp_path, "2026-03-05", GAPS)
    assert run_verb(["effects", "new", "nut-pull", "--out", str(own)]) == 0
    drawing.write_text(f'{DRAWING}[[effect]]\nname = "nut-pull"\n')
    create_store(tmp_path / "plant")
    named = "add", tmp_path / "plant", "mill", log, "--model", drawing
    refused = fleet(*named)
    assert refused.exit_code == 2 and "effect 'nut-pull' is not known" in refused.stderr
    assert fleet(*named, "--effects", own).exit_code == 0
    assert fleet("run", tmp_path / "plant", "--effects", own).exit_code == 0
    store = open_store(tmp_path / "plant")
    assert [row["verdict"] for row in store.ask("SELECT verdict FROM outcomes")] == ["missing"]
    assert fleet("accept", store.folder, "mill", "--effects", own).exit_code == 0
    fitted = fleet("fit", log, "--model", drawing, "--out", tmp_path / "m2.toml", "--effects", own)
    assert fitted.exit_code == 0 and "nut-pull" in fitted.stdout
