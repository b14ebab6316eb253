"""Challenges: the same seed gives the same bytes, and the seal holds."""

import json
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import (
    LEVELS,
    bench,
    draw_level,
    new_challenge,
    open_challenge,
    seal,
    unseal,
)
from ptt.challenge.hide import FAULTS, clear_faults, hide_faults
from ptt.challenge.score import judge, score
from ptt.challenge.truth import find_truth, table_of, without_rigid_motion
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.errors import InputError
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.rig.draw import draw_rig
from ptt.run.axes import rms_length
from ptt.run.problem import build_problem
from ptt.run.reading import read_table

DATA = Path(__file__).resolve().parents[1] / "data"
KNOWN = library()
FILES = ("machine.toml", "run.csv", "targets.csv", "sealed.json")


def drawn_with(*names: str, seed: int = 1, protocol="volume", rows: int = 160):
    return hide_faults(draw_rig(seed, bench(), protocol, rows=rows), names, seed)


# --- new and the seal ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [*LEVELS, "any"])
def test_the_same_seed_gives_the_same_bytes(level, tmp_path: Path) -> None:
    for name in ("a", "b"):
        made = new_challenge(tmp_path / name, level, seed=5, rows=60)
        assert made.rows <= 70
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    other = new_challenge(tmp_path / "c", level, seed=6, rows=60)
    assert (other.folder / "run.csv").read_bytes() != (tmp_path / "a" / "run.csv").read_bytes()


@pytest.mark.parametrize("level", LEVELS)
def test_a_foreign_challenge_is_a_machine_of_its_own(level, tmp_path: Path) -> None:
    made = new_challenge(tmp_path / "a", level, seed=9, rows=60, foreign=True)
    new_challenge(tmp_path / "b", level, seed=9, rows=60, foreign=True)
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    file = load_machine(made.folder / "machine.toml")
    opened = open_challenge(made.folder).drawn
    assert file.machine != bench().machine and opened.rig.spec == file.machine
    assert bool(opened.truth) == (level != "none")
    run = read_table(made.folder / "run.csv")
    again = simulate(opened.rig, opened.targets).frame
    np.testing.assert_allclose(again[["x_meas", "y_meas", "z_meas"]], run.measured, atol=5.1e-5)
    with pytest.raises(InputError, match="--foreign"):
        new_challenge(tmp_path / "c", level, machine=bench(), foreign=True)


def test_without_a_seed_every_challenge_is_another(tmp_path: Path) -> None:
    runs = {(new_challenge(tmp_path / str(i), "none", rows=40).folder / "run.csv").read_bytes() for i in range(3)}
    assert len(runs) == 3


def test_any_draws_every_level() -> None:
    assert {draw_level("any", seed) for seed in range(60)} == set(LEVELS)
    assert draw_level("single", 3) == "single"


def test_nothing_but_the_seal_tells_what_is_hidden(tmp_path: Path) -> None:
    for seed in range(4):
        folder = new_challenge(tmp_path / str(seed), "any", seed=seed, rows=60).folder
        (name, *_) = (*open_challenge(folder).drawn.truth, "backlash")
        for file in FILES:
            text = (folder / file).read_text()
            section = FAULTS[name].section  # a drawing has [tracker] as well
            assert name not in text and (section == "tracker" or section not in text.replace("hidden faults", ""))


def test_the_seal_gives_back_rig_targets_and_truth(tmp_path: Path) -> None:
    folder = new_challenge(tmp_path / "c", "multi", seed=11, rows=60).folder
    opened = open_challenge(folder)
    drawn = draw(plan("multi", 1, 11, bench=bench(), rows=60)[0])[0]
    assert opened.level == "multi" and opened.drawn.truth == drawn.truth and opened.drawn.protocol == drawn.protocol
    again = simulate(opened.drawn.rig, opened.drawn.targets).frame
    run = read_table(folder / "run.csv")
    np.testing.assert_allclose(again[["x_meas", "y_meas", "z_meas"]], run.measured, atol=5.1e-5)
    assert unseal(seal(opened.drawn, "multi")).drawn.truth == drawn.truth


