"""How large an unknown is said to be and which way it goes, beside what is hidden in the virtual machine."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_report_chinese import SAY, latin

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench
from ptt.challenge.truth import READINGS, table_of
from ptt.dependence.dependence import Dependence
from ptt.dependence.said import between, middle, say_size
from ptt.dependence.size import Size, estimate_of, size_of, size_of_side
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.verdict_words import depends
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.draw import draw_rig
from ptt.run.problem import build_problem

DATA = Path(__file__).resolve().parents[1] / "data"
HIDDEN = {  # kind of run, fault -> what is off, kind, um, and what the sentence says of it
    "scale": ("volume", {"kind": "splice", "leg": 1, "height_mm": 280.0, "step_um": -30.0}, "slider 1", "step",
                   -30.0, "um lower above b1 = 279.9 mm than below it"),
    "play": ("warmup", {"kind": "warm-backlash", "leg": 1, "gap_um_per_k": 6.0, "opens_at_c": 20.0}, "slider 1",
             "varying", -40.0, "um lower after moving up than after moving down at temperature = 26.7 C"),
    "roller": ("volume", {"kind": "periodic", "leg": 3, "size_um": 15.0, "period_mm": 17.0, "phase_rad": 0.4},
               "slider 3", "period", 15.0, "um to either side, highest at b3 = 205 mm and every 16.9"),
    "tip": ("volume", {"kind": "carriage-tip", "leg": 1, "size_um": 30.0, "direction": "radial"}, "rail 1 outward",
            "side", 30.0, "um further outward after slider 1 moves up than after it moves down"),
    "neighbour": ("volume", {"kind": "cross-coupling", "leg": 1, "other": 2, "height_mm": 290.0, "span_mm": 60.0,
                             "size_um": 40.0}, "slider 1", "law", 47.0, "um higher at b2 = 285 mm than at 225 mm"),
}  # fmt: skip


def hiding(protocol, fault):
    drawn = draw_rig(3, bench(), protocol, rows=300)
    keys = "".join(f"{key} = {json.dumps(value)}\n" for key, value in fault.items())
    hidden = parse_rig(f"{format_rig(drawn.rig)}\n[[odd]]\n{keys}")
    return replace(drawn, rig=replace(hidden, machine=drawn.rig.machine))


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.long) if n in ("scale", "neighbour", "play") else n for n in HIDDEN]
)
def test_size_and_sign_are_those_of_the_fault(name) -> None:
    protocol, fault, of, kind, um, words = HIDDEN[name]
    drawn = hiding(protocol, fault)
    found = diagnose(Model(bench()), build_problem(bench(), table_of(simulate(drawn.rig, drawn.targets).frame)))
    first = found.depends_on[0]
    assert found.verdict == "unknown" and (first.size.of, first.size.kind) == (of, kind)
    assert 1e3 * first.size.value == pytest.approx(um, rel=0.05)
    assert 0.0 < 1e3 * first.size.std < 0.05 * abs(um)
    assert words in first.words and first.words in found.words
    at, reading = first.points.T  # the picture's readings lie about the picture's curve
    near = np.abs(at[:, None] - first.curve[:, 0]).argmin(axis=1)
    beside = np.abs(reading - first.curve[near, 1])
    assert np.median(beside) < 0.3 * np.ptp(first.curve[:, 1])
    told = first.to_dict()
    assert told["words"] == first.words and told["size"]["value_um"] == pytest.approx(1e3 * first.size.value)


def test_a_foreign_machine_is_said_the_size_that_it_has() -> None:
    """Two directions of the tool's x: what a run with and one without the fault differ by, noise left out."""
    (case,) = plan("unknown", 1, 510, rows=200)
    drawn, _ = draw(case)
    table = table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent)
    problem = build_problem(drawn.rig.machine, table)
    first = diagnose(Model(drawn.rig.machine), problem).depends_on[0]
    with_, without = (
        simulate(rig, drawn.targets, noise=False).truth for rig in (drawn.rig, replace(drawn.rig, odd=()))
    )
    shift, side = (with_ - without)[:, "xyz".index(first.size.of)], problem.view.direction.numpy()
    way = side[:, int(first.on.removeprefix("direction")) - 1]
    true = shift[way > 0].mean() - shift[way < 0].mean()
    assert abs(first.size.value - true) < 4.0 * first.size.std + 0.02 * abs(true)
    assert ("toward +x" if true > 0 else "toward -x") in first.words


