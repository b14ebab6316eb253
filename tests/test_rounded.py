"""Joint commands of a log that has fewer digits than the targets."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_runs import machine

from ptt.diagnosis.diagnose import diagnose
from ptt.effects.bench import sample_machine
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.rounded import rounded_to, unrounded
from ptt.run.table import make_table
from ptt.run.taken import set_up_lines

TARGETS = np.random.default_rng(4).uniform(-60.0, 60.0, (40, 3)).round(5)


def sliders(file: MachineFile, targets: np.ndarray) -> np.ndarray:
    return np.asarray(build_mechanism(file.machine).inverse(torch.as_tensor(targets)).numpy())


def arm() -> MachineFile:
    file = sample_machine("serial")
    return replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": 0.02}))


@pytest.mark.parametrize("step", [0.01, 0.05, 0.1])
def test_sliders_of_few_digits_are_those_that_the_targets_ask_for(step: float) -> None:
    file, exact = machine(), sliders(machine(), TARGETS)
    table = make_table(TARGETS, step * np.round(exact / step), TARGETS + 0.01)
    assert rounded_to(file, table) == pytest.approx(step)
    finer = unrounded(file, table)
    assert finer.command is not None
    np.testing.assert_allclose(finer.command, exact, atol=0.01 * step)
    np.testing.assert_allclose(build_problem(file, table).view.p.numpy(), TARGETS, atol=0.01 * step)
    assert f"rounded to {step:g} mm; the targets tell finer" in "\n".join(set_up_lines(build_problem(file, table)))


def test_other_sliders_than_the_targets_ask_for_stay_as_they_are_written() -> None:
    """Sent corrections, a micrometre's digits, sliders that were planned in steps, targets of no more digits."""
    file, exact = machine(), sliders(machine(), TARGETS)
    planned = np.round(exact, 1)
    reached = build_mechanism(file.machine).forward(torch.as_tensor(planned)).numpy().round(5)
    for targets, command in (
        (TARGETS, np.round(exact + 0.03, 2)),
        (TARGETS, np.round(exact, 3)),
        (reached, planned),
        (TARGETS.round(2), np.round(exact, 2)),
    ):
        table = make_table(targets, command, targets + 0.01)
        assert rounded_to(file, table) == 0.0 and unrounded(file, table) is table
    assert rounded_to(file, make_table(TARGETS, None, TARGETS)) == 0.0


def test_angles_of_few_digits_lead_to_the_targets() -> None:
    """An arm of six joints has other postures at a target; the nearest to what is written is the one that it took."""
    file = arm()
    robot = build_mechanism(file.machine)
    q = np.random.default_rng(5).uniform(-1.0, 1.0, (60, robot.joints))
    targets = robot.forward(torch.as_tensor(q)).numpy().round(5)
    written = np.radians(np.degrees(q).round(2))
    table = make_table(targets, written, targets)
    assert rounded_to(file, table) == pytest.approx(0.01)
    finer = unrounded(file, table).command
    assert finer is not None and np.abs(finer - written).max() < np.radians(0.02)
    there, as_written = (robot.forward(torch.as_tensor(each)).numpy() for each in (finer, written))
    assert np.abs(there - targets).max() < 1e-3 < np.abs(as_written - targets).max()


@pytest.mark.parametrize(("digits", "said"), [(2, True), (4, False), (0, False)])
def test_angles_of_few_digits_that_nothing_tells_finer_are_said_to_look_like_an_error(digits: int, said: bool) -> None:
    file = arm()
    robot = build_mechanism(file.machine)
    q = np.random.default_rng(6).uniform(-1.0, 1.0, (60, robot.joints))
    written = np.radians(np.degrees(q).round(digits))
    readings = robot.forward(torch.as_tensor(q if said else written)).numpy()
    lines = "\n".join(set_up_lines(build_problem(file, make_table(None, written, readings))))
    assert ("written in steps of 0.01 deg" in lines) == said
    if said:  # by the readings, which have no other error
        aside = np.sqrt(np.square(readings - robot.forward(torch.as_tensor(written)).numpy()).sum(axis=1).mean())
        told = float(lines.partition("puts the tool ")[2].partition(" um")[0])
        assert told == pytest.approx(1e3 * aside, rel=0.15)


@pytest.mark.parametrize(("visits", "more", "verdict"), [(1, 0.0, "nothing-missing"), (3, 0.0, "nothing-missing"),
                                                          (3, 3.0, "unknown")])  # fmt: skip
def test_what_rounding_of_angles_puts_aside_is_nothing_unknown(visits: int, more: float, verdict: str) -> None:
    """Two decimals of a degree put this arm aside by several times the noise; what is beyond that is not theirs."""
    file, random = arm(), np.random.default_rng(8)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.01}))
    robot = build_mechanism(file.machine)
    exact = np.tile(random.uniform(-1.0, 1.0, (90 // visits, robot.joints)), (visits, 1))[random.permutation(90)]
    written = np.radians(np.degrees(exact).round(2))
    there, as_written = (robot.forward(torch.as_tensor(each)).numpy() for each in (exact, written))
    assert np.square(there - as_written).sum(axis=1).mean() > (3.0 * 0.01) ** 2
    readings = there + more * (there - as_written) + random.normal(0.0, 0.01 / np.sqrt(3.0), there.shape)
    problem = build_problem(file, make_table(None, written, readings))
    assert diagnose(Model(file), problem).verdict == verdict
