"""The fit: truth recovered, frames, noise, held-out rows, gross errors, what cannot be seen, bad input."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize
from scipy.spatial.transform import Rotation

from ptt.effects import Effect, library
from ptt.effects.bench import sample_machine
from ptt.effects.layout import flatten
from ptt.errors import MachineError, ModelError, PosesError, TableError
from ptt.fitting.gauss_newton import HOPELESS, bounded_step, descend
from ptt.fitting.observability import correlations, unobservable
from ptt.fitting.outliers import inside
from ptt.fitting.report import Value, format_fit, report_fit
from ptt.fitting.result import FitResult
from ptt.fitting.search import open_terms
from ptt.fitting.solve import fit, residual_of, rms
from ptt.fitting.stated import unseen_directions
from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.machine_schema import BasePoint
from ptt.model.chain import predict
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model, Term
from ptt.run.frames import rigid_columns, rotation
from ptt.run.holdout import BLOCKS, blocks, folds, pose_groups
from ptt.run.noise import DEFAULT_SIGMA, Noise, given_noise, noise_from_repeats, noise_from_std
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view

SIGMA = 0.003
TRACKER = Rotation.from_rotvec([0.3, 2.0, 1.0]).as_matrix()
PLACE = np.array([1000.0, 2000.0, -300.0])
KNOWN = library()


def machine(**tracker: object) -> MachineFile:
    file = sample_machine("three-ptt")
    return replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA, **tracker}))


def test_values_with_which_the_machine_cannot_stand_where_it_was_sent_are_refused_by_row() -> None:
    """Readings kilometres away ask for offsets beyond every link: that is no fit, and no error of ours."""
    file = machine()
    table = empty_run(40)
    table = table.replace(measured=table.target.copy())
    far = Term(KNOWN["homing-offset"](), torch.tensor([1e6, 0.0, -1e6], dtype=torch.float64))
    with pytest.raises(PosesError, match=r"table row 2 and 39 more: .* homing-offset, the machine cannot stand"):
        fit(Model(file) + far, build_problem(file, table))


def empty_run(rows: int = 200, seed: int = 1) -> Table:
    random = np.random.default_rng(seed)
    return make_table(
        random.uniform(-60.0, 60.0, (rows, 3)),
        payload_kg=random.choice([0.0, 5.0], rows),
        temp_c=20.0 + random.uniform(0.0, 8.0, rows),
        time_s=10.0 * np.arange(rows),
        feed_mm_s=random.choice([5.0, 20.0, 40.0], rows),
    )


def term(name: str, view: object, amplitude: list[float], **shape: float) -> Term:
    effect = KNOWN[name]()
    chosen = {stem: torch.tensor([value], dtype=torch.float64) for stem, value in shape.items()}
    theta = flatten(effect, chosen or effect.search(view)[0], 3)
    theta[: len(amplitude)] = torch.tensor(amplitude, dtype=torch.float64)
    return Term(effect, theta)


def measure(table: Table, file: MachineFile, terms: list[Term], seed: int = 2, noise: float = SIGMA) -> Table:
    """Readings of a machine with these effects, by a tracker that stands anywhere."""
    view = build_view(file, table)
    reading = predict([(item.effect, item.theta) for item in terms], view).reading.numpy()
    random = np.random.default_rng(seed)
    return replace(table, measured=reading @ TRACKER.T + PLACE + random.normal(0.0, noise, reading.shape))


def fitted(names: list[str], problem: Problem, **options: object) -> FitResult:
    model = Model(problem.file)
    for name in names:
        model = model + KNOWN[name]()
    return fit(model, problem, **options)


def hidden_backlash(rows: int = 200, **tracker: object) -> tuple[Problem, list[Term]]:
    file, table = machine(**tracker), empty_run(rows)
    terms = [term("backlash", build_view(file, table), [0.03, 0.05, 0.02])]
    return build_problem(file, measure(table, file, terms)), terms


def test_truth_lies_within_the_standard_errors_and_the_rest_is_noise() -> None:
    problem, terms = hidden_backlash()
    result = fitted(["backlash"], problem)
    found = result.model.terms[0]
    assert result.status == "converged"
    assert found.measured is not None and bool(found.measured.all())
    assert found.std is not None
    distance = ((found.theta - terms[0].theta) / found.std)[:3]
    assert float(distance.abs().max()) < 4.0
    assert 0.8 < result.chi2 / result.freedom < 1.2
    assert rms(result.residual, problem.used)["total"] == pytest.approx(SIGMA * np.sqrt(3.0) * 1e3, rel=0.15)


def test_without_noise_the_truth_comes_back_exactly() -> None:
    file, table = machine(), empty_run()
    truth = term("link-length", build_view(file, table), [0.1, -0.05, 0.2])
    result = fitted(["link-length"], build_problem(file, measure(table, file, [truth], noise=0.0)))
    # Rows whose noise is unknown to be none pull toward zero by that noise's own share.
    torch.testing.assert_close(result.model.terms[0].theta, truth.theta, rtol=1e-4, atol=0.0)


def test_fit_agrees_with_scipy_on_the_same_residual() -> None:
    problem, _ = hidden_backlash(80)
    result = fitted(["homing-offset", "link-length"], problem, robust=False)
    layout, whitener = result.layout, result.noise.whitener
    from ptt.fitting.whitened import build_whitened

    def residual(unknowns: np.ndarray) -> np.ndarray:
        system = build_whitened(layout, problem, whitener, unknowns)
        return np.concatenate([system.residual.ravel(), np.sqrt(result.prior.weight) * unknowns])

    peer = optimize.least_squares(residual, layout.start(), method="lm", xtol=1e-14, ftol=1e-14)
    assert result.chi2 + result.unknowns**2 @ result.prior.weight <= 2.0 * peer.cost + 1e-6
    np.testing.assert_allclose(result.unknowns, peer.x, atol=3e-4)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_bounded_step_keeps_the_optimality_conditions(seed: int) -> None:
    random = np.random.default_rng(seed)
    size = int(random.integers(1, 8))
    root = random.normal(size=(size + 2, size))
    normal, side = root.T @ root + 1e-3 * np.eye(size), random.normal(size=size)
    lower, upper = -random.uniform(0.0, 0.5, size), random.uniform(0.0, 0.5, size)
    step = bounded_step(normal, side, lower, upper)
    slope = side - normal @ step
    assert (step >= lower - 1e-12).all() and (step <= upper + 1e-12).all()
    inner = (step > lower + 1e-9) & (step < upper - 1e-9)
    np.testing.assert_allclose(slope[inner], 0.0, atol=1e-8)
    assert (slope[step <= lower + 1e-9] <= 1e-8).all() and (slope[step >= upper - 1e-9] >= -1e-8).all()


def test_descent_that_cannot_go_down_says_so() -> None:
    def wrong(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        return np.eye(1), np.array([1.0]), float(5.0 + at[0])  # claims that going up lowers the cost

    ended = descend(wrong, np.zeros(1), np.full(1, -np.inf), np.full(1, np.inf))
    assert ended.status.startswith("not converged")


def test_a_descent_ends_where_what_was_asked_for_is_out_of_reach():
    design, far = np.array([[1.0, 0.2], [0.0, 1.0], [0.5, 0.5]]), np.array([3.0, 1.0, 20.0])
    least = np.linalg.lstsq(design, far, rcond=None)[1][0]
    asked = []

    def equations(at):
        asked.append(at)
        left = far - design @ at
        return design.T @ design, design.T @ left, float(left @ left)

    free = np.full(2, np.inf)
    assert descend(equations, np.zeros(2), -free, free, hopeless=1.01 * least).status == "converged"
    asked.clear()
    ended = descend(equations, np.full(2, 11.0), -free, free, hopeless=0.01 * least)
    assert ended.status == HOPELESS and len(asked) <= 2


def test_a_reversal_that_is_not_there_stops_at_its_bound() -> None:
    file, table = machine(), empty_run()
    result = fitted(["windup"], build_problem(file, measure(table, file, [])))
    height = result.model.terms[0].theta[:3]
    assert bool((height >= 0.0).all()) and float(height.max()) < 0.002


def test_a_shape_is_searched_with_nothing_beside_it() -> None:
    file, table = machine(frame="trusted"), empty_run()
    truth = term("windup", build_view(file, table), [0.02, 0.01, 0.03], length=3.0)
    run = measure(table, file, [truth])
    still = replace(run, measured=(run.measured - PLACE) @ TRACKER)
    found = fitted(["windup"], build_problem(file, still)).model.terms[0]
    torch.testing.assert_close(found.theta[:3], truth.theta[:3], rtol=0.0, atol=3e-3)


# --- what cannot be seen


def test_common_homing_offset_is_not_measured_with_a_fitted_frame_and_is_with_a_trusted_one() -> None:
    file, table = machine(), empty_run()
    truth = term("homing-offset", build_view(file, table), [0.4, 0.1, -0.2])
    run = measure(table, file, [truth])
    loose = fitted(["homing-offset"], build_problem(file, run))
    assert loose.rank == 8 and loose.unseen.shape == (9, 1)
    assert not bool(loose.model.terms[0].measured.any())
    assert [item.text for item in unobservable(loose)] == [
        "homing-offset: offset of all sliders together cannot be told from tracker z"
    ]
    differences = loose.model.terms[0].theta - loose.model.terms[0].theta.mean()
    torch.testing.assert_close(differences, truth.theta - truth.theta.mean(), atol=5e-3, rtol=0.0)
    trusted = machine(frame="trusted")
    still = replace(run, measured=(run.measured - PLACE) @ TRACKER)
    tight = fitted(["homing-offset"], build_problem(trusted, still))
    assert tight.rank == 3 and bool(tight.model.terms[0].measured.all()) and not unobservable(tight)
    torch.testing.assert_close(tight.model.terms[0].theta, truth.theta, atol=2e-3, rtol=0.0)


def test_the_exact_ambiguities_are_named() -> None:
    file, table = machine(), empty_run(300)
    names = ["homing-offset", "tower-position", "tower-tilt", "link-length"]
    result = fitted(names, build_problem(file, measure(table, file, [])))
    told = {item.text for item in unobservable(result)}
    assert result.rank == 18 and len(result.unknowns) == 24
    assert told == {
        "homing-offset: offset of all sliders together cannot be told from tracker z",
        "tower-position: tangential of all legs together cannot be told from tracker rotation about z",
        "tower-position: common shift of all legs along x cannot be told from tracker x",
        "tower-position: common shift of all legs along y cannot be told from tracker y",
        "tower-tilt: common lean of all legs along x cannot be told from homing-offset (offset differing along x)"
        " together with tracker rotation about y",
        "tower-tilt: common lean of all legs along y cannot be told from homing-offset (offset differing along y)"
        " together with tracker rotation about x",
    }


def test_what_leaves_no_trace_is_said() -> None:
    file, table = machine(), replace(empty_run(), temp_c=np.full(200, 20.0))
    result = fitted(["screw-growth"], build_problem(file, measure(table, file, [])))
    found = unobservable(result)
    assert len(found) == 6 and all(not item.partners for item in found)
    assert "leaves no trace" in found[0].text


def test_joint_offset_is_told_to_be_a_homing_offset_and_nearly_a_link_length() -> None:
    file, table = machine(), empty_run(300)
    result = fitted(["joint-offset", "homing-offset", "link-length"], build_problem(file, measure(table, file, [])))
    partners = " ".join(item.text for item in unobservable(result))
    assert "joint-offset (rail_mm 1)" in partners or "homing-offset (offset_mm 1)" in partners
    pairs = correlations(result)
    assert pairs and all(abs(pair.value) > 0.9 for pair in pairs)
    assert {pairs[0].first.split()[0], pairs[0].second.split()[0]} == {"joint-offset", "link-length"}


def test_an_unseen_direction_is_one_that_the_data_know_less_than_its_usual_size() -> None:
    directions = unseen_directions(np.diag([4.0, 0.25, 1e9]))
    np.testing.assert_allclose(np.abs(directions), [[0.0], [1.0], [0.0]])


# --- frames


@settings(max_examples=30, deadline=None)
@given(st.tuples(*[st.floats(-0.2, 0.2)] * 3))
def test_rotations_and_their_derivatives(vector: tuple[float, float, float]) -> None:
    v = torch.tensor([vector], dtype=torch.float64)
    turn, by_vector = rotation(v)
    np.testing.assert_allclose(turn[0], Rotation.from_rotvec(vector).as_matrix(), atol=1e-9)
    for c in range(3):
        step = torch.zeros_like(v)
        step[0, c] = 1e-6
        numeric = (rotation(v + step)[0] - rotation(v - step)[0]) / 2e-6
        torch.testing.assert_close(by_vector[..., c], numeric, atol=1e-8, rtol=0.0)


def test_rigid_columns_are_the_slopes_of_a_rigid_motion() -> None:
    p = torch.randn(2, 5, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    about, length = p[0, 0], 40.0

    def moved(motion: torch.Tensor) -> torch.Tensor:
        return (p - about) @ rotation(motion[None, 3:] / length)[0][0].mT + about + motion[:3]

    slopes = torch.func.jacfwd(moved)(torch.zeros(6, dtype=torch.float64))
    torch.testing.assert_close(rigid_columns(p, about, length), slopes, rtol=0.0, atol=1e-14)
    torch.testing.assert_close(rigid_columns(p - about), rigid_columns(p, about), rtol=0.0, atol=0.0)


def two_setups(file: MachineFile) -> Table:
    table = replace(empty_run(120), run=np.repeat([0, 1], 60), run_label=("a", "b"))
    view = build_view(file, table)
    reading = predict([], view).reading.numpy() + np.random.default_rng(5).normal(0.0, SIGMA, (120, 3))
    moved = reading @ TRACKER.T + PLACE
    return replace(table, measured=np.where(table.run[:, None] == 0, reading, moved))


def test_one_frame_per_run_takes_what_one_frame_cannot() -> None:
    per_run, once = machine(frame="fitted-per-run"), machine()
    good = residual_of(Model(per_run), build_problem(per_run, two_setups(per_run)))
    bad = residual_of(Model(once), build_problem(once, two_setups(once)))
    assert rms(good.residual, good.residual[:, 0] < 1e9)["total"] < 6.0
    assert np.nanmax(np.abs(bad.residual)) > 100.0
    assert good.layout.frames == 2 and "tracker x of run b" in good.layout.names


def test_base_reflectors_tell_the_frame_and_so_the_common_homing_offset() -> None:
    places = {"p": (300.0, 0.0, -200.0), "q": (-300.0, 100.0, -200.0), "r": (0.0, -300.0, 200.0)}
    places["s"] = (50.0, 300.0, 300.0)
    points = tuple(BasePoint(name=name, xyz_mm=xyz, sigma_mm=0.001) for name, xyz in places.items())
    file = machine(frame="measured", base_point=points)
    poses = empty_run(150)
    table = make_table(
        np.concatenate([np.full((4, 3), np.nan), poses.target]),
        role=np.array(["base"] * 4 + ["pose"] * 150),
        name=np.array([*places, *[""] * 150]),
    )
    view = build_view(file, replace(table, target=np.where(np.isfinite(table.target), table.target, 0.0)))
    truth = term("homing-offset", view, [0.3, 0.3, 0.3])
    reading = predict([(truth.effect, truth.theta)], view).reading.numpy()
    reading[:4] = np.array(list(places.values()))
    noisy = reading @ TRACKER.T + PLACE + np.random.default_rng(3).normal(0.0, 1e-4, reading.shape)
    problem = build_problem(file, replace(table, measured=noisy))
    result = fitted(["homing-offset"], problem)
    assert bool(result.model.terms[0].measured.all())
    torch.testing.assert_close(result.model.terms[0].theta, truth.theta, atol=0.01, rtol=0.0)


def test_a_base_reflector_that_the_machine_file_lacks_is_refused() -> None:
    points = tuple(BasePoint(name=name, xyz_mm=(i, i * i, 0.0)) for i, name in enumerate("pqr"))
    file = machine(frame="measured", base_point=points)
    poses = empty_run(20)
    role, name = np.array(["base", *["pose"] * 19]), np.array(["z", *[""] * 19])
    with pytest.raises(TableError, match="base reflector 'z' is not in the machine file"):
        build_problem(file, replace(poses, measured=poses.target.copy(), role=role, name=name))


# --- gross errors


def test_gross_errors_are_found_by_line_and_do_not_move_the_fit() -> None:
    problem, _ = hidden_backlash()
    wrong = np.array([7, 60, 111, 150])
    measured = problem.table.measured.copy()
    measured[wrong] += np.array([0.5, -0.4, 0.3])
    table = replace(problem.table, measured=measured)
    result = fitted(["backlash"], build_problem(problem.file, table))
    np.testing.assert_array_equal(np.flatnonzero(result.outliers), wrong)
    report = report_fit(result, build_problem(problem.file, table))
    assert [line for line, _ in report.outliers] == table.line[wrong].tolist()
    clean = fitted(["backlash"], problem)
    torch.testing.assert_close(result.model.terms[0].theta, clean.model.terms[0].theta, atol=1e-3, rtol=0.0)
    blind = fitted(["backlash"], build_problem(problem.file, table), robust=False)
    assert not blind.outliers.any() and blind.chi2 > 10.0 * result.chi2


def test_sound_rows_are_no_outliers() -> None:
    random = np.random.default_rng(0)
    lost = [300 - inside(random.normal(size=(300, 3)), np.ones(300, dtype=bool)).sum() for _ in range(200)]
    assert np.mean(np.array(lost) > 0) < 0.02


# --- noise and its source


def repeated(spread: float, groups: int = 40, times: int = 3) -> Table:
    random = np.random.default_rng(4)
    target = np.repeat(random.uniform(-50.0, 50.0, (groups, 3)), times, axis=0)
    return make_table(target, measured=target + random.normal(0.0, spread, target.shape))


def test_noise_comes_from_std_columns_unless_repeats_scatter_by_more() -> None:
    table = repeated(0.006)
    direction = np.ones((table.rows, 3))
    small, large = np.full((table.rows, 3), 0.001), np.full((table.rows, 3), 0.02)
    outdone = given_noise(replace(table, std=small), table.measured, direction, 0.5)
    assert outdone.source == "repeats" and outdone.stated == (
        "std columns",
        noise_from_std(replace(table, std=small)).total,
    )
    stated = given_noise(replace(table, std=large), table.measured, direction, 0.5)
    assert stated.source == "std columns"
    np.testing.assert_allclose(stated.sigma, 0.02, rtol=1e-6)


def test_noise_of_repeats_then_of_the_machine_file_then_none() -> None:
    table, few = repeated(0.006), repeated(0.006, groups=5)
    pooled = given_noise(table, table.measured, np.ones((table.rows, 3)), None)
    assert pooled.source == "repeats" and pooled.freedom == 80
    np.testing.assert_allclose(pooled.sigma, 0.006, rtol=0.25)
    named = given_noise(few, few.measured, np.ones((few.rows, 3)), 0.004)
    assert named.source == "machine file" and named.sigma[0] == pytest.approx(0.004)
    assert given_noise(few, few.measured, np.ones((few.rows, 3)), None) is None
    assert noise_from_std(few) is None


def test_the_same_pose_reached_the_other_way_or_under_another_load_is_no_repeat() -> None:
    table = repeated(0.006)
    ways = np.ones((table.rows, 3))
    assert noise_from_repeats(table, table.measured, ways) is not None
    alternate = np.tile([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]], (40, 1))
    assert noise_from_repeats(table, table.measured, alternate) is None
    loaded = replace(table, payload_kg=np.tile([0.0, 2.0, 5.0], 40))
    assert noise_from_repeats(loaded, table.measured, ways) is None


def test_a_broken_beam_does_not_make_the_noise_floor() -> None:
    table = repeated(0.006)
    table.measured[17] += 1.0
    pooled = noise_from_repeats(table, table.measured, np.ones((table.rows, 3)))
    np.testing.assert_allclose(pooled.sigma, 0.006, rtol=0.3)


def test_whitener_makes_noise_white() -> None:
    pooled = noise_from_repeats(repeated(0.006), repeated(0.006).measured, np.ones((120, 3)))
    np.testing.assert_allclose(pooled.whitener @ pooled.covariance @ pooled.whitener.T, np.eye(3), atol=1e-9)


# --- held-out rows


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 60), st.integers(1, 12))
def test_no_pose_is_split_and_base_rows_are_never_hidden(seed: int, poses: int, count: int) -> None:
    random = np.random.default_rng(seed)
    place = random.uniform(-50.0, 50.0, (poses, 3))
    visit = np.concatenate([np.arange(poses), random.integers(0, poses, 2 * poses)])
    role = np.where(random.random(len(visit)) < 0.2, "base", "pose")
    table = make_table(place[visit], role=role)
    block, group = blocks(table, count), pose_groups(table)
    assert (block[role == "base"] == -1).all() and (block[role != "base"] >= 0).all()
    assert block.max() < count
    for number in np.unique(group[group >= 0]):
        assert len(np.unique(block[group == number])) == 1
    parts = folds(table, 5)
    hidden = np.sum(parts, axis=0)
    np.testing.assert_array_equal(hidden, (role != "base").astype(int))


def test_blocks_are_stretches_of_travel_of_about_equal_length() -> None:
    block = blocks(empty_run(200))
    assert (np.diff(block) >= 0).all() and block.max() == BLOCKS - 1
    assert np.ptp(np.bincount(block)) <= 1


def test_hidden_readings_do_not_touch_the_fit() -> None:
    problem, _ = hidden_backlash()
    part = folds(problem.table, 5)[2]
    spoiled = problem.measured.copy()
    spoiled[part] += 3.0
    first = fitted(["backlash"], problem.masked(part))
    second = fitted(["backlash"], replace(problem, measured=spoiled).masked(part))
    np.testing.assert_array_equal(first.unknowns, second.unknowns)
    assert np.isfinite(first.residual[part]).all()


# --- searched shapes


def opened(effect: Effect, problem: Problem) -> Term:
    """An effect with the values that the fit would start from."""
    guess = problem.noise or Noise(np.eye(3) * DEFAULT_SIGMA**2, "first guess")
    [found] = open_terms([Term(effect, torch.zeros(0, dtype=torch.float64))], problem, guess)
    return found


def test_the_row_of_a_knock_is_found() -> None:
    file, table = machine(), empty_run()
    view = build_view(file, table)
    knock = term("setup-jump", view, [0.03, -0.02, 0.02, 2e-5, 0.0, -3e-5], after=1234.0)
    problem = build_problem(file, measure(table, file, [knock]))
    found = opened(KNOWN["setup-jump"](), problem)
    assert float(found.theta[-1]) == 1230.0  # rows are 10 s apart: the last one before the knock
    result = fitted(["setup-jump"], problem)
    assert result.chi2 / result.freedom < 1.2


def test_a_straight_drift_is_preferred_and_a_settling_one_found() -> None:
    file, table = machine(), empty_run()
    view = build_view(file, table)
    for settling in (1.99e6, 400.0):
        truth = term("tracker-drift", view, [0.05, -0.03, 0.04], settling=settling, duration=1990.0)
        problem = build_problem(file, measure(table, file, [truth]))
        found = opened(KNOWN["tracker-drift"](), problem)
        assert float(found.theta[3]) == pytest.approx(settling, rel=0.25)


def test_windup_length_is_found() -> None:
    file, table = machine(), empty_run(300)
    truth = term("windup", build_view(file, table), [0.01, 0.008, 0.012], length=6.0)
    result = fitted(["windup"], build_problem(file, measure(table, file, [truth])))
    found = result.model.terms[0]
    assert float(((found.theta - truth.theta) / found.std).abs().max()) < 4.0


# --- report


def test_the_drawing_after_alignment_is_one_figure_whoever_prints_it() -> None:
    """Also with a frame of base reflectors, which a best motion of all readings would bend toward the errors."""
    from ptt.door.opened import open_run
    from ptt.door.options import ReadOptions
    from ptt.judge.compare.comparison import compare_run
    from ptt.judge.ladder.climb import climb

    data = Path(__file__).resolve().parents[1] / "data"
    for run, drawing in (("experiment1.csv", "machine.toml"), ("sealed_one/run.csv", "sealed_one/machine.toml")):
        opened = open_run(data / run, data / drawing, ReadOptions())
        ladder = climb(opened.model, opened.problem, [KNOWN["link-length"]()])
        compared = compare_run(opened.model, opened.problem).to_dict()["rms_um"]["total"]
        told = [ladder.report.rms_um[stage]["total"] for stage in ("aligned", "given")]
        assert [*told, ladder.steps[0].rms_um["total"]] == pytest.approx([compared] * 3, rel=1e-3)


def test_a_long_curve_is_one_line_of_a_report_and_a_short_list_is_none() -> None:
    problem, _ = hidden_backlash()
    report = report_fit(fitted(["backlash"], problem), problem)
    values = tuple(
        Value("screw-error-map", f"curve_mm {joint}.{n}", 0.01 * n, 0.002, kind)
        for joint, kind in ((1, "yes"), (2, "in part"))
        for n in range(1, 16)
    )
    few = tuple(Value("lead-scale", f"scale {joint}", 1e-4, 1e-5, "yes") for joint in (1, 2, 3))
    text = format_fit(replace(report, values=(*few, *values)))
    curves = [" ".join(line.split()).partition("; ")[0] for line in text.splitlines() if "curve_mm" in line]
    assert curves == [
        "curve_mm 1.1 to 15 0.01 to 0.15, 15 values of a curve: 15 measured",
        "curve_mm 2.1 to 15 0.01 to 0.15, 15 values of a curve: 15 measured in combinations",
    ]
    assert [line.split()[1] for line in text.splitlines() if line.startswith("    scale ")] == ["1", "2", "3"]


def test_report_in_words_and_figures() -> None:
    problem, _ = hidden_backlash()
    result = fitted(["backlash", "homing-offset"], problem)
    report = report_fit(result, problem)
    text = format_fit(report)
    for words in ("converged", "drawing, frame as read", "drawing, frame aligned", "machine file", "gap_mm 1", "+-",
                  "in part", "cannot be told from tracker z"):  # fmt: skip
        assert words in text
    figures = report.to_dict()
    assert figures["reduced_chi2"] == pytest.approx(result.chi2 / result.freedom)
    assert figures["rms_um"]["as read"]["total"] > 1e6 > figures["rms_um"]["aligned"]["total"]
    assert [item["measured"] for item in figures["parameters"]] == ["yes"] * 3 + ["in part"] * 3


def test_a_fixed_parameter_stays_and_a_fit_is_written_and_read_back() -> None:
    problem, _ = hidden_backlash()
    start = replace(term("homing-offset", problem.view, [0.2, 0.0, 0.0]), fixed=frozenset({"offset"}))
    result = fit(Model(problem.file) + start + KNOWN["backlash"](), problem)
    torch.testing.assert_close(result.model.terms[1].theta, start.theta)
    again = read_model(parse_machine(format_machine(write_model(result.model))))
    for mine, theirs in zip(result.model.terms, again.terms, strict=True):
        torch.testing.assert_close(mine.theta, theirs.theta, rtol=0.0, atol=0.0)
    torch.testing.assert_close(again.terms[0].std, result.model.terms[0].std, equal_nan=True)
    assert again.terms[1].fixed == {"offset"}


# --- bad input: one clear line each

TOML = """
[machine]
kind = "three-ptt"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
"""


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (TOML + "screw_led_mm = 5\n", r"m\.toml: unknown key 'screw_led_mm'; did you mean 'screw_lead_mm'"),
        (TOML.replace("link_length_mm = 300", "link_length_mm = -300"), r"m\.toml key machine\.link_length_mm: .*-300"),
        (TOML + "sigma_mm = 0.004\n", r"m\.toml: unknown key 'sigma_mm'; it belongs in \[tracker\] or"),
        (TOML + "gravity = [0, 0, -1]\n", r"unknown key 'gravity'; it belongs in \[machine\] of kind = \"serial\""),
        (
            TOML + '[[effect]]\nname = "backlash"\ngap_mm = 0.04\n',
            r"'gap_mm'; values .* in \[effect\.parameters\]",
        ),
        (TOML + '[[effect]]\nname = "backlsh"\n', r"m\.toml.*effect 'backlsh' is not known; did you mean 'backlash'"),
        (TOML + '[[effect]]\nname = "backlash"\n' * 2, r"m\.toml.*effect 'backlash' is in the model already"),
    ],
)
def test_a_bad_machine_file_gives_one_clear_line(text: str, line: str) -> None:
    with pytest.raises((MachineError, ModelError), match=line) as caught:
        read_model(parse_machine(text, "m.toml"))
    assert "\n" not in str(caught.value)


def test_too_few_readings_are_refused() -> None:
    table = empty_run(20)
    with pytest.raises(TableError, match="only 0 readings"):
        build_problem(machine(), table)
