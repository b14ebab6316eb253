"""The sweep that judges diagnoses: its cases, its judgements against known truths, its tables."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import sweep_judge

from ptt.challenge.cases import VISIBLE, Case, draw, names_of, plan
from ptt.challenge.challenge import bench
from ptt.challenge.hide import FAULTS, hide_faults
from ptt.challenge.truth import find_truth, table_of
from ptt.effects import library
from ptt.effects.layout import linear_size
from ptt.effects.registry import make_effect
from ptt.fitting.solve import fit
from ptt.model.model import Model, parameter_names
from ptt.rig import simulate
from ptt.rig.draw import draw_rig
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.draw_noise import NOISES
from ptt.run.problem import build_problem

KNOWN = library()
GAUGE_FREE = {
    "backlash": "volume",
    "over-compensation": "volume",
    "homing-slip": "volume",
    "lead-scale": "volume",
    "following-error": "speed",
    "axis-compliance": "payload",
    "link-compliance": "payload",
    "column-bend": "payload",
    "frame-growth": "warmup",
}


# --- cases ---------------------------------------------------------------------------------------------------------


def test_a_plan_goes_through_all_faults_noises_and_numbers() -> None:
    single = plan("single", len(names_of("single")), 0)
    assert {case.faults[0] for case in single} == set(names_of("single")) >= {"homing-slip", "over-compensation"}
    assert {case.noise for case in plan("none", 18, 0)} == set(NOISES)
    assert {case.noise for case in plan("none", 5, 0, noise="heavy")} == {"heavy"}
    assert {len(case.faults) for case in plan("multi", 40, 0)} == {2, 3, 4, 5}
    for case in plan("multi", 40, 0):
        assert len({FAULTS[name].called for name in case.faults}) == len(case.faults)
    assert plan("multi", 5, 3) == plan("multi", 8, 0)[3:]


def test_unseen_kinds_are_kept_apart() -> None:
    shown, unseen = names_of("unknown", "shown"), names_of("unknown", "unseen")
    assert not set(shown) & set(unseen) and set(names_of("unknown")) == {*shown, *unseen}
    used = {case.faults[0] for case in plan("unknown", 100, 0, kinds="shown")}
    assert used == set(shown) and all(not FAULTS[name].unseen for name in used)


def test_faults_are_drawn_until_they_can_be_seen() -> None:
    for level, number in (("single", 5), ("multi", 0), ("unknown", 3)):
        case = plan(level, 1, number)[0]
        drawn, truth = draw(case)
        again, _ = draw(case)
        assert drawn.rig == again.rig and list(drawn.truth) == list(again.truth)
        for fault in truth.faults:
            # Alone it is of that size; among others it is so nearly, since errors this small add up.
            assert VISIBLE[0] * 0.8 < fault.size / truth.noise.total < VISIBLE[1] * 1.2, fault.name
        assert drawn.notes["noise"] == case.noise
    assert draw(Case(3, "none", "volume", ()))[0].truth == {}


def test_the_bench_with_any_noise() -> None:
    drawn, _ = draw(Case(2, "single", "volume", ("backlash",), "quantised", bench=bench()))
    assert drawn.rig.machine.machine == bench().machine and drawn.rig.tracker.quantum_um > 0.0


# --- judgements ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hidden():
    """A rail that leans and a nut that the payload loosens in one rig."""
    drawn = hide_faults(draw_rig(4, bench(), "payload", rows=210), ["tower-tilt", "load-backlash"], 9)
    return drawn, find_truth(drawn, KNOWN)


def test_names_are_right_kin_or_wrong(hidden) -> None:
    drawn, truth = hidden
    found = sweep_judge.judge_names([["tower-tilt"], ["backlash"], ["setup-jump"]], truth, drawn)
    assert found["words"]["tower-tilt"] == "right"
    assert found["words"]["backlash"] == "kin"
    assert found["words"]["setup-jump"] in ("wrong", "partial")
    assert not found["explained"]
    assert sweep_judge.judge_names([], truth, drawn)["outcome"] == "missed"


def test_what_a_reader_is_told_to_expect_is_the_held_out_error_and_what_no_reading_shows() -> None:
    last = {"heldout_rms_um": {"before": 9.0, "after": 3.0}, "tool_doubt_um": 4.0}
    first = {"heldout_rms_um": {"before": 20.0, "after": 9.0}, "tool_doubt_um": None}
    said = {"suggested": [["a"], ["b"]], "candidates": [first, last, first]}
    assert sweep_judge.printed_heldout(said) == pytest.approx(5.0)
    assert sweep_judge.printed_heldout({**said, "candidates": [last, first]}) == pytest.approx(9.0)
    assert sweep_judge.printed_heldout({"suggested": [], "candidates": [first]}) is None


def test_verdicts(hidden) -> None:
    _, both = hidden
    known = replace(both, faults=tuple(fault for fault in both.faults if fault.known))
    small = replace(both, faults=tuple(replace(fault, counts=False) for fault in both.faults))
    nothing = replace(both, faults=())
    words = ("missing", "nothing-missing", "unknown")

    def right(truth, explained: bool = False) -> list[bool | None]:
        return [sweep_judge.verdict_right(word, truth, explained) for word in words]

    assert all(fault.counts for fault in both.faults)
    assert right(both) == [False, False, True]
    assert right(both, explained=True) == [True, False, True]
    assert right(known) == [True, False, False]
    assert right(nothing) == [False, True, False]
    assert right(small) == [None, None, None]


def test_leading_variables(hidden) -> None:
    drawn, _ = hidden
    leg = drawn.truth["load-backlash"]["leg"]
    other = leg % 3 + 1

    def first(on: str):
        return sweep_judge.leading([{"on": on}], drawn)

    assert first(f"direction{leg}")["right"] and first("payload")["right"]
    assert not first("x")["near"] and not first(f"direction{other}")["right"]
    assert not sweep_judge.leading([], drawn)["right"]
    sound = replace(drawn, truth={"tower-tilt": drawn.truth["tower-tilt"]})
    assert sweep_judge.leading([], sound) is None
    # In a room that warms up steadily time says what temperature says, and a pose does not.
    warm = hide_faults(draw_rig(4, bench(), "warmup", rows=80), ["warm-backlash"], 1)
    frame = simulate(warm.rig, warm.targets, noise=False).frame
    assert np.corrcoef(frame["time_s"], frame["temp_c"])[0, 1] > sweep_judge.ALIKE
    assert sweep_judge.near("time", ["temperature"], warm) and not sweep_judge.near("x", ["temperature"], warm)


def test_statements_are_probabilities_with_what_was_so() -> None:
    result = {
        "verdict": "missing",
        "candidates": [
            {"effect": "backlash", "probability": 0.97},
            {"effect": "windup", "probability": 0.4},
            {"effect": "x"},
        ],
        "verdict_probability": {"missing": 0.9, "unknown": 0.1},
    }
    words = {"backlash": "right", "windup": "wrong"}
    assert sweep_judge.statements(result, words, True) == [(0.97, True), (0.4, False), (0.9, True)]
    assert sweep_judge.statements(result, words, None) == [(0.97, True), (0.4, False)]


def test_parameters_that_are_compared_exist() -> None:
    for effect, parameters in sweep_judge.SAME.items():
        names = {name.partition(" ")[0] for name in parameter_names(KNOWN[effect](), "three-ptt", 3)}
        assert set(parameters) <= names, effect


@pytest.mark.parametrize(("fault", "protocol"), GAUGE_FREE.items())
def test_pulls_compare_like_with_like(fault: str, protocol: str) -> None:
    """A fit to the run without noise gives back the rig's own values, so that a pull there is next to nothing."""
    sound = draw_rig(3, bench(), protocol)
    drawn = hide_faults(sound, [fault], 3)
    truth = find_truth(drawn, KNOWN)
    effect = FAULTS[fault].called
    model = fit(Model(bench()) + make_effect(KNOWN, effect), truth.problem, noise=truth.noise).model
    names = parameter_names(model.terms[0].effect, "three-ptt", 3)
    largest = float(model.terms[0].theta[: linear_size(model.terms[0].effect, 3)].abs().max())
    values = [
        {"name": name, "value": float(value), "std": 0.03 * largest}
        for name, value in zip(names, model.terms[0].theta, strict=True)
    ]
    found = sweep_judge.pulls({"candidates": [{"effect": effect, "parameters": values}]}, truth, drawn)
    assert found and max(abs(pull) for _, pull in found) < 1.0, found
    moved = [item | {"value": item["value"] + 0.15 * largest} for item in values]
    off = sweep_judge.pulls({"candidates": [{"effect": effect, "parameters": moved}]}, truth, drawn)
    np.testing.assert_allclose([pull for _, pull in off], [pull + 5.0 for _, pull in found])


