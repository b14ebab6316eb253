"""Challenges: names are judged and models scored by the truth."""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from test_challenge import drawn_with
from typer.testing import CliRunner

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import (
    bench,
    new_challenge,
    open_challenge,
    write_challenge,
)
from ptt.challenge.remeasure import remeasure
from ptt.challenge.score import judge, score
from ptt.challenge.truth import READINGS, UM_PER_MM, find_truth, table_of, without_rigid_motion
from ptt.commands.challenge import app
from ptt.diagnosis.diagnose import diagnose
from ptt.door.simulating import simulate as simulated
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.fitting.solve import fit
from ptt.machine import load_machine, save_machine
from ptt.model.entries import write_model
from ptt.model.model import Model, Term
from ptt.rig import simulate
from ptt.rig.draw import draw_rig
from ptt.run.axes import rms_length
from ptt.run.problem import build_problem
from ptt.run.reading import read_table

KNOWN = library()


def fitted(drawn, *names: str) -> Model:
    model = Model(bench())
    for name in names:
        model = model + make_effect(KNOWN, name)
    return fit(model, build_problem(bench(), table_of(simulate(drawn.rig, drawn.targets).frame))).model


# --- judging ------------------------------------------------------------------------------------------------------


def test_the_true_names_are_right() -> None:
    truth = find_truth(drawn_with("backlash", "lead-scale", "tower-tilt"), KNOWN)
    judgement = judge(("tower-tilt", "backlash", "lead-scale"), truth)
    assert judgement.right
    assert set(judgement.named.values()) == {"right"}


def test_a_missing_a_wrong_and_a_second_name() -> None:
    truth = find_truth(drawn_with("backlash"), KNOWN)
    assert truth.faults[0].counts
    assert judge((), truth).faults == {"backlash": "missed"} and not judge((), truth).right
    wrong = judge(("tower-tilt",), truth)
    assert wrong.faults == {"backlash": "missed"} and wrong.named == {"tower-tilt": "wrong"}
    extra = judge(("backlash", "once-per-rev"), truth)
    assert extra.faults == {"backlash": "found"} and extra.named["once-per-rev"] == "wrong" and not extra.right
    assert judge(("backlash", "backlash[second]"), truth).named["backlash[second]"] == "wrong"


def test_nothing_hidden_nothing_named() -> None:
    truth = find_truth(draw_rig(3, bench(), "volume", rows=80), KNOWN)
    assert judge((), truth).right
    assert not judge(("homing-offset",), truth).right


def test_a_fault_too_small_to_count_need_not_be_named() -> None:
    drawn = drawn_with("lead-scale")
    drive = drawn.rig.drive.model_copy(update={"scale_um_per_m": (1.0, 0.0, 0.0)})
    small = replace(
        drawn, rig=replace(drawn.rig, drive=drive), truth={"lead-scale": {"scale_um_per_m": [1.0, 0.0, 0.0]}}
    )
    truth = find_truth(small, KNOWN)
    assert judge((), truth).faults == {"lead-scale": "too small"} and judge((), truth).right
    assert judge(("lead-scale",), truth).right
    assert not judge(("backlash",), truth).right


def test_exact_ambiguities_are_fair_names() -> None:
    """A common lead error is tracker scale less links and radius, a common zero being the tracker's z."""
    drawn = draw_rig(7, bench(), "volume", rows=160)
    rig = replace(drawn.rig, drive=drawn.rig.drive.model_copy(update={"scale_um_per_m": (500.0,) * 3}))
    truth = find_truth(replace(drawn, rig=rig, truth={"lead-scale": {"scale_um_per_m": [500.0] * 3}}), KNOWN)
    assert truth.faults[0].counts
    judgement = judge(("tracker-scale", "link-length", "tower-position"), truth)
    assert judgement.faults == {"lead-scale": "explained"} and judgement.right
    assert "tracker-scale" in judgement.instead["lead-scale"]
    assert judge(("tracker-scale",), truth).faults == {"lead-scale": "missed"}
    assert judge(("tracker-drift",), truth).named == {"tracker-drift": "wrong"}


def test_a_fault_outside_the_library_makes_helping_effects_partial() -> None:
    truth = find_truth(drawn_with("hose", seed=3), KNOWN)
    assert not truth.faults[0].known
    judgement = judge(("screw-error-map",), truth)
    assert judgement.faults == {"hose": "missed"}
    assert judgement.named["screw-error-map"] in ("partial", "wrong") and not judgement.right


