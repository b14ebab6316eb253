"""Sizes of the drawing that a model does not have: what they leave open of its values, and of commands elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from test_effects_words import hide_in_arm
from test_sigma import FILE as DRAWN
from test_sigma import SIGMA, path_of, went

from ptt.again.recheck import recheck
from ptt.correct.compensate import NetworkError, compensate
from ptt.diagnosis.diagnose import diagnose
from ptt.effects.registry import library, make_effect
from ptt.fitting import chunks, drawn_sizes
from ptt.fitting.beside_unnamed import beside_unnamed
from ptt.fitting.drawn_sizes import unnamed_sizes
from ptt.fitting.kept import keep, kept_covariance
from ptt.fitting.solve import fit
from ptt.fitting.tool_sigma import tool_sigma
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine, parse_machine
from ptt.machine_schema import MaskedSpec, TrackerSpec
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.plan.elsewhere import Elsewhere
from ptt.rig import parse_rig, simulate
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

FILE = replace(DRAWN, tracker=TrackerSpec(frame="trusted", sigma_mm=SIGMA))
CUBE = 40.0 * np.array([[0, 0, 0], [1, 1, 1], [-1, -1, 1], [1, -1, -1], [-1, 1, -1]])  # ISO 9283: P1 to P5


def machine(seed: int) -> dict:
    """Every size off by about what it is on a real machine."""
    random = np.random.default_rng([seed, 5])
    drive = {"homing_mm": 0.05, "scale_um_per_m": 80.0}
    geometry = {"tower_radial_mm": 0.05, "tower_tangential_mm": 0.05, "link_mm": 0.05, "lean_radial_mrad": 0.3,
                "lean_tangential_mrad": 0.3}  # fmt: skip
    return {
        section: {name: random.normal(0.0, size, 3).tolist() for name, size in sizes.items()}
        for section, sizes in (("drive", drive), ("geometry", geometry))
    }


def read(rig, place: np.ndarray, seed: int) -> Problem:
    """Readings of a rig, in the frame that the file trusts."""
    truth = simulate(rig, path_of(place), noise=False).truth
    noisy = truth + np.random.default_rng(seed).normal(0.0, SIGMA, place.shape)
    return build_problem(FILE, replace(make_table(place), measured=noisy))


def solved(place: np.ndarray, seed: int, *names: str):
    """A rig, the readings of it, a ladder of some effects, and the model as a file keeps it."""
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": seed, **machine(seed)})
    ladder = climb(Model(FILE), read(rig, place, seed), [make_effect(library(), name) for name in names])
    return rig, ladder, read_model(parse_machine(format_machine(record(ladder, "add", []))))


def test_commands_far_from_five_poses_are_as_uncertain_as_they_are_wrong() -> None:
    """Towers alone make good for all sizes at five poses; elsewhere the corrected machine misses by many times that."""
    wanted, pulls, ratios = np.random.default_rng(2).uniform(-60.0, 60.0, (40, 3)).round(3), [], []
    for seed in range(6):
        rig, ladder, model = solved(np.tile(CUBE, (12, 1)), seed, "tower-position", "tower-tilt")
        commands = compensate(model, make_table(wanted))
        error = np.linalg.norm(went(rig, wanted, commands.q) - wanted, axis=1)
        pulls.append(np.square(error) / commands.sigma**2)
        ratios.append(1e-3 * ladder.steps[-1].rms_um["total"] / np.sqrt(np.mean(error**2)))
        assert (commands.status == "uncertain").mean() > 0.5
    assert max(ratios) < 0.5  # the readings were met far better
    assert 0.2 < np.mean(pulls) < 2.0


def test_what_a_network_has_learned_is_no_doubt_within_its_domain() -> None:
    wanted = np.random.default_rng(2).uniform(-60.0, 60.0, (40, 3)).round(3)
    *_, model = solved(np.tile(CUBE, (12, 1)), 0, "tower-position", "tower-tilt")
    bare, near = compensate(model, make_table(wanted)).sigma, wanted[:, 0] > 0.0
    for inside, share in ((0.02, 1.0), (0.002, 0.1)):
        network = NetworkError(inside=inside, outside=0.02)
        learned = compensate(
            model, make_table(wanted), correction=lambda p, _: p, inside=lambda p, _: p[:, 0] > 0.0, network=network
        )
        np.testing.assert_allclose(learned.sigma[~near], np.maximum(bare, 0.02)[~near])
        assert (learned.sigma[near] >= np.maximum(share * bare[near], inside) - 1e-12).all()
        assert (learned.sigma[near].max() < 0.5 * bare[near].max()) == (share < 1.0)


def test_where_readings_fill_the_volume_they_leave_little_open() -> None:
    random = np.random.default_rng(3)
    place, wanted = (random.uniform(-half, half, (count, 3)).round(3) for half, count in ((60.0, 200), (50.0, 40)))
    for seed in range(2):
        names = ("homing-offset", "lead-scale", "tower-position", "tower-tilt")
        rig, _, model = solved(place, seed, *names)
        commands = compensate(model, make_table(wanted))
        error = np.linalg.norm(went(rig, wanted, commands.q) - wanted, axis=1)
        assert 0.2 < np.mean(np.square(error) / commands.sigma**2) < 2.0
        assert set(commands.status) == {"ok"} and np.median(commands.sigma) < SIGMA


def test_values_are_as_uncertain_as_what_is_not_named_makes_them() -> None:
    """A tower's place, told at five poses beside sizes that are off and not in the model."""
    inside, before = [], []
    for seed in range(8):
        true = machine(seed)["geometry"]
        _, ladder, _ = solved(np.tile(CUBE, (12, 1)), seed, "tower-position")
        fitted = ladder.steps[-1].fitted
        off = fitted.values - np.concatenate([true["tower_radial_mm"], true["tower_tangential_mm"]])
        inside += (np.abs(off) < 2.0 * fitted.std).tolist()
        before += (np.abs(off) < 2.0 * np.sqrt(np.diag(fitted.covariance))).tolist()
    assert np.mean(inside) > 0.9 and np.mean(before) < 0.6