@pytest.mark.parametrize("sign", [pytest.param(1.0, marks=pytest.mark.long), -1.0])
def test_a_joint_of_an_arm_is_said_the_way_that_it_turns(sign) -> None:
    """Joint 4 stands 300 urad off the one way when joint 3 arrives forward, and as much as that less when it backs."""
    case = plan("none", 1, 0, bench=load_machine(DATA / "machines" / "ur10.toml"), arm=True, rows=200)[0]
    drawn = draw(case)[0]
    file, frame = drawn.rig.machine, simulate(drawn.rig, drawn.targets).frame
    view = build_problem(file, table_of(frame, drawn.absent)).view
    turned = 0.5 * sign * 3e-4 * view.direction.numpy()[:, 2:3]
    rotation = Rotation.from_rotvec(1e-3 * np.array(drawn.rig.tracker.rotation_mrad)).as_matrix()
    frame[READINGS] += (view.jacobian.numpy()[:, :, 3] * turned) @ rotation.T
    first = diagnose(Model(file), build_problem(file, table_of(frame, drawn.absent))).depends_on[0]
    assert (first.size.of, first.on, first.unit) == ("joint 4", "direction3", "")
    assert sign * first.size.value == pytest.approx(3e-4, abs=max(4.0 * first.size.std, 2e-5))
    way = "forward" if sign > 0 else "back"
    assert f"urad further {way} after joint 3 moves forward than after it moves back" in first.words


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_kind_keeps_its_sign_and_its_error(sign) -> None:
    random = np.random.default_rng(2)
    values = random.uniform(100.0, 300.0, 400)
    noise = 1e-3 * random.normal(size=400)

    def size(curve, **how):
        return size_of("slider 2", estimate_of(sign * curve + noise, 1e-3), values, **how)

    law = size(0.06 * (values - 100.0) / 200.0)
    assert sign * law.value == pytest.approx(0.055, abs=0.003) and law.low < 120.0 and law.high > 280.0
    step = size(0.03 * (values > 210.0) + 1e-4 * values, shape="step", place=(209.5, 210.5))
    assert sign * step.value == pytest.approx(0.03, abs=5.0 * step.std)
    bump = size(0.04 * np.exp(-np.square((values - 180.0) / 8.0)), shape="bump", place=(164.0, 196.0))
    assert sign * bump.value == pytest.approx(0.04, rel=0.15)
    wave = size(0.012 * np.cos(2.0 * np.pi * (values - 3.0) / 5.0), period=5.0)
    crest = 3.0 if sign > 0 else 5.5
    assert wave.value == pytest.approx(0.012, abs=5.0 * wave.std)
    assert np.mod(wave.low - crest + 2.5, 5.0) - 2.5 == pytest.approx(0.0, abs=0.1)
    side = np.where(np.arange(400) % 2, 1.0, -1.0)
    gap = size_of_side("slider 2", estimate_of(0.5 * sign * 0.02 * side + noise, 1e-3), side, values)
    assert gap.kind == "side" and sign * gap.value == pytest.approx(0.02, abs=5.0 * gap.std)
    opening = 0.5 * sign * side * 1e-4 * (values - 100.0)
    more = size_of_side("slider 2", estimate_of(opening + noise, 1e-3), side, values)
    assert more.kind == "varying" and sign * more.value == pytest.approx(0.019, abs=0.002)
    assert abs(more.other) < 0.002 and more.high > 280.0


def test_a_joint_that_turns_is_told_in_microradians() -> None:
    turn = Size("joint 3", "side", -4e-5, 2e-6, -1.0, 1.0, on="direction3", along="direction3", noun="joint", rms=0.02)
    assert turn.to_dict()["value_um"] == pytest.approx(-40.0) and turn.to_dict()["rms_um"] == pytest.approx(20.0)
    curve = np.array([[-1.0, 2e-5, 1e-6], [1.0, -2e-5, 1e-6]])
    found = Dependence("joint 3", "direction3", 0.9, 1e-9, None, "levels", curve, size=turn).to_dict()
    assert found["curve"]["mean_um"] == pytest.approx([20.0, -20.0])


def test_what_goes_one_way_here_and_the_other_there_is_said_to_be_the_same_on_average():
    saddle = Size("y", "law", 0.001, 0.002, 2.6, 5.2, on="payload", along="payload", unit="kg", rms=0.1)
    assert say_size(saddle) == (
        "On average the tool has the same y at payload = 5.2 kg and 2.6 kg, within 5.0 um, though single places "
        "differ; 100 um rms at the tool."
    )
    assert "does not tell which" in say_size(replace(saddle, rms=0.004))
    assert say_size(replace(saddle, of="mount y")) == say_size(saddle)


