"""The blocks of an explanation: what each is said to be, also where names take back what it puts in."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import SIGMA, machine

from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import table_of
from ptt.dependence.dependence import Dependence
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.atoms import is_block
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.found import Found, parts_of
from ptt.diagnosis.telling.depends import dependences
from ptt.diagnosis.telling.unknowns import unnamed_of
from ptt.effects import library
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

EVERY = slice(None)


@pytest.fixture(scope="module")
def odd() -> tuple[Found, Problem]:
    machine = bench_machine()
    drawn = hide_faults(draw_rig(5, machine, "volume", rows=150), ["loose-joint"], 5)
    problem = build_problem(machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    return find(Model(machine), problem, library(), lambda what: None), problem


def test_a_block_is_what_it_puts_into_the_readings(odd):
    found, problem = odd
    unnamed = unnamed_of(found.scorer, found.state, problem, EVERY)
    shares = [one.energy for one in unnamed.unknowns]
    assert shares and shares == sorted(shares, reverse=True) and 0.5 < sum(shares) <= 1.0
    assert all(one.amounts is not None for one in unnamed.unknowns)


def test_of_a_block_that_names_take_back_only_what_it_does_is_said(odd):
    """Linear columns that all but cancel each other may each be millimetres where the readings miss micrometres."""
    found, problem = odd
    state = found.state
    sound = unnamed_of(found.scorer, state, problem, EVERY)
    block = next(key for key in state.keys if found.system.atoms[key].block is not None)
    values = state.posterior.values.copy()
    values[state.of(block)] *= 50.0
    told = unnamed_of(found.scorer, replace(state, posterior=replace(state.posterior, values=values)), problem, EVERY)
    name = found.system.atoms[block].name
    assert name in [one.block.name for one in told.unknowns if one.amounts is None]
    assert np.nanstd(told.left) < 1.5 * np.nanstd(sound.left)
    (first, *_), (before, *_) = dependences(told, problem), dependences(sound, problem)
    assert (first.residual, first.on) == (before.residual, before.on)
    assert first.size is not None and before.size is not None and first.size.rms < 2.0 * before.size.rms


def test_a_block_whose_work_another_does_is_said_as_large_as_its_share(odd):
    """The share is of what it takes by itself: a size of the little that is left to it would be of something else."""
    found, problem = odd
    scorer, state = found.scorer, found.state
    gain = scorer.screen(state, is_block)[0]  # a field, which alone would do the work of a slider's own law
    more = scorer.score((*state.keys, gain.key), state.memory, {**state.variances, gain.key: gain.variances})
    told, sound = (unnamed_of(scorer, each, problem, EVERY) for each in (more, state))
    first, before = told.unknowns[0], sound.unknowns[0]
    assert first.in_addition and not before.in_addition and first.energy > 0.5
    beside = np.nanstd(parts_of(more, found.system)[gain.key])
    size = dependences(told, problem)[0].size
    assert first.block is found.system.atoms[gain.key].block and size is not None
    assert size.rms is not None and size.rms > 3.0 * beside and size.rms > 0.5 * np.nanstd(told.left)


@pytest.mark.parametrize(("along", "rivals"), [(True, ("z on time",)), (False, ())])
def test_what_went_along_with_the_variable_is_told(along: bool, rivals: tuple[str, ...]) -> None:
    """A tool that sinks as the room warms, with the hours or up and down."""
    random, rows = np.random.default_rng(3), 150
    warmth = 6.0 * (1.0 - np.exp(-np.linspace(0.0, 2.0, rows))) if along else 3.0 + 3.0 * np.sin(np.arange(rows) / 9.0)
    target = random.uniform(-60.0, 60.0, (rows, 3))
    sunk = 0.01 * np.square(warmth)[:, None] * np.array([0.0, 0.0, -1.0])
    found = seen(target, sunk, warmth, random)
    assert (found.residual, found.on, found.rivals) == ("z", "temperature", rivals)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.long)])
def test_what_follows_several_variables_has_nothing_that_went_along_with_one(seed: int) -> None:
    random, rows = np.random.default_rng(seed), 160
    target = random.uniform(-60.0, 60.0, (rows, 3))
    field = 0.08 * np.sin(target[:, :1] / 25.0) * np.sin(target[:, 1:2] / 25.0) * np.array([0.0, 0.0, 1.0])
    assert seen(target, field, 3.0 * np.sin(np.arange(rows) / 17.0), random).rivals == ()


def seen(target: np.ndarray, error: np.ndarray, warmth: np.ndarray, random: np.random.Generator) -> Dependence:
    """What the leading unknown of these errors follows."""
    file = machine(frame="trusted")
    read = target + error + random.normal(0.0, SIGMA, target.shape)
    table = make_table(target, measured=read, time_s=15.0 * np.arange(len(target)), temp_c=20.0 + warmth)
    found = diagnose(Model(file), build_problem(file, table))
    assert found.verdict == "unknown"
    return found.depends_on[0]