def test_what_readings_exclude_leaves_a_fit_as_it_is() -> None:
    """A lead that is off, on a machine that is else as drawn, seen all over its volume."""
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 3, "drive": {"scale_um_per_m": [80.0, -60.0, 40.0]}})
    problem = read(rig, np.random.default_rng(3).uniform(-60.0, 60.0, (300, 3)).round(3), 3)
    fitted = fit(Model(FILE) + library()["lead-scale"](), problem)
    beside = beside_unnamed(fitted, problem)
    assert (beside.std < 3.0 * fitted.std).all() and (beside.std >= fitted.std).all()
    np.testing.assert_array_equal(beside.covariance, fitted.covariance)
    every = [name for name, effect in library().items() if effect.of_drawing and "three-ptt" in effect.mechanisms]
    whole = Model(FILE)
    for name in every:
        whole = whole + library()[name]()
    beside = beside_unnamed(fit(whole, problem), problem)
    assert beside.unnamed is not None and not beside.unnamed.effects  # nothing is left that could be off


def test_what_is_one_size_under_two_names_leaves_it_as_sure_as_it_is() -> None:
    """Along the rail the offset of a joint is a zero, at all poses: no reading tells, and no command asks."""
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 3, "drive": {"homing_mm": [0.1, -0.05, 0.03]}})
    problem = read(rig, np.random.default_rng(3).uniform(-60.0, 60.0, (300, 3)).round(3), 3)
    fitted = fit(Model(FILE) + library()["homing-offset"](), problem)
    assert (beside_unnamed(fitted, problem).std < 3.0 * fitted.std).all()


