"""Training: the network learns what physics leaves, holds out honestly, and helps on the rig when measured again."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ptt
from ptt.commands.main import run_alone
from ptt.correct.compensate import compensate
from ptt.correct.training.compensator import load_compensator, save_compensator
from ptt.correct.training.heldout import evaluate_heldout
from ptt.correct.training.physics import fit_physics
from ptt.correct.training.protocols import block_protocol, random_protocol
from ptt.correct.training.rest import correction_of, learn_rest, training_set_of
from ptt.correct.training.train import train
from ptt.effects.registry import library, make_effect
from ptt.errors import InputError, TableError
from ptt.fitting.result import sound_rows
from ptt.judge.evaluate import evaluate_pair
from ptt.machine import load_machine
from ptt.model.entries import read_model
from ptt.rig import load_rig, simulate, write_run
from ptt.run.holdout import pose_groups
from ptt.run.noise import SATURATED
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

DATA = Path(__file__).resolve().parents[1] / "data"
EFFECTS = ("homing-offset", "lead-scale", "tower-position", "tower-tilt", "link-length", "once-per-rev", "windup")


def bench(number: int):
    file = load_machine(DATA / ("machine.toml" if number == 1 else "machine_compensated.toml"))
    table = read_table(DATA / f"experiment{number}.csv")
    return file, table, build_problem(file, table).anchored()


@pytest.fixture(scope="module")
def first():
    return bench(1)


@pytest.fixture(scope="module")
def trained(first):
    file, _, problem = first
    return train(read_model(file), problem, protocol=random_protocol(problem))


def measure_again(number: int, targets: np.ndarray, names, commands: np.ndarray | None, path: Path):
    """The rig's run of targets with its own or with corrected commands."""
    rig = load_rig(DATA / "rigs" / f"experiment{number}.toml")
    frame = pd.DataFrame(targets, columns=["x_cmd", "y_cmd", "z_cmd"]).assign(name=names)
    sliders = None if commands is None else pd.DataFrame(commands, columns=["b1", "b2", "b3"])
    write_run(simulate(rig, frame, sliders=sliders, seed=7000 + number).frame, path)
    return read_table(path)


def test_the_random_split_hides_poses_with_all_their_repeats(first):
    _, table, problem = first
    protocol = random_protocol(problem)
    (hidden,) = protocol.folds
    poses = pose_groups(table)
    assert len(np.unique(poses[hidden])) == 20 and hidden.sum() == 140
    assert not set(poses[hidden]) & set(poses[~hidden & (poses >= 0)])
    np.testing.assert_array_equal(hidden, random_protocol(problem).folds[0])
    assert (hidden != random_protocol(problem, seed=1).folds[0]).any()


def test_the_blocks_cover_every_pose_once(first):
    _, table, problem = first
    folds = np.stack(block_protocol(problem).folds)
    np.testing.assert_array_equal(folds.sum(axis=0), (table.role != "base").astype(int))


def test_the_network_learns_the_mean_step_of_each_pose_and_beside_it(first):
    file, table, problem = first
    fitted = fit_physics(read_model(file) + make_effect(library(), "homing-offset"), problem)
    rows = sound_rows(problem, fitted)
    rest = training_set_of(problem, fitted, rows, pose_groups(table))
    assert len(rest.places) == 180 and len(rest.inputs) == 7 * 180
    here = pose_groups(table) == 17
    expected = -fitted.residual[here].mean(axis=0)
    near = np.linalg.norm(rest.inputs - table.target[here][0], axis=1) < 1.0 + 1e-9
    matching = np.abs(rest.steps[near] - expected).max(axis=1) < 1e-12
    assert matching.sum() == 7


def test_the_network_does_not_run_away_beside_the_path(trained, first):
    _, table, _ = first
    network = trained.rbf.network
    places = np.unique(table.target[table.role != "base"], axis=0)
    on_path = network.predict(places)
    outward = places.copy()
    outward[:, :2] *= 1.0 + 1.5 / 60.0
    inside = network.inside(outward)
    assert inside.mean() > 0.7
    assert np.abs(network.predict(outward) - on_path)[inside].max() < 0.05  # mm, of steps of 0.9 mm


def test_the_correction_is_nothing_outside_the_domain(trained):
    correct = correction_of(trained.rbf.network)
    far = np.array([[0.0, 0.0, 20.0], [60.0, 0.0, 200.0]])
    np.testing.assert_array_equal(correct(far, far), far)
    known = np.array([[59.9634, 2.094, 0.25]])
    assert np.abs(correct(known, known) - known).max() > 0.1


def test_held_out_errors_are_worse_than_training_errors_and_better_than_none(trained):
    held, shown = trained.heldout_um, trained.rms_um
    assert shown["rbf"]["total"] < held["rbf"]["total"] < 0.1 * held["given"]["total"]
    assert 0.9 < trained.rbf_share < 1.0


def test_a_frame_of_base_reflectors_is_not_bent_toward_the_machines_errors(first):
    file, table, problem = first
    given = fit_physics(read_model(file), problem).residual
    assert given[table.role != "base", 0].mean() == pytest.approx(0.595, abs=0.01)  # mm, as the rig really errs
    assert problem.anchored().frames == 0


def test_too_few_poses_are_refused(first):
    file, table, _ = first
    one = table.role != "base"
    one &= pose_groups(table) != 3
    hidden = table.replace(measured=np.where(one[:, None], np.nan, table.measured))
    with pytest.raises(TableError, match="cannot be trained"):
        train(read_model(file), build_problem(file, hidden))