def test_targets_hold_what_predict_needs_and_no_reading(tmp_path: Path) -> None:
    folder = new_challenge(tmp_path / "c", "single", seed=0, rows=60).folder
    run, targets = read_table(folder / "run.csv"), read_table(folder / "targets.csv", purpose="targets")
    assert np.isnan(targets.measured).all() and targets.command is None
    np.testing.assert_array_equal(targets.target, run.target)
    for name in ("payload_kg", "temp_c", "time_s", "feed_mm_s"):
        np.testing.assert_array_equal(getattr(targets, name), getattr(run, name))


@pytest.mark.parametrize("key", ["sealed", "sha256"])
def test_a_changed_seal_is_refused(key: str, tmp_path: Path) -> None:
    folder = new_challenge(tmp_path / "c", "single", seed=2, rows=60).folder
    path = folder / "sealed.json"
    whole = json.loads(path.read_text())
    middle = len(whole[key]) // 2
    swapped = "A" if whole[key][middle] != "A" else "B"
    whole[key] = whole[key][:middle] + swapped + whole[key][middle + 1 :]
    path.write_text(json.dumps(whole))
    with pytest.raises(InputError, match="was changed since it was sealed"):
        open_challenge(folder)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        '{"sealed": "??", "sha256": ""}',
        '{"sealed": "\u00e4", "sha256": ""}',
        '{"sealed": 3, "sha256": ""}',
    ],
)
def test_what_is_no_seal_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="not a sealed challenge"):
        unseal(text)


def test_bad_input_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="level 'hard'"):
        new_challenge(tmp_path / "a", "hard")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"--seed: no file can hold the seed 9{20}"):  # its seal could not be opened
        new_challenge(tmp_path / "d", "none", seed=10**20 - 1)
    with pytest.raises(InputError, match="too few"):
        new_challenge(tmp_path / "a", "none", rows=5)
    with pytest.raises(InputError, match="no challenge"):
        open_challenge(tmp_path)
    new_challenge(tmp_path / "a", "none", rows=40)
    with pytest.raises(InputError, match="holds a challenge already"):
        new_challenge(tmp_path / "a", "none")
    with pytest.raises(InputError, match="hidden already"):
        hide_faults(drawn_with("backlash"), ["backlash"], 0)


def test_the_bench_is_the_machine_of_the_sample_data() -> None:
    sample = load_machine(DATA / "machine.toml")
    assert bench().machine == sample.machine and bench().tracker.sigma_mm == sample.tracker.sigma_mm
    assert bench().tracker.frame == "fitted" and not bench().tracker.base_point


# --- hiding and the truth -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAULTS)
def test_a_hidden_fault_shows_and_can_be_taken_out_again(name: str) -> None:
    protocol = FAULTS[name].protocols[0]
    plain = draw_rig(4, bench(), protocol, rows=60)
    faulty = hide_faults(plain, [name], 4)
    assert set(faulty.truth) == {name}
    assert faulty.rig != plain.rig
    assert clear_faults(faulty.rig, faulty.truth, [name]) == plain.rig


def test_size_is_what_the_best_rigid_motion_leaves() -> None:
    drawn = drawn_with("homing-offset", seed=3)
    (fault,) = find_truth(drawn, KNOWN).faults
    sound = simulate(clear_faults(drawn.rig, drawn.truth, drawn.truth), drawn.targets, noise=False)
    went, wanted = simulate(drawn.rig, drawn.targets, noise=False).truth, sound.truth
    assert fault.counts
    # A rotation by milliradians is its first order to within 1e-6 of 100 mm.
    assert fault.size == pytest.approx(rms_length(without_rigid_motion(went - wanted, wanted)), rel=1e-3)
    assert fault.size < rms_length(went - wanted)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_a_sound_machine_is_left_alone(seed: int) -> None:
    drawn = draw_rig(seed, bench(), "volume")
    found = diagnose(Model(bench()), build_problem(bench(), table_of(simulate(drawn.rig, drawn.targets).frame)))
    assert (
        found.verdict == "nothing-missing"
        and judge([step[0] for step in found.suggested], find_truth(drawn, KNOWN)).right
    )


# --- the sample runs ----------------------------------------------------------------------------------------------


