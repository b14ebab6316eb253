"""What switches between levels over time is the machine's or its surroundings', and no wander of the tracker."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import SIGMA, machine, term

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.noise.wander import Clock
from ptt.diagnosis.search.switching import _best_levels, _levels_of
from ptt.effects import Curve
from ptt.effects.contract import check_effect
from ptt.model.chain import differentiate, predict
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

ROWS, STEP_S = 160, 7.0
SWITCHED = (36, 71, 122)  # first row of each level but the first


def with_levels(seed: int, heights: np.ndarray, *, slider: int | None = None) -> Problem:
    """Random poses of a machine whose tool (heights (k, 3) mm), or one slider (k,), switches at `SWITCHED`."""
    random, file = np.random.default_rng(seed), machine(frame="trusted")
    table = make_table(random.uniform(-60.0, 60.0, (ROWS, 3)), time_s=STEP_S * np.arange(ROWS))
    view = build_view(file, table)
    level = np.searchsorted(SWITCHED, np.arange(ROWS), side="right")
    moved = heights[level] if slider is None else view.jacobian.numpy()[:, :, slider] * heights[level][:, None]
    return build_problem(file, replace(table, measured=view.p.numpy() + moved + random.normal(0.0, SIGMA, (ROWS, 3))))


@pytest.mark.parametrize(
    "times", [3.0, pytest.param(5.0, marks=pytest.mark.long), pytest.param(8.0, marks=pytest.mark.long)]
)
def test_a_tool_that_is_pushed_aside_now_and_then_is_told_with_the_moments(times: float) -> None:
    problem = with_levels(1, np.outer([0.0, 1.0, 0.0, 1.0], [0.0, 0.0, -times * SIGMA]))
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "unknown" and not found.suggested
    first = found.depends_on[0]
    assert (first.residual, first.on, first.shape) == ("z", "time", "levels")
    true = STEP_S * (np.array(SWITCHED) - 0.5)
    assert np.abs(np.array(first.moments) - true).max() <= STEP_S
    assert "switches between levels" in found.words
    heights = first.curve[::2, 1]
    assert heights[0] - heights[1] == pytest.approx(times * SIGMA, rel=0.25)


def test_levels_of_a_slider_are_told_of_that_slider() -> None:
    problem = with_levels(2, 5.0 * SIGMA * np.array([0.0, 1.0, -0.5, 0.7]), slider=1)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.depends_on[0].residual) == ("unknown", "slider 2")
    assert len(found.depends_on[0].moments) == len(SWITCHED)


@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.long), 2, pytest.param(3, marks=pytest.mark.long)]
)
def test_a_random_walk_has_no_levels(seed: int) -> None:
    random, file = np.random.default_rng(100 + seed), machine(frame="fitted")
    table = make_table(random.uniform(-60.0, 60.0, (ROWS, 3)), time_s=STEP_S * np.arange(ROWS))
    walk = np.cumsum(random.normal(0.0, 0.3 * SIGMA, (ROWS, 3)), axis=0)
    read = build_view(file, table).p.numpy() + walk + random.normal(0.0, SIGMA, (ROWS, 3))
    problem = build_problem(file, replace(table, measured=read))
    assert not any(one.moments for one in diagnose(Model(problem.file), problem).depends_on)


class Pump(Curve):
    """Levels over time."""

    name = "test-pump"
    mechanisms = ("three-ptt",)
    on, shape = "time", "levels"
    moments = (STEP_S * 35.5, STEP_S * 70.5, STEP_S * 121.5)
    acts_on = "z"


def test_an_effect_of_levels_has_one_size_for_each() -> None:
    view = build_view(machine(), make_table(np.zeros((ROWS, 3)), time_s=STEP_S * np.arange(ROWS)))
    basis = Pump().basis(view, {})[:, 2].numpy()
    assert basis.shape == (ROWS, len(SWITCHED) + 1)
    assert (basis.argmax(axis=1) == np.searchsorted(SWITCHED, np.arange(ROWS), side="right")).all()
    with pytest.raises(TypeError, match="only levels over time"):
        type("Wrong", (Curve,), {"name": "wrong", "on": "b1", "shape": "levels", "moments": (1.0,)})


def test_rows_on_which_a_curve_acts_cover_its_own_range() -> None:
    """Not the sample machine's: a bump on another machine's travel, or a step late in a long run, is not broken."""

    class Worn(Curve):
        """A bump far beyond the travel of the sample machine."""

        name = "test-worn"
        mechanisms = ("three-ptt",)
        on, shape, between = "b2", "bump", (800.0, 810.0)

    for effect in (Worn(), Pump()):
        broken = [one for one in check_effect(effect, differentiate) if not one.passed]
        assert not broken, broken


def test_a_rail_that_came_loose_is_no_tower_out_of_place_though_repeats_scatter_by_it() -> None:
    """Two rounds of the same poses, the rail moving within the second: repeats take the move for noise."""
    random, file = np.random.default_rng(8), machine(frame="trusted")
    poses = random.uniform(-70.0, 70.0, (60, 3)).round(3)
    table = make_table(np.tile(poses, (2, 1)), time_s=STEP_S * np.arange(120))
    view = build_view(file, table)
    tower = term("tower-position", view, [0.0, 0.0, 0.0, 0.25, 0.0, 0.0])
    before, after = (predict(terms, view).reading.numpy() for terms in ([], [(tower.effect, tower.theta)]))
    read = np.where(np.arange(120)[:, None] < 75, before, after) + random.normal(0.0, SIGMA, (120, 3))
    problem = build_problem(file, replace(table, measured=read))
    found = diagnose(Model(file), problem)
    first = found.depends_on[0]
    assert (found.verdict, found.suggested) == ("unknown", ())
    assert (first.acts_on, first.on, first.shape) == ("rail 1 sideways", "time", "step")
    assert 74.0 * STEP_S <= 0.5 * sum(first.place) <= 75.0 * STEP_S


def test_what_flips_at_random_on_one_axis_is_more_than_a_stated_noise() -> None:
    """Over all axes it is no twice the noise, and half of it is a shift that a wander, or the frame, might be."""
    random, file = np.random.default_rng(8), machine(frame="trusted")
    table = make_table(random.uniform(-60.0, 60.0, (80, 3)), time_s=STEP_S * np.arange(80))
    flips = 5.5 * SIGMA * (random.random(80) < 0.6)
    read = build_view(file, table).p.numpy() + random.normal(0.0, SIGMA, (80, 3))
    read[:, 0] += flips
    problem = build_problem(file, replace(table, measured=read))
    found = diagnose(Model(file), problem)
    assert found.verdict == "unknown" and all("tracker-frame" in names for names in found.suggested)
    assert "in x is" in found.words and "depends on nothing recorded here" in found.words


def test_a_long_run_has_moments_to_the_row_or_none() -> None:
    """Rows are taken together where they are many, and then looked at one by one about each change."""
    random, rows, clock = np.random.default_rng(1), 1500, Clock(np.arange(1500.0), np.arange(1500) == 0)
    still = random.normal(size=(rows, 3))
    moved = still + 5.0 * ((np.arange(rows) >= 401) & (np.arange(rows) < 703))[:, None] * [1.0, 0.0, 0.0]
    found = [_best_levels(read, _levels_of(read[:, :1], np.ones(rows), clock), clock)[1] for read in (still, moved)]
    assert [each.tolist() for each in found] == [[], [401, 703]]


def test_a_slip_that_a_lever_enlarges_as_the_tool_moves_is_one_change() -> None:
    random, rows, clock = np.random.default_rng(2), 200, Clock(np.arange(200.0), np.arange(200) == 0)
    lever = 1.0 + 0.08 * np.sin(np.linspace(0.0, 12.0, rows))
    left = random.normal(size=(rows, 3))
    left[110:, 0] += 50.0 * lever[110:]
    assert _best_levels(left, _levels_of(left[:, :1], lever, clock), clock)[1].tolist() == [110]
