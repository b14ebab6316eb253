"""The fit: truth recovered, frames, noise, held-out rows, gross errors, what cannot be seen, bad input."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from made_runs import KNOWN, PLACE, SIGMA, TRACKER, empty_run, hidden_backlash, machine, measure, term
from scipy import optimize

from ptt.effects import Effect
from ptt.errors import PosesError
from ptt.fitting.chunks import sample_stretches
from ptt.fitting.gauss_newton import HOPELESS, bounded_step, descend
from ptt.fitting.observability import _large, correlations, unobservable
from ptt.fitting.result import FitResult
from ptt.fitting.search import open_terms
from ptt.fitting.solve import fit, hold
from ptt.fitting.stated import unseen_directions
from ptt.fitting.whitened import build_whitened
from ptt.model.model import Model, Term
from ptt.run.axes import rms
from ptt.run.noise import guessed_noise
from ptt.run.problem import Problem, build_problem
from ptt.run.viewing import build_view


def test_values_with_which_the_machine_cannot_stand_where_it_was_sent_are_refused_by_row() -> None:
    """Readings kilometres away ask for offsets beyond every link: that is no fit, and no error of ours."""
    file = machine()
    table = empty_run(40)
    table = table.replace(measured=table.target.copy())
    far = Term(KNOWN["homing-offset"](), torch.tensor([1e6, 0.0, -1e6], dtype=torch.float64))
    with pytest.raises(PosesError, match=r"table row 2 and 39 more: .* homing-offset, the machine cannot stand"):
        fit(Model(file) + far, build_problem(file, table))


def test_rows_of_a_long_run_at_which_the_machine_cannot_stand_are_refused_and_no_gross_errors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It may stand at all rows of the stretches at which a long fit begins."""
    file, rows, some = machine(), 3000, 300
    monkeypatch.setattr("ptt.fitting.solve.LONG", rows - 1)
    monkeypatch.setattr("ptt.fitting.solve.SAMPLE_ROWS", some)
    table = empty_run(rows)
    problem = build_problem(file, table.replace(measured=table.target.copy()))
    begun = np.concatenate([np.arange(*stretch) for stretch in sample_stretches(problem, some)])
    for size in np.arange(210.0, 225.0, 0.25):
        offset = torch.tensor([size, 0.0, -size], dtype=torch.float64)
        stood = np.isfinite(problem.view.mechanism.forward(problem.view.q + offset).numpy()).all(axis=1)
        if not stood.all():
            break
    assert (~stood).sum() > 0 and stood[begun].all()
    far = hold(Term(KNOWN["homing-offset"](), offset))
    for robust in (True, False):
        with pytest.raises(PosesError, match=r"homing-offset, the machine cannot stand"):
            fit(Model(file) + far, problem, robust=robust)


def fitted(names: list[str], problem: Problem, **options: object) -> FitResult:
    model = Model(problem.file)
    for name in names:
        model = model + KNOWN[name]()
    return fit(model, problem, **options)


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


@pytest.mark.parametrize("seed", [2, pytest.param(3, marks=pytest.mark.long)])
def test_a_curved_valley_is_followed_to_its_end(seed: int) -> None:
    """Links that the model lacks press a common twist, which a turned tracker hides, far beyond its linear range."""
    file, table = machine(), empty_run(seed=seed)
    file = replace(file, machine=file.machine.model_copy(update={"reflector_mm": (-40.0, 27.0, -30.0)}))
    view = build_view(file, table)
    terms = [
        term("link-length", view, [-0.14, 0.18, 0.08]),
        term("platform-twist", view, [-8e-4, 6e-4, -8e-4, 8e-4, 7e-4, 9e-4]),
        term("windup", view, [0.001, 0.012, 0.010], length=3.5),
    ]
    result = fitted(["platform-twist", "windup"], build_problem(file, measure(table, file, terms)))
    # Steps along the tangent alone took 750 evaluations and ended at 2557 and 2276.
    assert result.iterations < 150 and result.chi2 < 2250.0


@pytest.mark.parametrize(("stiff", "soft"), [(1e2, 1.0), (1e4, 1.0), (1e5, 10.0)])
def test_converged_means_that_nothing_is_left_to_gain(stiff: float, soft: float) -> None:
    """Rosenbrock's valley, in which a damped step says next to nothing of what is still to be had."""

    def equations(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        left = np.array([stiff * (at[1] - at[0] ** 2), soft * (1.0 - at[0])])
        slope = np.array([[-2.0 * stiff * at[0], stiff], [-soft, 0.0]])
        return slope.T @ slope, -slope.T @ left, float(left @ left)

    ended = descend(equations, np.array([-1.2, 1.0]), np.full(2, -np.inf), np.full(2, np.inf))
    assert ended.status == "converged"
    np.testing.assert_allclose(ended.unknowns, 1.0, atol=1e-6)


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
    told = {item.text for item in unobservable(result)}
    assert told >= {
        f"joint-offset: rail_mm {leg} cannot be told from homing-offset (offset_mm {leg})" for leg in (1, 2, 3)
    }
    pairs = {(pair.first, pair.second): pair.value for pair in correlations(result)}
    alike = [(f"joint-offset tangential_mm {leg}", f"link-length length_mm {leg}") for leg in (1, 2, 3)]
    assert set(pairs) == set(alike) and max(pairs.values()) < -0.95  # one lengthens the link as the other does


def test_an_unseen_direction_is_one_that_the_data_know_less_than_its_usual_size() -> None:
    directions = unseen_directions(np.diag([4.0, 0.25, 1e9]))
    np.testing.assert_allclose(np.abs(directions), [[0.0], [1.0], [0.0]])


# --- searched shapes


def opened(effect: Effect, problem: Problem) -> Term:
    """An effect with the values that the fit would start from."""
    guess = problem.noise or guessed_noise()
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


def test_windup_lengths_of_each_joint_are_found_however_much_they_differ() -> None:
    """A search tries lengths that are alike for all; what each joint has of its own may be a multiple of these."""
    file, table = machine(), empty_run(300)
    lengths = torch.tensor([40.0, 8.0, 20.0]).double()
    even = term("windup", build_view(file, table), [0.03, 0.03, 0.04], length=6.0)
    truth = replace(even, theta=torch.cat([even.theta[:3], lengths]))
    problem = build_problem(file, measure(table, file, [truth]))
    result = fitted(["windup"], problem)
    found = result.model.terms[0]
    assert float(((found.theta - truth.theta) / found.std).abs().max()) < 4.0
    assert result.chi2 < 1.1 * result.freedom


def test_motions_of_a_frame_that_is_trusted_imitate_nothing():
    none, moved = np.zeros(0, dtype=int), np.array([0, 2])
    groups = {"shift along x": none, "shift along y": moved, "rotation about z": none}
    assert _large(list(groups), groups, np.array([0.5, 0.0, -0.5])) == ["shift along y"]
