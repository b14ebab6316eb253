"""Base reflectors are seen by the same tracker: what acts on it acts on them, and holds no frame that it moved."""

import re
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.system import clock_of
from ptt.effects import library
from ptt.fitting import chunks
from ptt.fitting.drawn_sizes import sizes_beside
from ptt.fitting.gauge import sparsest
from ptt.fitting.layout import FRAME
from ptt.fitting.linear import assemble
from ptt.fitting.solve import fit
from ptt.judge.ladder.climb import climb
from ptt.machine_schema import BasePoint, TrackerSpec
from ptt.model.model import Model, Term
from ptt.run.base_visits import sound_visits
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table, make_table
from ptt.run.taken import set_up_lines
from ptt.setup import check_setup

PLACES = np.array([[400.0, 0.0, -200.0], [-300.0, 300.0, -200.0], [-300.0, -300.0, 250.0], [0.0, 300.0, 300.0]])
SIGMA = 0.004
NONE: Mapping[int, float] = MappingProxyType({})
KNOCK = np.array([0.05, -0.03, 0.04, 2e-4, -3e-4, 4e-4])  # mm, rad


def measured_run(
    knock: np.ndarray, scale: float = 0.0, rounds: int = 2, rows: int = 120, gross: Mapping[int, float] = NONE
) -> Problem:
    """A sound machine, its tracker knocked or reading too long, base reflectors read in rounds, some wrongly."""
    random = np.random.default_rng(7)
    points = tuple(
        BasePoint(name=f"base {i}", xyz_mm=tuple(map(float, place)), sigma_mm=0.001) for i, place in enumerate(PLACES)
    )
    file = replace(bench_machine(), tracker=TrackerSpec(frame="measured", base_point=points, sigma_mm=SIGMA))
    poses = random.uniform(-40.0, 40.0, (rows, 3))
    cuts = np.linspace(0, rows, rounds).astype(int)
    spot, role, name = list[np.ndarray](), list[str](), list[str]()
    for first, last in zip(cuts, [*cuts[1:], rows], strict=True):
        spot += [*PLACES, *poses[first:last]]
        role += ["base"] * len(PLACES) + ["pose"] * (last - first)
        name += [*(point.name for point in points), *[""] * (last - first)]
    place = np.array(spot)
    base = np.array(role) == "base"
    after = np.arange(len(place)) > len(place) * 0.45
    moved = place * (1.0 + scale) + after[:, None] * (knock[:3] + np.cross(knock[3:], place))
    for visit, size in gross.items():
        moved[np.flatnonzero(base)[visit]] += size * np.array([0.6, -0.6, 0.52])
    table = make_table(np.where(base[:, None], np.nan, place), role=np.array(role), name=np.array(name))
    return build_problem(file, replace(table, measured=moved + random.normal(0.0, SIGMA, place.shape)))


def test_a_knock_that_turns_the_tracker_is_told_once_where_reflectors_hold_the_frame():
    problem = measured_run(KNOCK)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "missing" and found.suggested == (("setup-jump",),)


@pytest.mark.parametrize(("name", "scale", "knock"), [("tracker-scale", 3e-4, 0.0), ("setup-jump", 0.0, 1.0)])
def test_readings_are_predicted_in_the_frame_that_reflectors_show_beside_the_tracker(name, scale, knock):
    """Their mean stands where the tracker did neither before nor after a knock, and a scale shifts it."""
    problem = measured_run(knock * KNOCK, scale)
    last = climb(Model(problem.file), problem, [library()[name]()]).steps[-1]
    assert last.heldout_rms_um["total"] < 1.3 * SIGMA * np.sqrt(3.0) * 1e3


def test_the_scale_of_the_tracker_is_read_off_the_reflectors():
    """They lie ten times as far apart as the poses, so the poses are no news of it."""
    problem = measured_run(0.0 * KNOCK, 3e-4)
    term = fit(Model(problem.file) + library()["tracker-scale"](), problem).model.terms[0]
    assert term.std is not None
    assert abs(float(term.theta[0]) - 3e-4) < 4.0 * float(term.std[0]) < 1e-4


def test_visits_are_whitened_by_what_they_have_in_common():
    base = measured_run(KNOCK * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0], rounds=3).base
    assert base is not None and (base.apart > 0.0).all() and len(np.unique(base.round)) == 3
    turned = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    noise = turned @ np.diag([1.0, 4.0, 9.0]) @ turned.T * 1e-6
    squares, ways = np.linalg.eigh(noise)
    whitener = ways.T / np.sqrt(squares)[:, None]
    same = (base.point[:, None] == base.point) * base.drawn**2 + (base.round[:, None] == base.round) * base.apart**2
    worst = np.eye(3) * squares[-1]  # the beam to a reflector is none of those to the poses
    whole = np.kron(np.eye(len(base.point)), worst) + np.kron(same, np.eye(3))
    values = np.random.default_rng(2).normal(size=(len(base.point), 3, 5))
    white, flat = base.whitened(values, whitener).reshape(-1, 5), values.reshape(-1, 5)
    np.testing.assert_allclose(white.T @ white, flat.T @ np.linalg.solve(whole, flat), rtol=1e-8)