def test_what_the_readings_do_not_show_is_said_to_be_so() -> None:
    unsure = Size("slider 2", "law", 0.004, 0.01, 100.0, 300.0, on="b2", along="b2", unit="mm")
    said = say_size(unsure)
    assert "at most 24 um lower or higher at b2 = 300 mm than at 100 mm: this run does not tell which." in said
    one_way = size_of_side("slider 2", estimate_of(np.zeros(30), 1e-3), np.ones(30))
    assert one_way is None


@pytest.mark.parametrize(
    ("size", "words"),
    [
        (Size("joint 3", "side", -4e-5, 2e-6, -1.0, 1.0, on="direction3", along="direction3", noun="joint"),
         "Joint 3 is 40.0 +- 2.0 urad further back after moving forward than after moving back."),
        (Size("x", "law", 0.06, 0.003, 0.0, 5.0, on="payload", along="payload", unit="kg"),
         "The tool is 60 +- 3 um further toward +x at payload = 5.0 kg than at 0.0 kg."),
        (Size("link 2", "step", -0.0351, 0.0009, -373.914, -373.912, on="b2", along="b2", unit="mm"),
         "Link 2 is 35.1 +- 0.9 um shorter above b2 = -373.91 mm than below it."),
        (Size("joint 4", "period", 1.9e-4, 1.9e-5, -4.195, -4.0991, on="q4", along="q4", unit="rad", noun="joint"),
         "Joint 4 varies by 190 +- 19 urad to either side, furthest forward at q4 = -4.195 rad and every 0.0959 rad "
         "from there, 65.52 times a turn."),
        (Size("rail 1 sideways", "bump", 0.05, 0.001, 200.0, 220.0, on="b1", along="b1", unit="mm", rms=0.012),
         "Rail 1 is 50.0 +- 1.0 um further counter-clockwise (seen from above) near b1 = 210 mm than on either "
         "side of it; 12 um rms at the tool."),
    ],
)  # fmt: skip
def test_every_place_has_its_own_words(size, words) -> None:
    assert say_size(size) == words


@pytest.mark.parametrize(
    ("place", "unit", "words", "centre"),
    [
        ((-373.921, -373.918), "mm", "-373.92 mm", "-373.92 mm"),
        ((-373.94, -373.88), "mm", "-373.94 to -373.88 mm", "-373.91 mm"),
        ((41.2, 62.7), "mm", "41 to 63 mm", "52 mm"),
        ((0.0, 2.5), "kg", "0.0 to 2.5 kg", "1 kg"),
        ((1.50001, 1.50003), "rad", "1.5000 rad", "1.5000 rad"),
        ((304.4, 366.8), "", "304 to 367", "336"),
    ],
)
def test_a_place_has_a_unit_and_digits_that_tell_its_ends_apart(place, unit, words, centre) -> None:
    assert between(*place, unit) == words
    assert middle(*place, unit) == centre


def test_a_run_without_a_clock_is_told_by_its_rows_and_one_with_a_clock_by_the_time_since_its_first_row() -> None:
    """'jumps where time passes 42' is said to nobody who has no column of times; rows are counted from 1."""
    found = {"residual": "slider 2", "on": "time", "share": 0.9, "p_value": 1e-9, "period_mm": None}
    rows, clock = (
        Dependence(**found, shape="step", curve=np.zeros((2, 3)), place=(42.0, 43.0), unit=unit) for unit in ("", "s")
    )
    assert depends(rows).startswith("The remaining error of slider 2 jumps between rows 43 and 44 (90 %")
    assert depends(clock).startswith("The remaining error of slider 2 jumps 42 to 43 s after the first row (90 %")
    assert rows.how() == "step between rows 43 and 44" and clock.how() == "step 42 to 43 s after the first row"
    switched = replace(clock, shape="levels", place=None, moments=(10.0, 20.0))
    assert "switches between levels, 10 and 20 s after the first row (90 %" in depends(switched)
    assert "depends on the number of the row (90 %" in depends(replace(rows, shape="smooth", place=None))
    step = Size("slider 2", "step", 0.02, 0.001, 42.0, 43.0, on="time", along="time")
    assert say_size(step) == "Slider 2 is 20.0 +- 1.0 um higher above row = 43 than below it."
    assert say_size(replace(step, kind="law", low=9.0)).endswith("higher at row = 44 than at 10.")
    assert say_size(replace(step, unit="s")).endswith("higher above time = 42 s than below it.")
    for told in (depends(rows), depends(clock), depends(switched), say_size(step), rows.how(), switched.how()):
        assert latin(SAY(told)) == [], SAY(told)