def test_of_the_geometry_of_an_arm_all_but_its_zeros_is_beside_these() -> None:
    problem = hide_in_arm()
    fitted = fit(Model(problem.file) + library()["homing-offset"](), problem)
    unnamed = beside_unnamed(fitted, problem).unnamed
    assert unnamed is None or all(effect.name != "homing-offset" for effect in unnamed.effects)
    assert [effect.name for effect in unnamed_sizes(["homing-offset"], problem)] == ["lead-scale"]
    assert "dh-offsets" in [effect.name for effect in unnamed_sizes(["lead-scale"], problem)]
    asked = drawn_sizes.sizes_beside(fitted, problem)[0]
    geometry = next(size for size in asked if size.effect.name == "dh-offsets")
    assert (geometry.group.reshape(5, 6) == -1).all(axis=1).tolist() == [False, False, False, True, False]


def test_of_a_long_run_stretches_stand_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 1, **machine(1)})
    problem = read(rig, np.tile(CUBE, (200, 1)), 1)
    fitted = fit(Model(FILE) + library()["tower-position"](), problem)
    whole = beside_unnamed(fitted, problem).std
    monkeypatch.setattr(chunks, "LONG", 500)
    monkeypatch.setattr(chunks, "SAMPLE_ROWS", 300)
    np.testing.assert_allclose(beside_unnamed(fitted, problem).std, whole, rtol=0.3)


def test_a_diagnosis_states_as_add_does_gross_errors_aside() -> None:
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 3, "drive": {"scale_um_per_m": [80.0, -60.0, 40.0]}})
    problem = read(rig, np.random.default_rng(3).uniform(-60.0, 60.0, (150, 3)).round(3), 3)
    broken = problem.measured.copy()
    broken[[20, 70, 120]] += [[5.0, 0.0, 2.0], [0.0, -8.0, 1.0], [3.0, 3.0, 3.0]]
    for readings in (problem, replace(problem, measured=broken)):
        (candidate,) = diagnose(Model(FILE), readings).candidates[:1]
        ladder = climb(Model(FILE), readings, [library()["lead-scale"]()])
        told = [item.std for item in candidate.parameters]
        np.testing.assert_allclose(told, ladder.steps[-1].fitted.std[:3], rtol=0.3)


def test_what_is_wholly_open_is_not_measured() -> None:
    _, ladder, _ = solved(np.tile(CUBE, (12, 1)), 1, "tower-position")
    values = [value for value in ladder.report.values if value.effect == "tower-position"]
    assert any(value.measured == "in part" for value in values)
    place = np.random.default_rng(3).uniform(-60.0, 60.0, (200, 3)).round(3)
    _, ladder, _ = solved(place, 1, "tower-position", "tower-tilt", "homing-offset", "lead-scale", "link-length")
    assert all(value.measured == "yes" for value in ladder.report.values if value.effect == "lead-scale")


def test_a_file_keeps_what_a_fit_knows() -> None:
    _, ladder, model = solved(np.tile(CUBE, (6, 1)), 1, "tower-position")
    kept, fitted = kept_covariance(model), ladder.steps[-1].fitted
    assert kept is not None and kept.unnamed is not None
    here, terms = keep(fitted), [(term.effect, term.theta) for term in model.terms]
    view = build_view(FILE, make_table(np.random.default_rng(2).uniform(-60.0, 60.0, (9, 3))))
    there = tool_sigma(kept, terms, view, FILE)
    np.testing.assert_allclose(there, tool_sigma(here, terms, view, FILE), rtol=1e-4)
    assert (there > 1.5 * tool_sigma(replace(kept, unnamed=None), terms, view, FILE)).all()


@pytest.mark.parametrize("spec", [MaskedSpec(of=("lead-scale",), told="!"), MaskedSpec(of=("of-another",), told="")])
def test_what_cannot_be_read_of_it_is_left_aside(spec: MaskedSpec) -> None:
    _, _, model = solved(np.tile(CUBE, (6, 1)), 1, "tower-position")
    assert model.file.covariance is not None
    covariance = model.file.covariance.model_copy(update={"unnamed": spec})
    kept = kept_covariance(replace(model, file=replace(model.file, covariance=covariance)))
    assert kept is not None and kept.unnamed is None


