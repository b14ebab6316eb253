"""Laws of one variable say what an unknown follows, and a jump in time is held against jumps along the travel."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.probability import near_sets, weigh_sets
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.laws import by_laws
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.unknown.jumps import passed_again
from ptt.diagnosis.unknown.laws import _arrivals, laws_of
from ptt.effects import library
from ptt.fitting.linear import linear_columns
from ptt.fitting.solve import fit
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.rig import parse_rig
from ptt.rig.simulate import simulate
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

MACHINE = bench_machine()
ROWS, SIZE = 60, 0.06  # mm
SHARE = np.arange(ROWS) / ROWS
LEVEL = np.floor(5 * SHARE)
CIRCLES = np.column_stack([15 * np.cos(10 * np.pi * SHARE), 15 * np.sin(10 * np.pi * SHARE), 20 * LEVEL - 40]).round(3)


def on_circles(share: float, *, slips: bool) -> Problem:
    """Five circles above one another; slider 1 slips after a share of the rows, or its scale has a step there."""
    height = build_mechanism(MACHINE.machine).inverse(torch.as_tensor(CIRCLES)).numpy()[:, 0]
    splice = {"kind": "splice", "leg": 1, "height_mm": float(np.quantile(height, share)), "step_um": 1e3 * SIZE}
    slip = {"slip_mm": [SIZE, 0.0, 0.0], "slip_row": int(ROWS * share)}
    hidden = {"drive": slip} if slips else {"odd": [splice]}
    rig = parse_rig({"machine": MACHINE.machine.model_dump(), "seed": 2, **hidden})
    frame = simulate(rig, pd.DataFrame(CIRCLES, columns=["x_cmd", "y_cmd", "z_cmd"]), noise=False).frame
    frame[["x_meas", "y_meas", "z_meas"]] += np.random.default_rng(2).normal(0.0, 0.004, CIRCLES.shape)
    return build_problem(MACHINE, table_of(frame))


def learned(share: float, *, slips: bool) -> Diagnosis:
    return diagnose(Model(MACHINE), on_circles(share, slips=slips))


SPAN = [-60.0, 60.0]
LAWS = {
    "a rail pushed outward where the tool is": (
        {"kind": "random-law", "place": "radial", "leg": 1, "form": "smooth", "variables": ["x"], "span": [SPAN]},
        ("slider 1", {"x"}),
    ),
    "a link that bends where the tool is": (
        {"kind": "random-law", "place": "link", "leg": 3, "form": "smooth", "variables": ["y"], "span": [SPAN]},
        ("slider 3", {"y"}),
    ),
    "one axis of the tool alone": (
        {"kind": "random-law", "place": "tool-x", "form": "jumpy", "variables": ["x"], "span": [SPAN]},
        ("x", {"x"}),
    ),
    "friction that short moves do not overcome": (
        {"kind": "stick-slip", "leg": 2, "size_um": 60.0, "step_mm": 30.0},
        ("slider 2", {"direction2"}),
    ),
}
ASKED = (("a link that bends where the tool is", 3), ("friction that short moves do not overcome", 3))


@pytest.mark.parametrize(
    ("named", "seed"),
    [
        pytest.param(named, seed, marks=() if (named, seed) in ASKED else pytest.mark.long)
        for named in LAWS
        for seed in (3, 4)
    ],
)
def test_an_unknown_is_told_by_the_one_variable_that_it_follows(named: str, seed: int) -> None:
    law, (residual, leads) = LAWS[named]
    drawn = {"size_um": 40.0, "law_seed": 5} if law["kind"] == "random-law" else {}
    rig = parse_rig({"machine": MACHINE.machine.model_dump(), "seed": seed, "odd": [{**law, **drawn}]})
    random = np.random.default_rng(seed)
    cloud = pd.DataFrame(random.uniform(-60.0, 60.0, (120, 3)).round(3), columns=["x_cmd", "y_cmd", "z_cmd"])
    frame = simulate(rig, cloud, noise=False).frame
    frame[["x_meas", "y_meas", "z_meas"]] += random.normal(0.0, 0.005, (120, 3))
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table_of(frame)))
    assert (found.verdict, found.suggested) == ("unknown", ())
    assert found.depends_on[0].residual == residual
    assert found.depends_on[0].on in leads


@pytest.mark.parametrize(
    ("place", "acts_on"),
    [
        pytest.param("radial", "rail 2 outward", marks=pytest.mark.long),
        ("tangential", "rail 2 sideways"),
    ],
)
def test_a_rail_that_gives_way_under_load_is_told_by_load_and_rail(place: str, acts_on: str) -> None:
    """Along its travel it gives way more in one place than in another; time, which goes with the load, is no cause."""
    law = {"kind": "random-law", "place": place, "leg": 2, "form": "smooth", "variables": ["payload", "b2"]}
    drawn = {"span": [[0.0, 6.0], [190.0, 370.0]], "size_um": 60.0, "law_seed": 1}
    conditions = {"cycles": 3, "payload_per_cycle_kg": [0.0, 3.0, 6.0]}
    rig = parse_rig(
        {"machine": MACHINE.machine.model_dump(), "seed": 1, "odd": [{**law, **drawn}], "conditions": conditions}
    )
    random = np.random.default_rng(1)
    cloud = pd.DataFrame(random.uniform(-60.0, 60.0, (60, 3)).round(3), columns=["x_cmd", "y_cmd", "z_cmd"])
    frame = simulate(rig, cloud, noise=False).frame
    frame[["x_meas", "y_meas", "z_meas"]] += random.normal(0.0, 0.005, (180, 3))
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table_of(frame)))
    first = found.depends_on[0]
    assert (found.verdict, found.suggested) == ("unknown", ())
    assert (first.residual, first.on, first.acts_on) == ("slider 2", "payload", acts_on)


@pytest.mark.parametrize("turns", [1, 2])
def test_what_lets_go_at_a_temperature_and_comes_back_is_no_slip_and_knock(turns: int) -> None:
    """Passed once only, a temperature says no more than the moment does: a slip is named, and that is said with it."""
    random, rows = np.random.default_rng(5), 160
    cloud = random.uniform(-60.0, 60.0, (rows, 3)).round(3)
    warm = 21.0 - 3.0 * np.cos(np.pi * turns * np.arange(rows) / rows)
    sound = parse_rig({"machine": MACHINE.machine.model_dump()})
    frame = simulate(sound, pd.DataFrame(cloud, columns=["x_cmd", "y_cmd", "z_cmd"]), noise=False).frame
    mechanism = build_mechanism(MACHINE.machine)
    lever = mechanism.jacobian(mechanism.inverse(torch.as_tensor(cloud))).numpy()[:, :, 1]
    moved = 0.06 * lever * (warm > 22.3)[:, None]
    frame[["x_meas", "y_meas", "z_meas"]] += moved + random.normal(0.0, 0.004, cloud.shape)
    frame["temp_c"] = warm.round(2)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table_of(frame)))
    if turns == 1:
        assert found.suggested == (("homing-slip",),) and "Temperature passes 22." in found.words
        return
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert (first.residual, first.on, first.shape) == ("slider 2", "temperature", "step")
    assert first.place[0] <= 22.31 and first.place[1] >= 22.29


@pytest.mark.parametrize(
    ("passed", "again"),
    [
        ("0" * 50 + "1" * 50, False),
        ("1" * 50 + "0" * 50, False),
        ("0" * 50 + "01" * 2 + "1" * 46, False),
        ("0" * 30 + "1" * 40 + "0" * 30, True),
        ("01" * 50, True),
    ],
)
def test_a_warmth_that_is_passed_once_says_what_the_moment_says(passed: str, again: bool) -> None:
    """A slip in a warm-up would otherwise have a law that is the same readings for less."""
    warm = np.where(np.array(list(passed)) == "1", 25.0, 20.0)
    target = np.random.default_rng(1).uniform(-60.0, 60.0, (len(warm), 3))
    problem = build_problem(MACHINE, make_table(target, measured=target, temp_c=warm))
    assert ("temperature" in {on for on, _, _ in passed_again(problem)}) is again


def test_an_axis_that_creeps_after_it_has_stopped_follows_the_pause_before_the_reading() -> None:
    """Each pose twice, so that repeats scatter by it: without the pause it would pass for noise."""
    random, poses = np.random.default_rng(6), np.random.default_rng(6).uniform(-60.0, 60.0, (70, 3)).round(3)
    cloud, wait = np.tile(poses, (2, 1)), random.uniform(4.0, 40.0, 140)
    sound = parse_rig({"machine": MACHINE.machine.model_dump()})
    frame = simulate(sound, pd.DataFrame(cloud, columns=["x_cmd", "y_cmd", "z_cmd"]), noise=False).frame
    mechanism = build_mechanism(MACHINE.machine)
    lever = mechanism.jacobian(mechanism.inverse(torch.as_tensor(cloud))).numpy()[:, :, 2]
    moved = 0.08 * lever * np.exp(-wait / 10.0)[:, None]
    frame[["x_meas", "y_meas", "z_meas"]] += moved + random.normal(0.0, 0.003, cloud.shape)
    frame["time_s"] = np.cumsum(wait + 2.0)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table_of(frame)))
    assert (found.verdict, found.suggested) == ("unknown", ())
    assert (found.depends_on[0].residual, found.depends_on[0].on) == ("slider 3", "pause")
    assert "depends on the time since the last reading elsewhere (pause)" in found.words


@pytest.mark.parametrize("rests", [(40, 61, 85, 120, 133, 151, 160), ()])
def test_readings_that_are_off_alike_after_rests_are_no_gross_errors(rests: tuple[int, ...]) -> None:
    """Seven of 180 readings, each after the machine has stood for a while; as many off to any side are broken beams."""
    random = np.random.default_rng(8)
    cloud, wait = random.uniform(-60.0, 60.0, (180, 3)).round(3), random.uniform(9.0, 12.0, 180)
    wait[list(rests)] = random.uniform(700.0, 2000.0, len(rests))
    mechanism = build_mechanism(MACHINE.machine)
    away = 0.4 * mechanism.jacobian(mechanism.inverse(torch.as_tensor(cloud))).numpy()[:, :, 2]
    hit = list(rests) or [40, 61, 85, 120, 133, 151, 160]
    measured = cloud + random.normal(0.0, 0.005, cloud.shape)
    measured[hit] += away[hit] if rests else 0.4 * np.eye(3)[[0, 1, 2, 0, 1, 2, 0]] * random.choice([-1, 1], (7, 1))
    table = make_table(cloud, measured=measured, time_s=np.cumsum(wait))
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table))
    if rests:
        assert found.verdict == "unknown" and not found.outliers.any()
        assert (found.depends_on[0].residual, found.depends_on[0].on) == ("slider 3", "pause")
    else:
        assert found.verdict == "nothing-missing" and found.outliers.sum() == 7


def test_every_law_acts_one_way_at_one_place() -> None:
    problem = on_circles(0.5, slips=True)
    fitted = fit(Model(MACHINE), problem, robust=False)
    chain = linear_columns(fitted, problem, [], fitted.noise).at.chain
    laws = [law for laws in laws_of(problem, chain) for law in laws]
    assert len({law.key for law in laws}) == len(laws)
    assert {law.place.residual for law in laws} >= {"x", "slider 1", "rail 2 sideways", "link 3"}
    assert all(law.place.slopes.shape[2] == 1 and np.isfinite(law.features).all() for law in laws)


def test_a_scale_of_two_pieces_is_not_told_as_slips_and_knocks() -> None:
    found = learned(0.55, slips=False)
    assert (found.verdict, found.suggested) == ("unknown", ())
    assert (found.depends_on[0].residual, found.depends_on[0].on) == ("slider 1", "b1")


def test_a_slip_on_the_same_path_is_still_a_slip() -> None:
    found = learned(0.55, slips=True)
    assert (found.verdict, found.suggested) == ("missing", (("homing-slip",),))
    assert found.candidates[0].probability > 0.9


@pytest.mark.parametrize("slips", [True, False])
def test_where_a_slip_and_a_step_are_the_same_readings_nobody_is_sure(slips: bool) -> None:
    """The slip comes just as the tool goes up to the next circle, where the slider goes beyond all heights before."""
    found = learned(0.4, slips=slips)
    assert 0.0 < max(candidate.probability for candidate in found.candidates) < 0.6


def test_what_is_scored_beside_laws_is_no_set_of_the_system_without_them() -> None:
    """The explanation without laws may be the one that is told: all its sets are weighed then."""
    problem = replace(on_circles(0.55, slips=False), noise=None)
    noise = Noise(np.eye(3) * 1.6e-5, "machine file")
    fitted = fit(Model(MACHINE), problem, noise=noise, robust=False)
    candidates, _ = present_candidates(fitted, problem, library())
    scorer = Scorer(build_row_system(fitted, problem, candidates, noise, 100.0, problem.used))
    state = scorer.score(("slider 1 on b1", "rail 2 on b2"), WHITE)
    wider, best = by_laws(scorer, state)
    assert any(key.startswith("law ") for key in best.keys)
    assert scorer.scored.keys() < wider.scored.keys()
    assert weigh_sets(scorer).verdict["unknown"] > 0.9
    assert all(key in scorer.system.atoms for _, other in near_sets(scorer, state) for key in other.keys)


def test_rows_that_are_hidden_tell_nothing_not_even_how_large_a_curve_is() -> None:
    problem = replace(on_circles(0.55, slips=False), noise=None)
    noise = Noise(np.eye(3) * 1.6e-5, "machine file")
    fitted = fit(Model(MACHINE), problem, noise=noise, robust=False)
    candidates, _ = present_candidates(fitted, problem, library())
    system = build_row_system(fitted, problem, candidates, noise, 100.0, problem.used)
    hidden = 4
    dented = np.where((system.block == hidden)[:, None], system.values + 100.0, system.values)

    def predicted(of: RowSystem) -> np.ndarray:
        scorer = Scorer(of)
        state = scorer.score(("slider 1 on b1", "rail 2 on b2"), WHITE)
        part = list(of.held_out_blocks(state.columns))[hidden]
        told = next(scorer.without_rows(state, [part]))
        return np.asarray(of.columns[of.block == hidden][:, :, state.columns] @ told.values)

    plain, other = predicted(system), predicted(replace(system, values=dented, _sums={}))
    np.testing.assert_allclose(other, plain, atol=0.5)  # units of noise, of a dent of a hundred


def test_a_way_that_a_table_tells_of_a_joint_that_never_moves_makes_no_law_of_moves() -> None:
    machine, way = SimpleNamespace(letter="b"), torch.tensor([1.0, -1.0, 1.0, -1.0])
    starts = torch.tensor([True, False, True, False])
    for heights, count in (([270.0, 270.0, 300.0, 300.0], 1), ([270.0, 280.0, 300.0, 300.0], 2)):
        q = torch.tensor(heights, dtype=torch.float64)
        view = SimpleNamespace(q=q[:, None], direction=way[:, None].double(), starts=starts)
        laws = list(_arrivals(SimpleNamespace(two_sided=[True], view=view, file=SimpleNamespace(machine=machine)), 0))
        assert len(laws) == count and all(np.isfinite(shapes).all() for _, shapes in laws)
    np.testing.assert_allclose(laws[1][1][1], -laws[1][1][2])  # ways to another run's first place are no moves
