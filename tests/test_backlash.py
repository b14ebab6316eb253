"""Backlash from a linear-scale log."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from ptt.commands.main import run
from ptt.correct.training.machine_of import machine_of
from ptt.errors import InputError, TableError
from ptt.machine import load_machine
from ptt.run.backlash.dead_travel import measure_reversal
from ptt.run.backlash.measure import measure_backlash
from ptt.run.backlash.scale import read_scale_log

DATA = Path(__file__).resolve().parents[1] / "data"
LEAD = 5.0


def play(command, gap, start):
    """Play operator, row by row: (n,) commands -> (n,) positions."""
    now, positions = start, []
    for value in command:
        now = min(max(now, value - gap / 2), value + gap / 2)
        positions.append(now)
    return np.array(positions)


def scale_pass(gap, step=0.004, travel=10.0, count=0.001, zero=0.0, noise=0.0, seed=0, taken_up=True):
    """Motor commands and quantised scale readings of one pass forward and back, (m,) mm each."""
    rise = np.arange(0, round(travel / step) + 1) * step
    command = np.concatenate([rise, rise[-2::-1]])
    position = play(command, gap, -gap / 2 if taken_up else gap / 2) + zero
    position = position + np.random.default_rng(seed).normal(0.0, noise, len(position))
    return command, np.round(position / count) * count


def write_log(path, command, scale, slider=1, extra=None):
    """The raw log as a CSV."""
    columns = {"slider": np.full(len(command), slider), "motor_mm": command, "scale_mm": scale, **(extra or {})}
    rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    path.write_text("\n".join(rows) + "\n")
    return path


@given(
    st.floats(0.0, 0.2),
    st.sampled_from([0.0005, 0.0013, 0.004, 0.01]),
    st.floats(0.0, 0.001),
    st.booleans(),
    st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_both_figures_find_the_gap_to_their_resolution(gap, step, zero, taken_up, mirrored):
    command, scale = scale_pass(gap, step, travel=2.0, zero=zero, taken_up=taken_up)
    one = measure_reversal(command, -scale if mirrored else scale, 0.001)
    assert abs(one.by_forward - gap) <= step + 0.001
    assert abs(one.by_back - gap) <= step + 0.001
    assert abs(one.by_counts - gap) <= 0.0021  # two readings of one count each, once between samples
    assert one.constant_speed


@pytest.mark.parametrize(
    ("step", "noise"), [(0.004, 0.0), pytest.param(0.0007, 0.0, marks=pytest.mark.long), (0.004, 0.002)]
)
def test_figures_are_unbiased_and_their_stated_uncertainty_is_honest(tmp_path, step, noise):
    random = np.random.default_rng(7)
    errors, stated = [], []
    for trial in range(120):
        gap, zero = random.uniform(0.03, 0.06), random.uniform(0.0, 0.001)
        command, scale = scale_pass(gap, step, travel=1.5, zero=zero, noise=noise, seed=trial)
        log = read_scale_log(write_log(tmp_path / "log.csv", command, scale), resolution_mm=0.001)
        figure = measure_backlash(log).sliders[0]
        errors.append([figure.by_length[0] - gap, figure.by_counts[0] - gap])
        stated.append([figure.by_length[1], figure.by_counts[1]])
    spread, claim = np.std(errors, axis=0), np.mean(stated, axis=0)
    assert np.all(np.abs(np.mean(errors, axis=0)) < 4.0 * claim / np.sqrt(120))
    assert np.all(spread < 1.25 * claim)
    assert np.all(spread > 0.4 * claim)


def test_dwell_at_the_turn_is_no_dead_travel():
    command, scale = scale_pass(0.05)
    rows = np.insert(np.arange(len(command)), 2500, np.full(300, 2500))
    assert measure_reversal(command[rows], scale[rows], 0.001) == measure_reversal(command, scale, 0.001)


def test_uneven_speed_is_said_and_leaves_the_counts(tmp_path):
    command, scale = scale_pass(0.05)
    rows = np.concatenate([np.arange(0, 1000, 2), np.arange(1000, len(command))])
    log = read_scale_log(write_log(tmp_path / "log.csv", command[rows], scale[rows]))
    figure = measure_backlash(log).sliders[0]
    assert not figure.reversals[0].constant_speed
    assert figure.gap == figure.by_counts


def test_marked_phases_give_equation_19():
    n1, n2, n3 = 1000, 20, 980
    phase = np.repeat(["S1", "S2", "S3"], [n1 + 1, n2, n3])
    command = np.concatenate([np.arange(n1 + 1), np.arange(n1 - 1, n1 - 1 - n2 - n3, -1)]) * 0.01
    scale = np.concatenate([np.arange(n1 + 1) * 0.01, np.full(n2, 10.0), 10.0 - 0.01 * np.arange(1, n3 + 1)])
    one = measure_reversal(command, scale, 0.01, phase)
    assert one.samples == (1000.0, 20.5, 1000.0)
    assert one.by_forward == pytest.approx(10.0 * 20.5 / 1000)
    assert one.by_back == pytest.approx(10.0 * 20.5 / 1000)
    assert one.counts == (999.0, 979.0)  # over the stretch after the first count
    assert one.by_counts == pytest.approx(0.2)


def test_both_lengths_and_the_counts_are_weighed_by_hand(tmp_path):
    """The way back is 4 % faster, so that the two lengths differ; steps and counts are a hundredth of a millimetre."""
    stands, back = 10.0 - 0.0104 * np.arange(1, 21), 10.0 - 0.0104 * np.arange(21, 921)
    rise = 0.01 * np.arange(1001)
    path = write_log(
        tmp_path / "log.csv",
        np.concatenate([rise, stands, back]),
        np.concatenate([rise, np.full(20, 10.0), 10.0 - 0.0104 * np.arange(1, 901)]),
        extra={"phase": np.repeat(["S1", "S2", "S3"], [1001, 20, 900])},
    )
    figure = measure_backlash(read_scale_log(path, resolution_mm=0.01)).sliders[0]
    assert figure.by_length == pytest.approx((20.5 * (0.01 + 0.0104) / 2.0, 0.005))  # 1e-4 (1/6 + 1/12) mm^2
    assert figure.by_counts == pytest.approx((20 * 0.0104, 0.01 / np.sqrt(6.0)))
    assert figure.gap == pytest.approx((0.4 * 20.5 * 0.0102 + 0.6 * 20 * 0.0104, 0.01 / np.sqrt(10.0)))
    assert figure.agree


@pytest.mark.parametrize(("jitter", "told"), [(0.0, 0.0), (0.002, 0.002)])
def test_the_rounding_of_a_scale_to_its_counts_is_no_jitter(jitter, told):
    """Steps that are no whole number of counts are rounded up and down: that scatters by 0.3 um."""
    found = [measure_reversal(*scale_pass(0.05, 0.0012, noise=jitter, seed=seed), 0.001).noise for seed in range(5)]
    assert np.mean(found) == pytest.approx(told, rel=0.05, abs=1e-4)


def test_a_marked_log_needs_no_commands(tmp_path):
    command, scale = scale_pass(0.05)
    turn, still = 2500, 12
    phase = ["S1"] * (turn + 1) + ["S2"] * still + ["S3"] * (len(command) - turn - 1 - still)
    path = tmp_path / "log.csv"
    rows = [f"3,{p},{round(1000 * s)}" for p, s in zip(phase, scale, strict=True)]
    path.write_text("slider,phase,scale_counts\n" + "\n".join(rows) + "\n")
    figure = measure_backlash(read_scale_log(path, lead_mm=LEAD, turns=2.0, resolution_mm=0.001)).sliders[0]
    assert figure.slider == "3"
    assert figure.by_length[0] == pytest.approx(0.05, abs=0.001)
    assert figure.by_counts[0] == pytest.approx(0.05, abs=0.006)  # even rows stand for the commands: a step off


def test_repeatability_per_stroke_is_equation_20(tmp_path):
    command, scale = scale_pass(0.05)
    ends = np.array([10.001, 9.998, 10.0, 10.002, 9.999, 10.0])
    positions = np.array([scale[2500], *ends])
    path = write_log(
        tmp_path / "log.csv",
        np.append(command, np.full(6, 10.0)),
        np.append(scale, ends),
        extra={"cycle": np.append(np.ones(len(command), int), np.arange(2, 8))},
    )
    figure = measure_backlash(read_scale_log(path)).sliders[0]
    assert figure.positions == pytest.approx(tuple(positions))
    assert figure.repeatability == pytest.approx((np.ptp(positions) / 10.0, np.std(positions, ddof=1) / 10.0))
    assert len(figure.reversals) == 1


def test_several_cycles_are_averaged_and_their_scatter_counts(tmp_path):
    passes = [scale_pass(gap, zero=1e-4 * i) for i, gap in enumerate((0.040, 0.050, 0.060))]
    path = write_log(
        tmp_path / "log.csv",
        np.concatenate([p[0] for p in passes]),
        np.concatenate([p[1] for p in passes]),
        extra={"cycle": np.repeat([1, 2, 3], [len(p[0]) for p in passes])},
    )
    figure = measure_backlash(read_scale_log(path)).sliders[0]
    assert figure.by_counts[0] == pytest.approx(0.05, abs=0.001)
    assert figure.by_counts[1] == pytest.approx(0.01 / np.sqrt(3), rel=0.1)


HEAD = "slider,command_turns,scale_mm\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows"),
        (HEAD, "no rows"),
        ("command_turns,scale_mm\n0,0\n", "no column slider"),
        ("slider,scale_mm\n1,0\n1,1\n", "no column command_turns or motor_mm"),
        ("slider,command_turns\n1,0\n", "no column scale_mm or scale_counts"),
        ("slider,command_turns,scale_counts\n1,0,1\n", "counts of unknown size"),
        (HEAD + "1,0,0\n1,x,1\n", r"row 3, column command_turns: not a number \('x'\)"),
        (HEAD + "1,0,0\n1,,1\n", r"row 3, column command_turns: not a number \(''\)"),
        (HEAD + "1,0,0\n1,1,0\n1,0,0\n", "the scale never moves"),
        (HEAD + "1,0,0\n1,1,5\n1,2,10\n1,3,15\n", "no reversal"),
        (HEAD + "1,0,0\n", "the scale never moves"),
        (HEAD + "".join(f"1,{c},{5 * min(c, 9)}\n" for c in [*range(10), 8, 7, 9, 8, 7, 6]), "more than once"),
        ("slider,phase,motor_mm,scale_mm\n1,S1,0,0\n1,S9,1,1\n", r"row 3, column phase: unknown phase 'S9'"),
    ],
)
def test_bad_logs_are_one_clear_line(tmp_path, text, message):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(TableError, match=message):
        measure_backlash(read_scale_log(path, lead_mm=LEAD))


def test_a_scale_that_stands_still_to_the_end_is_refused():
    command, scale = scale_pass(0.05)
    with pytest.raises(TableError, match="does not move after the reversal"):
        measure_reversal(command[:2508], scale[:2508], 0.001)


def test_turns_without_a_lead_are_refused():
    with pytest.raises(TableError, match=r"screw lead; add `--lead 5` \(mm\) or `--model machine.toml`"):
        read_scale_log(DATA / "scale.csv")


def test_the_sample_log_is_reproduced_byte_by_byte_and_gives_its_gaps(tmp_path):
    spec = importlib.util.spec_from_file_location("make_scale", DATA / "make_scale.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path / "scale.csv")
    assert (tmp_path / "scale.csv").read_bytes() == (DATA / "scale.csv").read_bytes()
    result = measure_backlash(read_scale_log(DATA / "scale.csv", lead_mm=LEAD))
    assert result.resolution == 0.001
    assert [(one.slider, one.payload) for one in result.sliders] == [(s, p) for s in "123" for p in (0.0, 2.0)]
    for one in result.sliders:
        truth = {"1": 0.041, "2": 0.052, "3": 0.037}[one.slider]
        assert one.agree
        assert one.gap[0] == pytest.approx(truth, abs=2.0 * one.gap[1])
        assert one.by_length[0] == pytest.approx(truth, abs=2.0 * one.by_length[1])
        assert len(one.positions) == 7


def test_command_prints_one_json_object():
    from ptt.commands.backlash import backlash

    app = typer.Typer()
    app.command()(backlash)
    outcome = CliRunner().invoke(app, [str(DATA / "scale.csv"), "--lead", "5", "--json"])
    assert outcome.exit_code == 0
    answer = json.loads(outcome.stdout)
    assert answer["sliders"][2]["by_counts"]["e_j_mm"] == pytest.approx(0.052, abs=0.001)
    assert answer["sliders"][0]["by_length"]["samples"]["S1"] == 2500.0
    text = CliRunner().invoke(app, [str(DATA / "scale.csv"), "--lead", "5"])
    assert text.exit_code == 0
    assert "41.0 +- 0.4" in text.stdout


def test_half_a_compensator_is_no_machine(tmp_path):
    (tmp_path / "half").mkdir()
    drawing = DATA / "machine.toml"
    (tmp_path / "half" / "model.toml").write_text(drawing.read_text())
    assert machine_of(drawing) == load_machine(drawing)
    with pytest.raises(InputError, match=r"half/compensator\.json: no such file"):
        machine_of(tmp_path / "half")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("--lead nan", "finite number"),
        ("--lead -5", "size"),
        ("--turns 0", "size"),
        ("--resolution-um inf", "finite number"),
    ],
)
def test_a_size_that_is_none_is_refused_by_its_option(words, why, capsys):
    option, value = words.split()
    assert run(["backlash", str(DATA / "scale.csv"), option, value]) == 2
    assert f"error: {option}: {value} is not a {why}; give a number" in capsys.readouterr().err
