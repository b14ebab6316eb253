"""C of a model: built with every warning and both sanitisers, its commands are those of `ptt predict`."""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from built_c import FLAGS, Built, Context, check, expected, path_of, pointer, random_model

from nets import GaussianRbf, measure_domain
from ptt.correct.compensate import compensate
from ptt.correct.exports.c.tree import tree_order
from ptt.correct.exports.c.write import write
from ptt.correct.exports.format import Options
from ptt.correct.training.compensator import Compensator
from ptt.effects import library
from ptt.effects.bench import sample_machine
from ptt.effects.registry import make_effect
from ptt.machine import MachineFile, load_machine
from ptt.machine_schema import ControllerSpec, TargetsSpec
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.rig.draw_machine import draw_machine_file
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
SANITISED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long), 4])
def test_all_effects_on_drawn_machines(seed: int, tmp_path: Path) -> None:
    file = draw_machine_file(seed).file
    # A joint that turns within a straight move and then moves by less than its play cannot be put right at all.
    file = replace(file, machine=file.machine.model_copy(update={"moves": "sliders"}))
    compensator = Compensator(random_model(file, seed), None, {})
    targets = build_mechanism(file.machine).forward(torch.tensor(path_of(file, seed))).numpy()
    built, found, _ = check(compensator, targets, tmp_path)
    assert found.sent.mean() > 0.8 and found.shift[found.sent].max() > 0.05 and not built.cannot
    # Forward, against the chain that fits are made with.
    q, context = found.q[found.sent][::9], Context(1.3, 26.0, 0.0, 0.0)
    steady = [
        (t.effect, t.theta) for t in compensator.model.terms if not t.effect.reverses and t.effect.name != "homing-slip"
    ]
    slip = next(t.theta for t in compensator.model.terms if t.effect.name == "homing-slip")
    steady = [(e, theta + slip[:3] if e.name == "homing-offset" else theta) for e, theta in steady]
    there = predict(steady, build_view(file, make_table(None, q, payload_kg=1.3, temp_c=26.0))).p.numpy()
    np.testing.assert_allclose(built.forward(q, context), there, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("change", [{"moves": "straight"}, {"slider_lean_deg": (0.4, -0.3, 0.2)}])
def test_straight_moves_and_leaning_rails(bench: MachineFile, change, tmp_path: Path) -> None:
    file = replace(bench, machine=bench.machine.model_copy(update=change))
    compensator = Compensator(
        random_model(file, 5, ("backlash", "windup", "homing-offset", "axis-compliance")), None, {}
    )
    targets = build_mechanism(file.machine).forward(torch.tensor(path_of(file, 3, 40))).numpy()
    _, found, _ = check(compensator, targets, tmp_path)
    assert found.missed[found.sent].max() < 1e-9


def test_rows_that_cannot_be_sent_leave_the_machine_where_it_stands(bench: MachineFile, tmp_path: Path) -> None:
    compensator = Compensator(random_model(bench, 7, ("backlash", "link-length")), None, {})
    targets = build_mechanism(bench.machine).forward(torch.tensor(path_of(bench, 4, 40))).numpy()
    targets[[0, 9, 10, 31]] = [[900, 0, 0], [0, 0, 190], [0, 195, 0], [280, 0, 0]]
    built, found, code = check(compensator, targets, tmp_path)
    assert (~found.sent).sum() >= 3 and code >= 2
    codes, _ = built.one_by_one(targets, Context(1.3, 26.0, 0.0, 0.0))
    assert [each >= 2 for each in codes] == (~found.sent).tolist()
    for each, status in zip(codes, found.status, strict=True):
        assert (each == 3) == (status == "near singular")


def network_over(inputs: np.ndarray, seed: int, centres: int = 60) -> GaussianRbf:
    random = np.random.default_rng(seed)
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0)
    scaled = (inputs - mean) / scale
    size = inputs.shape[1]
    return GaussianRbf(
        scaling=(mean, scale), centres=scaled[random.choice(len(scaled), centres)],
        widths=random.uniform(0.4, 1.2, centres), weights=random.normal(scale=0.05, size=(centres, 3)),
        threshold=random.normal(scale=0.02, size=3), slope=random.normal(scale=0.02, size=(size, 3)),
        domain=measure_domain(scaled),
    )  # fmt: skip


