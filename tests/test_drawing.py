"""Machines of which every size of the drawing is off by about what readings scatter by, as all real ones are."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.challenge.cases import LITTLE, SIZES_OF_DRAWING, draw, plan
from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.atoms import is_field
from ptt.diagnosis.evidence.effect_atoms import atoms_of
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search import drawing as drawing_module
from ptt.diagnosis.search.drawing import by_drawing
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.fitting.linear import linear_columns
from ptt.fitting.opening import undecided_rows
from ptt.fitting.solve import fit
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

NOISE = 0.004  # mm, one coordinate
LINKS, ZEROS = np.array([0.022, -0.015, 0.012]), np.array([-0.02, 0.03, 0.015])  # mm: a few times what readings scatter
LEADS = 2e-4 * np.array([1.0, -1.0, 0.5])
TOWERS = np.array([[0.03, -0.02, 0.0], [0.01, 0.03, 0.0], [-0.03, 0.01, 0.0]])


CUBE = 40.0 * np.array([[0, 0, 0], [1, 1, 1], [-1, -1, 1], [1, -1, -1], [-1, 1, -1]])  # ISO 9283: P1 to P5


def off_in_all(
    rows: int, seed: int, field: float = 0.0, poses: np.ndarray | None = None, times: float = 1.0
) -> Problem:
    """A tripod of which links, zeros, towers and leads are off, its platform moved by a field of the place besides.

    Args:
        rows: number of readings.
        seed: of the poses and of the noise.
        field: size of the field, mm.
        poses: that are gone through again and again; None draws each at random.
        times: how far the sizes are off beside the usual here.
    """
    file = bench()
    spec, random = file.machine, np.random.default_rng(seed)
    robot = build_mechanism(spec)
    target = random.uniform(-45.0, 45.0, (rows, 3)) if poses is None else poses[np.arange(rows) % len(poses)]
    q = robot.inverse(torch.as_tensor(target)).numpy()
    sliders = q + times * ZEROS + times * LEADS * (q - q.mean(axis=0))
    azimuth = np.radians(spec.slider_azimuth_deg)
    ways = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(3)])
    base, joint = spec.base_radius_mm * ways + times * TOWERS, spec.platform_radius_mm * ways
    length, place = spec.link_length_mm + times * LINKS, target.copy()
    rail = robot.rail.numpy()
    for _ in range(20):  # Newton's way to where links of these lengths reach
        foot = base + sliders[:, :, None] * rail
        link = place[:, None] + joint - foot
        left = np.square(link).sum(axis=2) - length**2
        place = place - np.linalg.solve(2.0 * link, left[:, :, None])[:, :, 0]
    assert np.abs(left).max() < 1e-6
    bent = field * np.sin(target / 15.0) * np.roll(np.cos(target / 11.0), 1, axis=1)
    read = place + bent + random.normal(0.0, NOISE, target.shape)
    told = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": NOISE * 3.0**0.5, "frame": "fitted"}))
    return build_problem(told, replace(make_table(target, q), measured=read))


@pytest.mark.parametrize(
    ("times", "seed"),
    [pytest.param(1.0, 3, marks=pytest.mark.long), (1.0, 8), pytest.param(2.0, 4, marks=pytest.mark.long)],
)
def test_sizes_that_are_all_off_a_little_are_named_and_no_unknown_of_the_place(times: float, seed: int) -> None:
    found = diagnose(Model(bench()), off_in_all(150, seed, times=times))
    assert found.verdict == "missing" and len(found.suggested) > 1
    names = {name for names in found.suggested for name in names[:1]}
    assert all(library()[name].of_drawing for name in names)
    assert found.rms_um["after"]["total"] < 1.15 * 1e3 * NOISE * 3.0**0.5
    pulls = pulls_of(found, times)
    assert np.abs(pulls).max() < 2.5 and np.sqrt(np.mean(pulls**2)) > 0.15  # three on seed 8 beside nothing unnamed


def pulls_of(found: Diagnosis, times: float) -> np.ndarray:
    """Of every stated value, how many of its standard errors it lies from what is off."""
    azimuth = np.radians(bench().machine.slider_azimuth_deg)
    out, around = (
        np.column_stack([np.cos(azimuth), np.sin(azimuth)]),
        np.column_stack([-np.sin(azimuth), np.cos(azimuth)]),
    )
    true = {
        "offset_mm": times * ZEROS, "length_mm": times * LINKS, "scale": times * LEADS,
        "radial_mm": times * (TOWERS[:, :2] * out).sum(axis=1),
        "tangential_mm": times * (TOWERS[:, :2] * around).sum(axis=1),
    }  # fmt: skip
    pulls = []
    for candidate in found.candidates[: len(found.suggested)]:
        for item in candidate.parameters:
            name, _, joint = item.name.partition(" ")
            off = true[name][int(joint) - 1] if name in true and candidate.effect != "joint-offset" else 0.0
            pulls += [(item.value - off) / item.std] if item.std else []
    return np.array(pulls)


@pytest.mark.parametrize(
    ("times", "seed"),
    [
        pytest.param(4.0, 5, marks=pytest.mark.long),
        (4.0, 9),
        pytest.param(10.0, 4, marks=pytest.mark.long),
        pytest.param(10.0, 6, marks=pytest.mark.long),
        pytest.param(10.0, 8, marks=pytest.mark.long),
    ],
)
def test_neither_errors_of_each_pose_nor_what_a_few_poses_label_take_the_place_of_sizes(
    times: float, seed: int
) -> None:
    """Of five poses an unknown says as much as sizes do, and hidden ones hardly tell what these are."""
    found = diagnose(Model(bench()), off_in_all(150, seed, poses=CUBE, times=times))
    assert found.verdict == "missing" and found.rms_um["after"]["total"] < 1.15 * 1e3 * NOISE * 3.0**0.5
    assert all(library()[step[0]].of_drawing for step in found.suggested)


@pytest.mark.parametrize("seed", [pytest.param(4, marks=pytest.mark.long), 6])
def test_nor_are_they_unknown_where_a_rail_does_the_same(seed: int) -> None:
    found = diagnose(Model(bench()), off_in_all(150, seed, poses=CUBE, times=4.0))
    assert found.verdict == "missing" and "together would do the same" in found.words


def test_what_sizes_of_a_drawing_cannot_do_stays_unknown() -> None:
    found = diagnose(Model(bench()), off_in_all(150, 3, field=0.03))
    assert found.verdict == "unknown"


def _scorer(problem: Problem, *further: str) -> Scorer:
    model, noise = Model(bench()), Noise(np.eye(3) * NOISE**2, "machine file")
    fitted = fit(model, problem, noise=noise)
    candidates = [make_effect(library(), name) for name in (*SIZES_OF_DRAWING, *further)]
    return Scorer(build_row_system(fitted, problem, candidates, noise, 1e3, problem.used))


def test_once_one_size_is_off_further_ones_cost_no_name_against_an_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    scorer = _scorer(off_in_all(150, 3))
    field = scorer.score(["tool gently on x and y and z"], WHITE)
    less, named = by_drawing(scorer, field)
    atoms = [less.system.atoms[key] for key in named.keys]
    assert not less.fields and len(atoms) > 1 and all(atom.effect is not None for atom in atoms)
    assert not any(is_field(atom) and less.opens(named.keys)(atom) for atom in less.system.atoms.values())
    monkeypatch.setattr(drawing_module, "EVEN_ODDS", 1e3)  # as if each further one cost far more than a name
    assert by_drawing(scorer, field) == (scorer, field)


@pytest.mark.parametrize(("scale", "kept"), [(0.0, False), (2e-4, True)])
def test_a_scale_of_the_tracker_goes_where_sizes_say_clearly_more(scale: float, kept: bool) -> None:
    problem = off_in_all(150, 3, times=2.0 * (scale == 0.0))
    problem = replace(problem, measured=problem.measured * (1.0 - scale))
    scorer = _scorer(problem, "tracker-scale")
    key = next(key for key, atom in scorer.system.atoms.items() if atom.name == "tracker-scale")
    less, state = by_drawing(scorer, scorer.score([key], WHITE))
    assert (key in state.keys) == kept and ("tracker-scale" in less.barred) != kept


def test_a_set_without_an_unknown_of_the_place_is_left_as_it_is() -> None:
    scorer = _scorer(off_in_all(60, 3))
    state = scorer.score([next(key for key, atom in scorer.system.atoms.items() if atom.name == "link-length")], WHITE)
    assert by_drawing(scorer, state) == (scorer, state)


def test_sizes_are_drawn_beside_one_fault() -> None:
    case = plan("dense", 1, 5)[0]
    assert case.faults[1:] == SIZES_OF_DRAWING and case.faults[0] not in SIZES_OF_DRAWING
    _, truth = draw(case)
    small = {fault.name: fault.size / truth.noise.total for fault in truth.faults if fault.name in SIZES_OF_DRAWING}
    assert len(small) > 3 and max(small.values()) < 1.3 * LITTLE[1]


@pytest.mark.parametrize(
    ("name", "told"), [("link-compliance", False), ("axis-compliance", False), ("link-length", True)]
)
def test_a_spring_that_always_carries_the_same_is_none_before_a_size_of_the_drawing(name: str, told: bool) -> None:
    """Of sets that do alike the one with a size of the drawing is said; with two loads, or torques, either may be."""
    problem = off_in_all(40, 3)
    loads = replace(problem.table, payload_kg=np.tile([0.5, 2.0], 20))
    for table, tested in ((problem.table, told), (loads, True)):
        one = build_problem(problem.file, table)
        fitted = fit(Model(problem.file), one, noise=Noise(np.eye(3) * NOISE**2, "machine file"))
        effect = make_effect(library(), name)
        linear = linear_columns(fitted, one, [effect], fitted.noise)
        assert {atom.tested for atom in atoms_of(linear, fitted, one, [effect]).values()} == {tested}


def test_rows_at_which_a_link_carries_next_to_nothing_say_nothing_of_the_side_on_which_it_lies() -> None:
    """The force of a link changes its sign along a line through the platform's joints; a drawing is off by more."""
    file = bench()
    spec = file.machine.model_copy(update={"platform_mass_kg": 2.0})
    file = replace(file, machine=spec)
    along = np.linspace(-80.0, 80.0, 321)
    target = np.column_stack([along, 0.3 * along, np.full(321, 5.0)])
    robot = build_mechanism(spec)
    table = make_table(target, robot.inverse(torch.as_tensor(target)).numpy())
    problem = build_problem(file, replace(table, measured=target))
    clearance = make_effect(library(), "joint-clearance")
    assert clearance.needs(problem.view) is None
    side = clearance.basis(problem.view, {})[:, :, :].sum(dim=2).sign().numpy()
    turns = np.flatnonzero((np.diff(side, axis=0) != 0).any(axis=1))
    told = undecided_rows([Term(clearance, torch.full((3,), 0.02, dtype=torch.float64))], problem)
    assert len(turns) and told.any() and told.mean() < 0.05
    assert all(told[turn] or told[turn + 1] for turn in turns)
    assert np.abs(np.flatnonzero(told)[:, None] - turns).min(axis=1).max() <= 4
    assert not undecided_rows([Term(clearance, torch.zeros(0, dtype=torch.float64))], problem).any()