def test_zeros_named_for_link_parameters_of_an_arm_are_judged() -> None:
    """A model has one of the two, but whether zeros do all of the work of link parameters is asked with both."""
    cases = plan("single", 40, 94900, arm=True, bench=None, rows=60, visible=True)
    case = next(case for case in cases if case.faults == ("dh-offsets",))
    _, truth = draw(case)
    judgement = judge(("homing-offset",), truth)
    assert judgement.faults == {"dh-offsets": "missed"} and judgement.named == {"homing-offset": "wrong"}


# --- reveal -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("protocol", "names"),
    [
        ("volume", ("homing-offset", "once-per-rev")),
        ("payload", ("axis-compliance", "backlash")),
        ("path", ("windup",)),
    ],
)
def test_the_true_model_scores_full_and_puts_the_tool_where_it_should_be(protocol, names) -> None:
    drawn = drawn_with(*names, seed=2, protocol=protocol)
    truth = find_truth(drawn, KNOWN)
    result = score(fitted(drawn, *names), truth).to_dict()
    assert result["right"]
    assert {item["effect"] for item in result["hidden"]} == set(names) and all(
        item["model"] for item in result["hidden"]
    )
    assert result["left_um"] < 0.1 * result["noise_um"]["total"]
    error = result["tool_error_um"]
    assert error["before"]["total"] == pytest.approx(_tool_error(drawn), rel=1e-3)
    assert error["after"]["total"] < 0.3 * min(error["before"]["total"], result["noise_um"]["total"] * 4.0)
    if len(names) > 1:
        missing = score(fitted(drawn, truth.hidden[1]), truth).to_dict()
        assert not missing["right"] and missing["tool_error_um"]["after"]["total"] > 2.0 * error["after"]["total"]


def test_a_model_of_the_right_name_and_the_wrong_sign_is_not_right() -> None:
    drawn = drawn_with("backlash", seed=2, rows=40)
    truth, model = find_truth(drawn, KNOWN), fitted(drawn, "backlash")
    term = model.terms[0]
    turned = replace(model, terms=(replace(term, theta=-term.theta),))
    good, bad = (score(each, truth).to_dict() for each in (model, turned))
    assert good["right"] and not good["worse"]
    assert not bad["right"] and bad["worse"]


def test_places_that_a_run_only_passes_are_not_measured_again() -> None:
    drawn, _ = draw(plan("multi", 1, 1010056)[0])  # every pose is approached from below, from a place without a reading
    frame = simulate(drawn.rig, drawn.targets, noise=False).frame
    read = frame["x_meas"].notna().sum()
    tool = remeasure(Model(drawn.rig.machine), drawn)
    assert len(tool.before) == read < len(frame) and tool.after is not None and tool.missed is not None
    assert len(tool.after) == len(tool.missed) == read


def _tool_error(drawn) -> float:
    run = simulate(drawn.rig, drawn.targets, noise=False)
    wanted = run.frame[["x_cmd", "y_cmd", "z_cmd"]].to_numpy(float)
    return UM_PER_MM * rms_length(without_rigid_motion(run.truth - wanted, wanted))


def test_the_wrong_model_scores_wrong_and_makes_the_tool_worse() -> None:
    drawn = drawn_with("backlash", seed=5)
    wrong = Model(bench()) + Term(
        make_effect(KNOWN, "homing-offset"), torch.tensor([0.3, -0.2, 0.0], dtype=torch.float64)
    )
    result = score(wrong, find_truth(drawn, KNOWN)).to_dict()
    assert not result["right"]
    assert result["hidden"][0]["is"] == "missed" and result["hidden"][0]["model"] is None
    assert [(item["effect"], item["is"]) for item in result["named"]] == [("homing-offset", "wrong")]
    assert result["tool_error_um"]["after"]["total"] > result["tool_error_um"]["before"]["total"]


def test_a_size_of_the_drawing_that_stays_near_zero_claims_nothing() -> None:
    """`ptt add --sizes` keeps all sizes in the model, so that a target elsewhere knows how uncertain it is."""
    drawn = drawn_with("backlash", seed=5)
    truth, found = find_truth(drawn, KNOWN), fitted(drawn, "backlash")
    words = []
    for values, measured in (([2e-4, -1e-4, 0.0], True), ([0.3, -0.2, 0.0], False), ([0.3, -0.2, 0.0], True)):
        zeros = Term(
            make_effect(KNOWN, "homing-offset"), torch.tensor(values, dtype=torch.float64),
            std=torch.full((3,), 1e-4, dtype=torch.float64), measured=torch.full((3,), measured),
        )  # fmt: skip
        result = score(found + zeros, truth)
        words.append((result.judgement.named["homing-offset"], result.judgement.right))
    assert words == [("unclaimed", True), ("unclaimed", True), ("wrong", False)]