@pytest.mark.parametrize("seed", [0, pytest.param(3, marks=pytest.mark.long)])
def test_reflectors_read_across_the_beam_ask_for_no_knock(seed):
    """Poses lie before the tracker, reflectors all around: what is sharp at those is blunt at some of these."""
    random, rows = np.random.default_rng(seed), 150
    station = np.array([1200.0, 0.0, 100.0])

    def read(place: np.ndarray) -> np.ndarray:
        beam = (place - station) / np.linalg.norm(place - station, axis=1)[:, None]
        noise = random.normal(0.0, 0.02, place.shape)
        return place + noise - 0.95 * (noise * beam).sum(axis=1)[:, None] * beam

    around = station + np.array([[0.0, 900.0, 0.0], [0.0, -900.0, 300.0], [100.0, 0.0, 900.0], [-900.0, 300.0, -600.0]])
    points = tuple(BasePoint(name=f"B{i}", xyz_mm=tuple(one), sigma_mm=0.002) for i, one in enumerate(around))
    file = replace(bench_machine(), tracker=TrackerSpec(frame="measured", base_point=points))
    target = random.uniform(-60.0, 60.0, (rows, 3))
    every = np.concatenate([around, target, around])
    role = np.array(["base"] * 4 + ["pose"] * rows + ["base"] * 4)
    name = np.array([f"B{i}" for i in range(4)] + [f"P{i}" for i in range(rows)] + [f"B{i}" for i in range(4)])
    put = np.where((role == "pose")[:, None], every, np.nan)
    table = replace(make_table(put, role=role, name=name), measured=read(every))
    assert diagnose(Model(file), build_problem(file, table)).verdict == "nothing-missing"


def test_many_visits_are_averaged_side_by_side():
    whole = measured_run(0.0 * KNOCK, rounds=2)
    many = measured_run(0.0 * KNOCK, rounds=260, rows=520)
    assert whole.base is not None and many.base is not None
    assert len(whole.base.frame) == 2 * len(PLACES) and len(many.base.frame) <= 400
    for base in (whole.base, many.base):
        for index, place in enumerate(PLACES):
            np.testing.assert_array_equal(
                base.place[base.point == index], np.tile(place, ((base.point == index).sum(), 1))
            )
            assert np.abs(base.reading[base.point == index] - place).max() < 0.03


def test_columns_at_the_reflectors_are_those_of_the_tracker_alone():
    """Values less effects are what the frame alone leaves, so they do not change as the effects do."""
    problem = measured_run(KNOCK)
    known, noise = library(), problem.noise
    assert noise is not None
    fitted = fit(Model(problem.file) + known["tracker-scale"]() + known["homing-offset"](), problem, noise=noise)
    shape = {"after": problem.view.time.new_tensor([60.0])}
    at, more = fitted.unknowns, np.zeros(len(fitted.unknowns))
    linear = assemble(fitted.layout, at, problem, noise, [known["setup-jump"]()], [shape])
    scale, offset = linear.present["tracker-scale"], linear.present["homing-offset"]
    more[scale], more[offset] = 1.0, 1.0
    there = assemble(fitted.layout, at + more, problem, noise)
    assert not linear.base_columns[..., offset].any() and np.abs(linear.base_columns[..., scale[0]]).min() > 0.0
    np.testing.assert_allclose(there.base_values, linear.base_values, rtol=1e-6, atol=1e-6)
    jump = linear.base_columns[..., linear.trials[0].columns]
    moved = (np.array(problem.table.role) == "base") & (np.arange(problem.table.rows) > 60)
    assert np.linalg.matrix_rank(jump.reshape(-1, 6)) == 6 and moved.sum() == len(PLACES)