def test_the_network_and_its_domain(bench: MachineFile, tmp_path: Path) -> None:
    mechanism = build_mechanism(bench.machine)
    targets = mechanism.forward(torch.tensor(path_of(bench, 8, 150))).numpy()
    network = network_over(targets[:100], 3)
    compensator = Compensator(random_model(bench, 9, ("backlash", "homing-offset", "lead-scale")), network, {})
    built, found, code = check(compensator, targets, tmp_path)
    assert code == 1 and 0.2 < found.in_domain.mean() < 0.95
    codes, _ = built.one_by_one(targets, Context(1.3, 26.0, 0.0, 0.0))
    assert [each == 1 for each in codes] == (~found.in_domain).tolist()
    # The tool that forward sees for a command without play is the target that it was made for.
    still = replace(compensator, model=compensator.model.without("backlash"))
    other = Built(still, tmp_path / "still")
    _, q = other.commands(targets[:100], Context(1.3, 26.0, 0.0, 0.0))
    np.testing.assert_allclose(other.forward(q, Context(1.3, 26.0, 0.0, 0.0)), targets[:100], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("joints", [4, 6])
def test_an_arm_beside_a_network_keeps_the_posture_of_its_places(joints: int, tmp_path: Path) -> None:
    """A search of its own for what the network asks for would end elsewhere on the arm's self-motion."""
    file = sample_machine("serial", joints)
    middle, half = np.array([0.3, 0.9, -1.2, 0.2, 0.2, 0.2]), np.array([0.5, 0.3, 0.4, 0.5, 0.5, 0.5])
    q = middle[:joints] + half[:joints] * np.random.default_rng(0).uniform(-1.0, 1.0, (100, joints))
    places = build_mechanism(file.machine).forward(torch.tensor(q)).numpy()
    _, found, _ = check(Compensator(Model(file), network_over(places, 3), {}), places[:40], tmp_path)
    assert found.in_domain.mean() > 0.8 and found.sent.mean() > 0.8


@pytest.mark.parametrize("centres", [1, 6, 60])
def test_nodes_from_needles_to_plains_are_torchs(bench: MachineFile, centres: int, tmp_path: Path) -> None:
    """The exponentials of the code are its own: from those that vanish to those that are nearly one."""
    places = np.random.default_rng(centres).normal(scale=20.0, size=(80, 3))
    plain = network_over(places, 5, centres)
    network = GaussianRbf(
        scaling=(plain.input_mean.numpy(), plain.input_scale.numpy()), centres=plain.centres.numpy(),
        widths=np.geomspace(0.01, 300.0, centres), weights=np.random.default_rng(1).uniform(-1.0, 1.0, (centres, 3)),
        threshold=np.zeros(3), slope=np.zeros((3, 3)), domain=plain.domain,
    )  # fmt: skip
    _, found, _ = check(Compensator(Model(bench), network, {}), places, tmp_path)
    assert found.in_domain.all() and found.sent.mean() > 0.5


def test_the_limit_of_a_correction_is_where_ptt_predict_has_it(bench: MachineFile, tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    targets = random.uniform((-60.0, -60.0, -40.0), (60.0, 60.0, 40.0), (60, 3))
    seen = []
    for number, size in enumerate((0.9, 4.0, 6.0)):
        offset = torch.tensor(random.uniform(-size, size, 3))
        model = Model(bench) + Term(make_effect(library(), "homing-offset"), offset)
        _, found, _ = check(Compensator(model, None, {}), targets, tmp_path / str(number))
        seen += [*found.sent]
    assert 0.1 < np.mean(seen) < 0.95


def test_the_first_row_alone_arrives_as_the_state_says_and_among_others_as_predict_has_it(
    bench: MachineFile, tmp_path: Path
) -> None:
    model = random_model(bench, 3, ("backlash",))
    path = np.array([[10.0, 5.0, 10.0], [10.0, 5.0, 5.0], [10.0, 5.0, 8.0]])  # the second row is below the first
    built, wanted = Built(Compensator(model, None, {}), tmp_path), compensate(model, make_table(path)).q
    header = (tmp_path / "ptt_model.h").read_text()
    assert "first row may differ from theirs: give the first rows to ptt_commands, or set state->dir" in header
    here = Context(0.0, bench.machine.reference_temp_c, 0.0, 0.0)
    np.testing.assert_allclose(built.commands(path, here)[1], wanted, atol=1e-9)
    alone = built.one_by_one(path, here)[1]
    gap = model.terms[0].theta.numpy()[:3]
    np.testing.assert_allclose(alone[0] - wanted[0], gap, atol=1e-9)  # upward: all of the gap above what comes down
    np.testing.assert_allclose(alone[1:], wanted[1:], atol=1e-9)


def test_targets_in_a_frame_of_their_own(bench: MachineFile, tmp_path: Path) -> None:
    stated = replace(bench, targets=TargetsSpec(origin_mm=(3.0, -2.0, 5.0), turn_deg=(0.0, 0.0, 20.0)))
    compensator = Compensator(random_model(stated, 2, ("homing-offset",)), None, {})
    targets = build_mechanism(bench.machine).forward(torch.tensor(path_of(bench, 8, 30))).numpy()
    built, found, _ = check(compensator, targets, tmp_path)
    np.testing.assert_allclose(built.forward(found.q, Context(0.0, 20.0, 0.0, 0.0)), targets, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", ["assembly_robot", "ur10"])
def test_arms_keep_the_posture_of_nominal_joint_values(name: str, tmp_path: Path) -> None:
    file = load_machine(MACHINES / f"{name}.toml")
    compensator = Compensator(random_model(file, 4), None, {})
    posture = path_of(file, 6, 60)
    targets = build_mechanism(file.machine).forward(torch.tensor(posture)).numpy()
    table = make_table(targets, posture, payload_kg=1.3, temp_c=26.0, joint_prefix="q")
    found = expected(compensator, table)
    built = Built(compensator, tmp_path)
    context = Context(1.3, 26.0, 0.0, 0.0)
    state = built.start()
    # The first row arrives as the second moves: dir follows last in the state.
    from ptt.run.direction import travel_direction

    ctypes.memmove(
        ctypes.byref(state, 8 * built.joints), travel_direction(found.q)[0].astype(float).tobytes(), 8 * built.joints
    )
    q = np.empty_like(posture)
    for row, here in zip(posture, q, strict=True):
        built.code.ptt_correct(pointer(np.ascontiguousarray(row)), ctypes.byref(context), state, pointer(here))
    np.testing.assert_array_equal(np.isfinite(q).all(axis=1), found.sent)
    assert found.sent.mean() > 0.7
    sent = found.sent
    np.testing.assert_allclose(q[sent], found.q[sent], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(
        built.forward(q[sent], context), built.forward(found.q[sent], context), rtol=0.0, atol=1e-9
    )


def test_the_self_test_runs_clean_under_sanitisers_and_fails_on_other_numbers(
    bench: MachineFile, tmp_path: Path
) -> None:
    file = replace(bench, controller=ControllerSpec(compensates=("windup",)))
    names = ("homing-offset", "backlash", "windup", "screw-error-map", "following-error")
    model = random_model(file, 3, names)
    model = model + Term(
        make_effect(library(), "following-error"), torch.tensor([0.02, 0.02, 0.02, 0.0], dtype=torch.float64)
    )
    result = write(Compensator(model, None, {}), tmp_path, Options())
    assert [item.effect for item in result.cannot_hold] == ["following-error", "windup"]
    assert set(result.holds) == {"homing-offset", "backlash", "screw-error-map"}
    build = ["gcc", *FLAGS, "-o", "t", "ptt_model.c", "ptt_selftest.c", "-lm"]
    subprocess.run([*build, *SANITISED], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "t"], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "ok" in done.stdout, done.stdout + done.stderr
    text = (tmp_path / "ptt_model.c").read_text()
    gap = text.split("ptt_gap[3]")[1].split("{")[1].split("}")[0]
    (tmp_path / "ptt_model.c").write_text(text.replace(gap, "0.1, 0.1, 0.1"))
    subprocess.run(build, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "t"], capture_output=True, check=False).returncode == 1


def test_points_lie_on_either_side_of_the_middle_of_their_stretch() -> None:
    points = np.random.default_rng(1).normal(size=(37, 3))
    tree = points[tree_order(points)]

    def sound(first: int, end: int, depth: int) -> bool:
        if end - first < 2:
            return True
        middle, axis = (first + end) // 2, depth % 3
        low, high = tree[first:middle, axis], tree[middle + 1 : end, axis]
        here = tree[middle, axis]
        parted = (low <= here).all() and (high >= here).all()
        return bool(parted) and sound(first, middle, depth + 1) and sound(middle + 1, end, depth + 1)

    assert sound(0, 37, 0) and sorted(map(tuple, tree)) == sorted(map(tuple, points))