def test_the_sealed_samples_are_what_their_script_writes(tmp_path: Path) -> None:
    script = runpy.run_path(str(DATA / "make_sealed.py"))
    script["main"](tmp_path)
    for folder, count in (("sealed_one", 1), ("sealed_three", 3)):
        for name in ("machine.toml", "run.csv", "targets.csv"):
            assert (tmp_path / folder / name).read_bytes() == (DATA / folder / name).read_bytes()
        truth = find_truth(open_challenge(DATA / folder).drawn, KNOWN)
        assert len(truth.faults) == count
        assert all(fault.size > 3.0 * truth.noise.total for fault in truth.faults)
    run = read_table(DATA / "sealed_three" / "run.csv")
    assert np.ptp(run.payload_kg) > 5.0 and np.ptp(run.temp_c) > 8.0


# --- serial arms --------------------------------------------------------------------------------------------------

ARM = DATA / "arm" / "machine.toml"


def test_an_arm_is_sealed_opened_and_its_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        new_challenge(tmp_path / name, "multi", seed=3, rows=30, machine=load_machine(ARM))
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    opened = open_challenge(tmp_path / "a").drawn
    assert len(opened.truth) > 1 and set(opened.truth) <= set(KNOWN)
    run = read_table(tmp_path / "a" / "run.csv", 6, joint_prefix="q")
    again = simulate(opened.rig, opened.targets).frame
    np.testing.assert_allclose(again[["x_meas", "y_meas", "z_meas"]], run.measured, atol=5.1e-5)
    wanted = read_table(tmp_path / "a" / "targets.csv", 6, joint_prefix="q", purpose="targets")
    assert np.isnan(wanted.measured).all()
    np.testing.assert_array_equal(wanted.command, run.command)
    assert clear_faults(opened.rig, opened.truth, opened.truth).arm.model_dump(
        exclude_defaults=True, exclude={"reflector_mm"}
    ) == {}  # fmt: skip


def test_a_given_arm_keeps_its_file_and_is_drawn_at_every_level(tmp_path: Path) -> None:
    for level in LEVELS:
        folder = new_challenge(tmp_path / level, level, seed=2, rows=24, machine=load_machine(ARM)).folder
        assert (folder / "machine.toml").read_text() == ARM.read_text()
        assert bool(open_challenge(folder).drawn.truth) == (level != "none")
        assert {"x_cmd", "payload_kg", "temp_c"} <= set(pd.read_csv(folder / "run.csv"))


@pytest.mark.parametrize("joints", [1, 2, 3, pytest.param(6, marks=pytest.mark.long)])
def test_an_arm_of_few_joints_or_with_limits_on_one_side_of_zero_is_drawn(joints: int) -> None:
    file = load_machine(ARM)
    limits = ((30.0, 150.0), (-170.0, -120.0), (0.0, 90.0))
    links = [
        link.model_copy(update={"limits_deg": limits[number % 3], "mass_kg": None, "com_mm": None})
        for number, link in enumerate(file.machine.joint[:joints])
    ]
    short = replace(file, machine=file.machine.model_copy(update={"joint": tuple(links)}), text="")
    for case in plan("single", 14, 0, bench=short, arm=True, rows=24)[joints % 3 :: 3]:  # faults in turn
        drawn, _ = draw(case)
        assert np.isfinite(simulate(drawn.rig, drawn.targets).truth).all()
        assert any(np.any(values) for values in drawn.truth[case.faults[0]].values())


def test_a_model_of_an_arm_is_scored_and_its_commands_hit(tmp_path: Path) -> None:
    """Play of the first two joints by hand: found by its name, missed by another, and taken out of the tool's error."""
    plain = draw(plan("none", 1, 0, bench=load_machine(ARM), arm=True, rows=60)[0])[0]
    play = {"backlash_mrad": [0.8, 0.6, 0.0, 0.0, 0.0, 0.0]}
    arm = type(plain.rig.arm).model_validate(plain.rig.arm.model_dump() | play)
    drawn = replace(plain, rig=replace(plain.rig, arm=arm), truth={"backlash": play})
    file = drawn.rig.machine
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame))
    truth = find_truth(drawn, KNOWN)
    assert truth.hidden == ("backlash",) and truth.faults[0].counts
    model = fit(Model(file) + make_effect(KNOWN, "backlash"), problem).model
    result = score(model, truth)
    tool = result.tool.to_dict()
    assert result.judgement.right and tool["after"] is not None
    # Half a gap on levers of 0.6 m (rms of UR10 poses about its first two axes) is 0.2 to 0.4 mm.
    assert 100.0 < tool["before"]["total"] < 600.0 and tool["after"]["total"] < 0.1 * tool["before"]["total"]
    assert not score(Model(file), truth).judgement.right