def test_stretches_that_stand_for_a_long_run_hold_its_frame_no_firmer_than_its_reflectors_do(monkeypatch):
    problem = measured_run(np.zeros(6), rows=3000)
    fitted = fit(Model(problem.file) + library()["homing-offset"](), problem)
    small = torch.full((3,), 1e-3, dtype=torch.float64)  # mm: less than two rounds of reflectors tell
    term = Term(library()["homing-offset"](), small, std=small)

    def told() -> tuple[np.ndarray, tuple[str, ...]]:
        return np.diag(sizes_beside(fitted, problem)[1][0]), sparsest([term], problem, fitted.noise)[0].alike

    (whole, alike), frame = told(), np.flatnonzero(fitted.layout.owner == FRAME)
    monkeypatch.setattr(chunks, "LONG", 500)
    monkeypatch.setattr(chunks, "SAMPLE_ROWS", 100)
    monkeypatch.setattr(chunks.sample_stretches, "__defaults__", (100, 20))  # bound when the function was defined
    sampled, others = told()
    np.testing.assert_allclose(sampled[frame], whole[frame], rtol=0.2)
    assert alike == others == ("tracker z",)


def test_a_wander_that_outlasts_a_run_has_come_no_further_before_it_where_reflectors_tell_the_frame():
    """Else it shifts the whole run for nothing, and what the machine is off by from the base is its noise."""
    problem = measured_run(0.0 * KNOCK)
    clock = clock_of(problem, problem.used)
    assert clock.begun(4.0 * clock.span)[0] < 0.5


@pytest.mark.parametrize("gross", [{2: 0.5}, {2: 0.5, 5: -0.4}, {2: 0.45, 6: 0.7}, {2: 0.45, 5: 0.4, 6: 0.7}])
def test_reflectors_that_were_misread_hold_no_frame(gross):
    """Also at every visit: a place that is off by a hundred times what the file says it is known to is no evidence."""
    problem = measured_run(0.0 * KNOCK, gross=gross)
    base = problem.base
    assert base is not None
    assert np.abs(base.reading - base.place).max() < 8.0 * SIGMA
    assert len(base.point) == 2 * len(PLACES) - len(gross)
    assert diagnose(Model(problem.file), problem).verdict == "nothing-missing"


def test_what_holds_no_frame_is_said() -> None:
    """A reflector drawn elsewhere, and one reading of another."""
    problem = measured_run(0.0 * KNOCK)
    assert set_up_lines(problem) == []
    wrong = problem.table.measured.copy()
    base = np.flatnonzero(problem.table.role == "base")
    wrong[base[1]] += 0.3
    (line,) = set_up_lines(build_problem(problem.file, replace(problem.table, measured=wrong)))
    assert line.startswith("base reflector base 1: one of 2 readings left out")
    points = list(problem.file.tracker.base_point)
    points[2] = points[2].model_copy(update={"xyz_mm": (-30.0, -300.0, 250.0)})
    tracker = problem.file.tracker.model_copy(update={"base_point": tuple(points)})
    (line,) = set_up_lines(build_problem(replace(problem.file, tracker=tracker), problem.table))
    assert line.startswith("base reflector base 2 is left out") and "xyz_mm" in line


def renamed(problem: Problem, names: Mapping[str, str]) -> Table:
    return problem.table.replace(name=np.array([names.get(name, name) for name in problem.table.name.tolist()]))


def test_reflectors_read_under_each_others_name_hold_no_frame() -> None:
    problem = measured_run(KNOCK)
    swapped = renamed(problem, {"base 0": "base 1", "base 1": "base 0"})
    (found,) = check_setup(problem.file, swapped).findings
    assert found.mistake == "base-reflectors" and found.sure
    assert "'base 0' and 'base 1' were read under each other's name" in found.words
    assert build_problem(problem.file, swapped).base is not None  # --anyway goes on


def test_a_reflector_that_is_left_out_or_not_drawn_is_no_sound_set_up() -> None:
    problem = measured_run(KNOCK)
    wrong = problem.table.measured + np.array([40.0, 0.0, 0.0]) * (problem.table.name == "base 2")[:, None]
    (found,) = check_setup(problem.file, problem.table.replace(measured=wrong)).findings
    assert not found.sure and "contradict [[tracker.base_point]]: base 2" in found.words
    (found,) = check_setup(problem.file, renamed(problem, {"base 3": "post"})).findings
    assert not found.sure and "base reflectors that the machine file lacks: post" in found.words


def test_reflectors_that_disagree_and_nobody_knows_which_are_named() -> None:
    problem = measured_run(KNOCK)
    wrong = problem.table.measured + np.array([4.0, -3.0, 0.0]) * np.isin(problem.table.name, ["base 2"])[:, None]
    wrong += np.array([0.0, -3.0, 4.0]) * (problem.table.name == "base 3")[:, None]
    (found,) = check_setup(problem.file, problem.table.replace(measured=wrong)).findings
    assert re.search(r"are not arranged as .*'base \d' by 2.3 mm, 'base", found.words)