def test_a_perfect_model_reaches_the_noise_and_an_absurd_one_is_worse() -> None:
    drawn = hide_faults(draw_foreign(6, noise="white", rows=80), ["lead-scale"], 2)
    truth = find_truth(drawn, KNOWN)
    file = drawn.rig.machine
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    model = fit(Model(file) + make_effect(KNOWN, "lead-scale"), problem).model
    good = sweep_judge.reached(model, drawn, truth, 1e3 * truth.noise.total)
    assert good["after"] < 0.5 * good["before"] and not good["worse"]
    # The noise of this run is that of any run but for what few readings leave to chance.
    assert good["rosy"] == pytest.approx(np.hypot(good["after"], 1.0), rel=0.25)
    assert good["unforeseen"] == good["rosy"]  # of a bare fit, commands know nothing of how sure they are
    turned = replace(model, terms=(replace(model.terms[0], theta=-4.0 * model.terms[0].theta),))
    assert sweep_judge.reached(turned, drawn, truth, None)["worse"]


def test_datum_visits_are_corrected_with_the_rest() -> None:
    """Commands may be given for what the rig visits by itself, too."""
    drawn = draw_foreign(3, path="walk", rows=60, repeats="none", noise="white")
    rig = replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update={"datum_every": 7}))
    frame = simulate(rig, drawn.targets, noise=False).frame
    poses = frame[frame["role"] != "base"]
    sent = pd.DataFrame(poses[["b1_cmd", "b2_cmd", "b3_cmd"]].to_numpy() + 0.5, columns=["b1", "b2", "b3"])
    assert len(sent) > len(drawn.targets)
    moved = simulate(rig, drawn.targets, sliders=sent, noise=False).frame
    lifted = moved[moved["role"] != "base"]
    np.testing.assert_allclose(lifted["b2_cmd"].to_numpy() - poses["b2_cmd"].to_numpy(), 0.5)