@pytest.mark.parametrize("number", [*(pytest.param(n, marks=pytest.mark.long) for n in (1, 2, 3, 4)), 5])
def test_random_split_measured_again_on_the_rig(number, tmp_path):
    """160 poses teach, 20 are judged, on readings that the corrected commands gave."""
    file, table, problem = bench(number)
    protocol = random_protocol(problem)
    (hidden,) = protocol.folds
    model = read_model(file)
    for name in (*EFFECTS, *(("backlash",) if number == 1 else ())):
        model = model + make_effect(library(), name)
    shown = problem.masked(hidden)
    targets = read_table(DATA / "targets.csv", purpose="targets")
    for candidate in (read_model(file), model):
        fitted = fit_physics(candidate, shown)
        network = learn_rest(shown, fitted, sound_rows(shown, fitted), protocol.groups).network
        cycles = make_table(np.tile(targets.target, (7, 1)))
        commands = compensate(fitted.model, cycles, correction=correction_of(network))
        after = measure_again(number, targets.target, targets.name, commands.q, tmp_path / "after.csv")
        axes = evaluate_pair(table, after, file, rows=hidden).to_dict()["axes"]
        gained = {axis: figures["reduction_percent"] for axis, figures in axes.items()}
        assert gained["x"] >= 95.0 and gained["y"] >= 95.0 and gained["z"] >= 90.0, gained


def test_the_held_out_evaluation_says_that_it_is_computed(first, trained):
    file, _, problem = first
    compensator = type("C", (), {"model": read_model(file), "network": trained.rbf.network, "space": "tool"})()
    protocols = (random_protocol(problem), block_protocol(problem))
    random, blocks = (evaluate_heldout(compensator, problem, protocol).to_dict() for protocol in protocols)
    assert random["protocol"]["measured"] is False and "20 of 180 poses" in random["protocol"]["held_out"]
    assert random["axes"]["x"]["reduction_percent"] > 95.0 > blocks["axes"]["x"]["reduction_percent"]


def test_a_compensator_reads_back_as_it_was_written(trained, tmp_path):
    run = DATA / "experiment1.csv"
    folder = save_compensator(tmp_path / "c", trained, [str(run)])
    back = load_compensator(folder)
    places = np.random.default_rng(0).uniform(-70, 70, (50, 3))
    np.testing.assert_array_equal(back.network.predict(places), trained.rbf.network.predict(places))
    np.testing.assert_array_equal(back.network.inside(places), trained.rbf.network.inside(places))
    assert sorted(path.name for path in folder.iterdir()) == ["compensator.json", "model.toml", "rbf.safetensors"]
    notes = json.loads((folder / "compensator.json").read_text())
    assert notes["trained_on"][0]["file"] == "experiment1.csv" and notes["domain_mm"]["low"][2] == pytest.approx(0.25)


def test_physics_and_network_of_different_trainings_are_refused(trained, tmp_path):
    folder = save_compensator(tmp_path / "c", trained, [])
    text = (folder / "model.toml").read_text()
    (folder / "model.toml").write_text(text.replace("base_radius_mm = 200", "base_radius_mm = 201"))
    assert (folder / "model.toml").read_text() != text
    with pytest.raises(InputError, match=r"model\.toml is not the one .* --model"):
        load_compensator(folder)
    assert load_compensator(folder / "model.toml").network is None
    assert load_compensator(save_compensator(folder, trained, [])).network is not None


def test_a_folder_with_other_files_is_refused_before_anything_is_trained(tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("mine")
    args = [str(DATA / "experiment2.csv"), "--machine", "no-such.toml", "--out", str(tmp_path)]
    with pytest.raises(SystemExit) as ended:
        run_alone("train", args)
    assert ended.value.code == 2 and "notes.txt" in capsys.readouterr().err


@pytest.mark.parametrize("damage", ["missing", "changed", "notes"])
def test_a_damaged_compensator_is_refused(trained, tmp_path, damage):
    folder = save_compensator(tmp_path / "c", trained, [])
    if damage == "missing":
        (folder / "rbf.safetensors").unlink()
    elif damage == "changed":
        content = bytearray((folder / "rbf.safetensors").read_bytes())
        content[-1] ^= 1
        (folder / "rbf.safetensors").write_bytes(bytes(content))
    else:
        (folder / "compensator.json").write_text("{")
    with pytest.raises(InputError, match="train it again"):
        load_compensator(folder)


def test_train_py_writes_a_folder_and_one_json_object(tmp_path, capsys):
    args = [str(DATA / "experiment2.csv"), "--machine", str(DATA / "machine_compensated.toml")]
    with pytest.raises(SystemExit) as ended:
        run_alone("train", [*args, "--out", str(tmp_path / "c"), "--json"])
    assert ended.value.code == 0
    data = json.loads(capsys.readouterr().out)
    assert {"effects", "rms_um", "heldout_rms_um", "protocol", "noise_um", "rbf"} <= set(data)
    assert load_compensator(tmp_path / "c").network is not None


def test_a_run_that_does_not_tell_its_noise_is_held_against_what_everything_leaves(tmp_path) -> None:
    machine, sealed = tmp_path / "machine.toml", DATA / "sealed_one"
    machine.write_text((sealed / "machine.toml").read_text().replace("sigma_mm = 0.004", ""))
    read = pd.read_csv(sealed / "run.csv").drop_duplicates(["x_cmd", "y_cmd", "z_cmd"])
    noise = ptt.train(machine, read).to_dict()["noise_um"]
    assert noise["source"] == SATURATED
    assert 1.0 < noise["total"] < 8.0