def test_metrology_is_never_sent_to_the_machine() -> None:
    drawn = drawn_with("setup-jump", seed=2)
    tool = remeasure(fitted(drawn, "setup-jump"), drawn).to_dict()
    assert tool["before"]["total"] < 1e-3 and tool["after"]["total"] < 1e-3


def test_commands_that_the_machine_cannot_follow_are_said_to_be_so() -> None:
    far = Model(bench()) + Term(make_effect(KNOWN, "homing-offset"), torch.full((3,), 300.0, dtype=torch.float64))
    assert remeasure(far, drawn_with("backlash")).to_dict()["after"] is None


def test_reveal_on_the_command_line(tmp_path: Path) -> None:
    run = CliRunner()
    made = run.invoke(app, ["new", str(tmp_path / "c"), "--level", "single", "--seed", "3", "--json"])
    assert made.exit_code == 0, made.output
    assert json.loads(made.stdout)["level"] == "single" and "seed" not in made.stdout
    drawn = run.invoke(app, ["new", str(tmp_path / "any"), "--rows", "60", "--json"])
    assert drawn.exit_code == 0 and json.loads(drawn.stdout)["level"] == "any"
    opened = open_challenge(tmp_path / "c").drawn
    (name,) = opened.truth
    save_machine(write_model(fitted(opened, name)), tmp_path / "m.toml")
    shown = run.invoke(app, ["reveal", str(tmp_path / "c"), "--model", str(tmp_path / "m.toml"), "--json"])
    assert shown.exit_code == 0, shown.output
    data = json.loads(shown.stdout)
    assert data["right"] and data["level"] == "single" and data["hidden"][0]["effect"] == name
    text = run.invoke(app, ["reveal", str(tmp_path / "c"), "--model", str(tmp_path / "m.toml")]).stdout
    assert text.rstrip().endswith("RIGHT") and "NOT RIGHT" not in text and name in text
    bare = run.invoke(app, ["reveal", str(tmp_path / "c"), "--model", str(tmp_path / "c" / "machine.toml")]).stdout
    assert "MISSED" in bare and bare.rstrip().endswith("NOT RIGHT")
    assert run.invoke(app, ["reveal", str(tmp_path / "c")]).stdout == bare


@pytest.mark.parametrize("case", [("payload", 4), ("warmup", 5), ("slip", 6)])
def test_the_opened_rig_measures_the_targets_again_as_they_were_measured(case, tmp_path: Path) -> None:
    """Each visit once, under the load and at the temperature that it had: what was sent for it is right for it."""
    kind, seed = case
    names = ["homing-slip", "setup-jump"] if kind == "slip" else []
    drawn = drawn_with(*names, seed=seed, protocol="payload" if kind == "slip" else kind, rows=90)
    drawn = replace(drawn, rig=replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update={"datum_every": 20})))
    folder = write_challenge(tmp_path / "c", drawn, "multi").folder
    opened = CliRunner().invoke(app, ["reveal", str(folder), "--rig", str(tmp_path / "rig.toml")])
    assert opened.exit_code == 0, opened.output
    before = pd.read_csv(folder / "run.csv")
    again = simulated(tmp_path / "rig.toml", folder / "targets.csv", noise=False).to_frame()
    conditions = ["name", "role", "run", "repeat", "time_s", "payload_kg", "temp_c", "feed_mm_s", "x_cmd"]
    pd.testing.assert_frame_equal(again[conditions], before[conditions], rtol=0.0, atol=1e-3)
    left = before[READINGS].to_numpy() - again[READINGS].to_numpy()
    if kind == "slip":  # what slipped and what was knocked over in the run lies where it lay at its end
        assert np.abs(left[-10:]).max() < 0.05 < np.abs(left[:10]).max()
    else:
        assert np.abs(left).max() < 0.05


@pytest.mark.parametrize(
    "seed", [12, pytest.param(13, marks=pytest.mark.long), pytest.param(14, marks=pytest.mark.long)]
)
def test_a_fresh_rig_is_diagnosed_right(seed: int, tmp_path: Path) -> None:
    folder = new_challenge(tmp_path / "c", "single", seed=seed).folder
    file = load_machine(folder / "machine.toml")
    found = diagnose(Model(file), build_problem(file, read_table(folder / "run.csv")))
    truth = find_truth(open_challenge(folder).drawn, KNOWN)
    result = score(found.model, truth)
    choices = [judge(names, truth).right for names in product(*found.suggested)]  # what is tied is one statement
    assert any(choices), (found.suggested, truth.hidden)
    assert result.tool.to_dict()["after"]["total"] < 1.3 * UM_PER_MM * truth.noise.total