@pytest.mark.parametrize("scale", [0.0, 5e-4])
@pytest.mark.parametrize("knock", [0.0, 10.0])
def test_reflectors_beside_a_tracker_that_is_knocked_or_reads_too_long_are_not_accused(scale, knock) -> None:
    """Half a millimetre and 5 mrad between two rounds."""
    problem = measured_run(knock * KNOCK, scale)
    assert problem.base is not None and check_setup(problem.file, problem.table).findings == ()


def test_reflectors_drawn_at_one_place_or_under_one_name_are_refused() -> None:
    points = [{"name": f"base {i}", "xyz_mm": [9.0, 9.0, 9.0 * i]} for i in range(3)]
    for changes, words in (({"xyz_mm": [9.0, 9.0, 0.05]}, "'base 0' and 'base 1' are at one place"),
                           ({"name": "base 0"}, "two .* are named 'base 0'")):  # fmt: skip
        wrong = [points[0], points[1] | changes, points[2]]
        with pytest.raises(ValueError, match=words):
            TrackerSpec.model_validate({"frame": "measured", "base_point": wrong})
        assert TrackerSpec.model_validate({"base_point": wrong}).frame == "fitted"


@pytest.mark.parametrize(("off", "kept"), [(0.0, 4), (0.5, 3), (-0.5, 3)])
@pytest.mark.parametrize("bent", [0.0, 100.0])
def test_a_reflector_that_is_not_where_it_is_drawn_is_left_out_where_the_others_hold_the_frame(off, kept, bent):
    """From one line of reflectors no frame is told: there it stays, whatever it says."""
    spots = np.array([[0.0, 0.0, 0.0], [300.0, bent, 0.0], [700.0, 0.0, 0.0], [200.0, 400.0, 0.0]])
    place = {str(number): spot for number, spot in enumerate(spots)}
    visits = {name: np.tile(spot, (2, 1)) for name, spot in place.items()}
    visits["3"] = visits["3"] + off
    rows = {name: np.array([number, 50 + number]) for number, name in enumerate(place)}
    found = sound_visits(visits, rows, place, 0.01)
    assert sum(own.any() for own in found.values()) == (kept if bent else 4)


def test_a_unit_of_length_that_is_wrong_leaves_no_reflector_out():
    """The one far off is off by most, and has most to say of it."""
    spots = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [0.0, 300.0, 0.0], [4000.0, 200.0, 0.0]])
    place = {str(number): spot for number, spot in enumerate(spots)}
    visits = {name: np.tile(spot * (1.0 + 4e-5), (2, 1)) for name, spot in place.items()}
    rows = {name: np.array([number, 50 + number]) for number, name in enumerate(place)}
    assert all(own.all() for own in sound_visits(visits, rows, place, 0.01).values())


def test_a_visit_that_is_off_across_most_distances_is_left_out_beside_a_knock():
    """Two of its three distances change by less than air does; no motion of the round brings it home."""
    spots = np.array([[211.0, 420.0, 33.0], [-462.0, -85.0, -5.0], [284.0, -374.0, -87.0], [11.0, -13.0, 414.0]])
    place = {str(number): spot for number, spot in enumerate(spots)}
    rows = {name: np.array([number, 50 + number]) for number, name in enumerate(place)}
    random = np.random.default_rng(5)
    lost, found = 0, 0
    for _ in range(200):
        moved = spots + 0.1 + np.cross([4e-4, -3e-4, 2e-4], spots)
        rounds = np.stack([spots, moved]) + random.normal(0.0, 0.006, (2, 4, 3))
        sound = sound_visits(dict(zip(place, rounds.swapaxes(0, 1), strict=True)), rows, place, 0.005)
        lost += sum((~own).sum() for own in sound.values())
        rounds[1, 0] += [0.096, -0.194, -0.128]
        sound = sound_visits(dict(zip(place, rounds.swapaxes(0, 1), strict=True)), rows, place, 0.005)
        found += sum((~own).sum() for own in sound.values()) == 1 and not sound["0"][1]
    assert lost <= 2  # of 1,600
    assert found >= 190


def test_readings_of_reflectors_are_judged_however_many_rounds_there_are():
    """Stretched as a whole they are the tracker's scale; what is off in one round is off there alone."""
    place = {str(number): spot for number, spot in enumerate(1.0001 * PLACES)}
    rows = {name: np.arange(300) * 10 + number for number, name in enumerate(place)}
    visits = {name: PLACES[number] + np.zeros((300, 3)) for number, name in enumerate(place)}
    random = np.random.default_rng(6)
    visits = {name: read + random.normal(0.0, 0.004, read.shape) for name, read in visits.items()}
    visits["2"][170] += [0.1, 0.1, -0.1]
    sound = sound_visits(visits, rows, place, 0.005)
    assert not sound["2"][170] and sum((~own).sum() for own in sound.values()) == 1
