"""What a set-up did in one run is that run's; what happened to the machine stays with the machine."""

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from command_line import invoke

import ptt
from ptt.correct.compensate import compensate
from ptt.effects import library
from ptt.effects.dated import RunPlace, at_place, unplaced
from ptt.machine import load_machine, save_machine
from ptt.machine_schema import TrackerSpec
from ptt.model.entries import read_model
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.table import make_table
from ptt.run.viewing import build_view

DATA = Path(__file__).resolve().parents[1] / "data"
FILE = replace(load_machine(DATA / "machine.toml"), tracker=TrackerSpec(sigma_mm=0.004), text="")
DRIVE = {"homing_mm": [0.2, -0.15, 0.1], "scale_um_per_m": [60.0, -50.0, 30.0]}
KNOCK = {"knock_row": 70, "knock_um": [120.0, -90.0, 150.0], "knock_mrad": [0.3, -0.2, 0.4]}
DRIFT = {"drift_um_per_h": [150.0, -100.0, 120.0]}
MACHINES = ("homing-offset", "lead-scale")
PATH = make_volume(ideal_machine(FILE.machine), 150, 4)


def run_of(seed: int, tracker: dict | None = None, drive: dict | None = None) -> pd.DataFrame:
    rig = {"machine": FILE.machine.model_dump(), "seed": 3, "drive": DRIVE | (drive or {}), "tracker": tracker or {}}
    return simulate(parse_rig(rig | {"conditions": {"label": str(seed), "dwell_s": 20.0}}), PATH, seed=seed).frame