@pytest.mark.long
def test_a_diagnosis_says_where_its_readings_tell_less() -> None:
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 2, **machine(2)})
    five = diagnose(Model(FILE), read(rig, np.tile(CUBE, (20, 1)), 2))
    assert five.elsewhere is not None and five.elsewhere.workspace > 5.0 * five.elsewhere.run
    assert "over half of the workspace the expected error is" in five.words
    assert five.to_dict()["elsewhere_um"] == {"run": five.elsewhere.run, "workspace": five.elsewhere.workspace}
    place = np.random.default_rng(3).uniform(-75.0, 75.0, (200, 3)).round(3)
    many = diagnose(Model(FILE), read(rig, place, 2))
    assert many.elsewhere is not None and many.elsewhere.workspace < 0.2 * five.elsewhere.workspace
    assert Elsewhere(2.0, 29.0).words(10.0) == "" and "29 um" in Elsewhere(2.0, 29.0).words(9.0)
    sound = diagnose(Model(FILE), build_problem(FILE, replace(make_table(place), measured=place + SIGMA)))
    assert sound.elsewhere is None


@pytest.mark.long
def test_commands_elsewhere_are_better_where_all_sizes_are_fitted() -> None:
    """Of five poses the sizes that are not named would be told by none; learned together they lie near the drawing."""
    wanted, better = np.random.default_rng(2).uniform(-60.0, 60.0, (40, 3)).round(3), []
    for seed in range(6):
        rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": seed, **machine(seed)})
        problem, names = read(rig, np.tile(CUBE, (12, 1)), seed), ["tower-position", "tower-tilt"]
        missed = []
        for further in ([], [effect.key for effect in unnamed_sizes(names, problem)]):
            ladder = climb(Model(FILE), problem, [make_effect(library(), name) for name in (*names, *further)])
            commands = compensate(ladder.model, make_table(wanted))
            missed.append(np.sqrt(np.mean(np.square(went(rig, wanted, commands.q) - wanted))))
        better.append(missed[1] / missed[0])
    assert max(better) < 0.5


def test_a_recheck_elsewhere_expects_what_the_first_run_left_open() -> None:
    """The same machine, read all over its volume: its errors are those that five poses could not tell."""
    for seed in range(2):
        rig, _, model = solved(np.tile(CUBE, (12, 1)), seed, "tower-position", "tower-tilt")
        place = np.random.default_rng(9 + seed).uniform(-60.0, 60.0, (80, 3)).round(3)
        again = recheck(model, read(rig, place, seed + 50))
        error = again.to_dict()["error_um"]
        assert again.verdict == "same" and 0.5 < error["now"] / error["expected"] < 2.0


def test_values_that_may_as_well_be_others_say_so() -> None:
    """In a frame of its own, zeros that differ beside rails that lean outward look like rails that lean sideways."""
    file = replace(FILE, tracker=FILE.tracker.model_copy(update={"frame": "fitted", "base_point": ()}))
    lean = {"lean_radial_mrad": [3.9, -2.0, -1.9]}
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 3, "drive": {"homing_mm": [-0.34, 0.36, 0.23]},
                     "geometry": lean})  # fmt: skip
    problem = read(rig, np.random.default_rng(3).uniform(-50.0, 50.0, (200, 3)).round(3), 3)
    problem = build_problem(file, problem.table)
    fitted = fit(Model(file) + library()["tower-tilt"](), problem)
    beside = beside_unnamed(fitted, problem)
    assert ("tower-tilt", "homing-offset") in beside.unnamed.otherwise
    off = np.abs(fitted.values[:3] - 1e-3 * np.array(lean["lean_radial_mrad"]))
    assert (off / fitted.std[:3]).max() > 50.0
    assert (off / beside.std[:3]).max() < 10.0  # the readings have 30 to one against it, and an error is no such odds