def spoken(*words: object) -> dict:
    result = invoke(*words, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def total(folder: Path, model: str, *runs: object) -> float:
    return spoken("compare", *runs, "--model", folder / model)["rms_um"]["total"]


@pytest.fixture(scope="module", params=[("setup-jump", KNOCK), ("tracker-drift", DRIFT)], ids=["knock", "drift"])
def folder(request, tmp_path_factory) -> tuple[Path, str]:
    """Run a with something of its set-up, run b of the same machine without, and the models fitted on a."""
    effect, tracker = request.param
    place = tmp_path_factory.mktemp("of_run")
    save_machine(FILE, place / "drawing.toml")
    save_machine(replace(FILE, tracker=TrackerSpec(sigma_mm=0.004, frame="fitted-per-run")), place / "apart.toml")
    write_run(run_of(11, tracker), place / "a.csv")
    write_run(run_of(12), place / "b.csv")
    for start in ("drawing", "apart"):
        words = ("--model", place / f"{start}.toml", "--out", place / f"{start}_m.toml")
        spoken("add", place / "a.csv", *MACHINES, effect, *words)
    spoken("add", place / "b.csv", *MACHINES, "--model", place / "drawing.toml", "--out", place / "b.toml")
    return place, effect


def test_it_helps_its_own_run_and_is_left_out_of_another(folder):
    place, effect = folder
    best = total(place, "b.toml", place / "b.csv")
    assert total(place, "drawing_m.toml", place / "a.csv") < 1.3 * best
    assert total(place, "b.toml", place / "a.csv") > 2.0 * best  # without it, run a is off
    assert total(place, "drawing_m.toml", place / "b.csv") < 1.3 * best
    for verb in ("compare", "diagnose", "fit"):
        result = invoke(verb, place / "b.csv", "--model", place / "drawing_m.toml", "--json")
        assert json.loads(result.stdout)["other_runs"] == [effect]
        assert f"{effect} is left out: it belongs to another run" in result.stderr


def test_the_file_says_of_which_run_it_is_and_a_copy_is_the_same_run(folder):
    place, effect = folder
    file = load_machine(place / "drawing_m.toml")
    (entry,) = [each for each in file.effect if each.name == effect]
    assert entry.runs == (file.history[-1]["files"][0]["sha256"],)
    assert all(not each.runs for each in file.effect if each.name != effect)
    (place / "copy.csv").write_bytes((place / "a.csv").read_bytes())
    assert total(place, "drawing_m.toml", place / "copy.csv") == total(place, "drawing_m.toml", place / "a.csv")
    older = replace(file, effect=tuple(each.model_copy(update={"runs": ()}) for each in file.effect), text="")
    assert [term.runs for term in read_model(older).terms if term.effect.name == effect] == [entry.runs]


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_beside_another_run_it_applies_to_its_own_rows_by_its_own_clock(folder, order):
    place, _ = folder
    runs = [place / f"{name}.csv" for name in order]
    best = total(place, "b.toml", place / "b.csv")
    assert total(place, "apart_m.toml", runs[0], "--also", runs[1]) < 1.3 * best


def test_a_fit_on_another_run_keeps_it_as_it_was(folder):
    place, effect = folder
    spoken("fit", place / "b.csv", "--model", place / "drawing_m.toml", "--out", place / "again.toml")
    before, after = (load_machine(place / name) for name in ("drawing_m.toml", "again.toml"))
    kept = [[each for each in file.effect if each.name == effect] for file in (before, after)]
    assert kept[0] == kept[1] and before.effect != after.effect


def test_two_runs_have_one_each(folder):
    place, effect = folder
    write_run(run_of(13, KNOCK | {"knock_row": 40} if effect == "setup-jump" else DRIFT), place / "c.csv")
    spoken("add", place / "c.csv", effect, "--model", place / "drawing_m.toml", "--out", place / "two.toml")
    entries = [each for each in load_machine(place / "two.toml").effect if each.name == effect]
    assert len({each.runs for each in entries}) == 2 and len({each.label for each in entries}) == 2
    best = total(place, "b.toml", place / "b.csv")
    for name in ("a", "b", "c"):
        assert total(place, "two.toml", place / f"{name}.csv") < 1.3 * best


@pytest.mark.parametrize(("name", "share"), [("homing-slip", [0.0, 0.5, 1.0]), ("setup-jump", [0.0, 0.5, 0.0])])
def test_between_two_runs_a_slip_lasts_and_a_knock_is_of_its_own_run(name, share):
    """Of three runs it happens half-way through the second; each run has a clock that begins at zero."""
    place = np.random.default_rng(4).uniform(-40.0, 40.0, (60, 3))
    table = make_table(place, run=np.repeat([0, 1, 2], 20), time_s=np.tile(np.arange(20.0), 3))
    view = build_view(FILE, table)
    begun = float(view.time[20])
    effect = at_place(library()[name](), RunPlace((1,), begun, 20.0))
    moved = effect.basis(view, {"after": torch.tensor([9.0], dtype=torch.float64)}).abs().sum(dim=(1, 2)) > 0.0
    assert [float(moved[20 * run : 20 * run + 20].double().mean()) for run in range(3)] == share


@pytest.mark.parametrize("name", ["homing-slip", "setup-jump"])
def test_a_place_is_replaced_by_another(name):
    table = make_table(np.zeros((40, 3)), run=np.repeat([0, 1], 20), time_s=np.tile(np.arange(20.0), 2))
    view, shape = build_view(FILE, table), {"after": torch.tensor([9.0], dtype=torch.float64)}
    bare, begun = library()[name](), RunPlace((1,), 500.0, 20.0)
    for place in (RunPlace(()), begun):
        twice = pickle.loads(pickle.dumps(at_place(at_place(bare, begun), place)))
        torch.testing.assert_close(twice.basis(view, shape), at_place(bare, place).basis(view, shape))
        assert unplaced(twice) is type(bare)


def test_what_was_trained_beside_another_run_is_what_its_folder_holds(tmp_path):
    """The slip is of run b; a and b together train, and targets come after both."""
    save_machine(FILE, tmp_path / "m.toml")
    slip = {"slip_row": 70, "slip_mm": [0.0, 0.12, 0.0]}
    write_run(run_of(11), tmp_path / "a.csv")
    write_run(run_of(12, drive=slip), tmp_path / "b.csv")
    model = ptt.load(tmp_path / "m.toml")
    model = ptt.add(model, ptt.read(tmp_path / "b.csv", model), "homing-slip").model
    trained = ptt.train(model, ptt.read(tmp_path / "a.csv", model, also=[tmp_path / "b.csv"]), anyway=True)
    trained.save(tmp_path / "c")
    targets = np.array([[0.0, 0.0, 0.0], [10.0, 20.0, 5.0]])
    kept = ptt.predict(ptt.load(tmp_path / "c"), targets, anyway=True)
    np.testing.assert_allclose(ptt.predict(trained, targets, anyway=True).b, kept.b, rtol=0.0, atol=1e-9)


def test_a_slider_that_slipped_stays_where_it_slipped_to(tmp_path):
    """Run a holds the slip; run b and every command come after it, whatever their clocks say."""
    slip = {"slip_row": 70, "slip_mm": [0.0, 0.12, 0.0]}
    after = {"homing_mm": [0.2, -0.15 + 0.12, 0.1]}
    save_machine(FILE, tmp_path / "m.toml")
    write_run(run_of(11, drive=slip), tmp_path / "a.csv")
    write_run(run_of(12, drive=after), tmp_path / "b.csv")
    words = ("--model", tmp_path / "m.toml", "--out", tmp_path / "m2.toml")
    spoken("add", tmp_path / "a.csv", *MACHINES, "homing-slip", *words)
    own = total(tmp_path, "m2.toml", tmp_path / "a.csv")
    result = invoke("compare", tmp_path / "b.csv", "--model", tmp_path / "m2.toml", "--json")
    assert json.loads(result.stdout)["rms_um"]["total"] < 1.3 * own and "homing-slip happened in run" in result.stderr
    targets = PATH[["x_cmd", "y_cmd", "z_cmd"]].to_numpy(copy=True)[:40]
    commands = compensate(read_model(load_machine(tmp_path / "m2.toml")), make_table(targets))
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 3, "drive": DRIVE | after})
    sent = pd.DataFrame(commands.q, columns=["b1", "b2", "b3"])
    path = pd.DataFrame(targets, columns=["x_cmd", "y_cmd", "z_cmd"])
    error = simulate(rig, path, sliders=sent, noise=False).truth - targets
    error -= error.mean(axis=0)  # what all sliders share is the tracker's
    assert 1e3 * np.sqrt(np.square(error).sum(axis=1).mean()) < 10.0
