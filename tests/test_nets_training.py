"""Training: what is learned, what is chosen, what is left alone."""

import dataclasses

import numpy as np
import pytest

from nets import RbfSettings, TrainingDataError, fit_rbf, muted, train_rbf
from nets.selection import HeldOut, choose, deal_folds, judge

SMALL = RbfSettings(centre_counts=(8, 32), spreads=(1.0, 2.0, 4.0), ridges=(1e-10, 1e-8, 1e-6, 1e-4, 1e-2))
NOISE = 0.002  # mm


def surface(p):
    x, y, z = p.T / 50
    return np.stack(
        [0.8 * np.sin(x + z / 2) + 0.3 * x * y, np.cos(y - z) / 2 + x * x / 5, 0.4 * z * z + 0.3 * x * z], 1
    )


def volume(rows=300, seed=0):
    return np.random.default_rng(seed).uniform(-60, 60, size=(rows, 3))


def helix(rows=180, visits=1):
    angle = np.linspace(0, 4 * np.pi, rows)
    p = np.stack([40 * np.cos(angle), 40 * np.sin(angle), 20 * angle / np.pi], axis=1)
    return np.repeat(p, visits, axis=0), np.repeat(np.arange(rows), visits)


def rms(error):
    return np.sqrt(np.mean(np.square(error), axis=0))


def test_a_known_function_is_recovered_where_it_was_not_seen():
    seen, unseen = volume(600), 0.8 * volume(500, seed=1)
    training = train_rbf(seen, surface(seen), np.arange(600))
    error = rms(training.network.predict(unseen) - surface(unseen))
    assert np.all(error < 0.005 * rms(surface(unseen)))
    assert training.learned.all()
    assert training.chosen.centres == 128


def test_the_heldout_error_is_what_an_unseen_path_shows():
    p, pose = helix(visits=7)
    rng = np.random.default_rng(0)
    training = train_rbf(p, surface(p) + NOISE * rng.normal(size=p.shape), pose, settings=SMALL)
    between = 0.5 * (helix()[0][1:] + helix()[0][:-1])
    error = rms(training.network.predict(between) - surface(between))
    assert np.all(error < NOISE)
    np.testing.assert_allclose(training.heldout_rms, NOISE, rtol=0.15)
    np.testing.assert_allclose(training.fitted_rms, NOISE, rtol=0.15)
    assert np.all(training.p_value < 1e-6)


@pytest.mark.parametrize("changes", [{"method": "gradient", "epochs": 500}, {"widths": "nearest"}])
def test_the_other_methods_learn_too(changes):
    p, pose = helix()
    settings = dataclasses.replace(SMALL, **changes)
    training = train_rbf(p, surface(p), pose, settings=settings)
    assert np.all(training.heldout_rms < 0.05 * training.null_rms)
    assert np.all(rms(training.network.predict(p) - surface(p)) < 0.05 * training.null_rms)
    if settings.method == "gradient":
        assert training.mse_curve.shape == (501, 3)
        assert np.all(np.diff(training.mse_curve, axis=0) <= 1e-13 * training.mse_curve[0])
        np.testing.assert_allclose(training.mse_curve[-1], training.fitted_rms**2, rtol=1e-6)
    else:
        assert training.mse_curve.shape == (0, 3)


@pytest.mark.parametrize("blocks", [5, pytest.param(12, marks=pytest.mark.long), 180])
def test_noise_alone_chooses_the_null_network(blocks):
    p, pose = helix()
    learned = 0
    for seed in range(15):
        noise = np.random.default_rng(seed).normal(size=p.shape)
        training = train_rbf(p, noise, pose * blocks // 180, settings=SMALL)
        learned += int(training.learned.any())
        if not training.learned.any():
            assert training.chosen.centres == 0
            np.testing.assert_array_equal(training.network.predict(2 * p), np.zeros_like(p))
            np.testing.assert_array_equal(training.heldout_rms, training.null_rms)
    assert learned <= 1


def test_only_the_outputs_with_something_to_learn_are_predicted():
    p, pose = helix()
    y = surface(p)
    y[:, 1] = np.random.default_rng(3).normal(size=len(p))
    training = train_rbf(p, y, pose, settings=SMALL)
    np.testing.assert_array_equal(training.learned, [True, False, True])
    assert np.all(training.network.predict(p)[:, 1] == 0.0)
    assert np.all(training.heldout_rms[[0, 2]] < 0.01 * training.null_rms[[0, 2]])


def test_an_output_that_is_taken_back_errs_as_zero_does():
    p, pose = helix()
    training = train_rbf(p, surface(p), pose, settings=SMALL)
    less = muted(training, np.array([True, False, True]))
    assert less.learned.tolist() == [True, False, True] and not less.network.predict(p)[:, 1].any()
    for told, before in ((less.heldout_rms, training.heldout_rms), (less.fitted_rms, training.fitted_rms)):
        np.testing.assert_array_equal(told, np.where(less.learned, before, training.null_rms))
    assert muted(training, np.ones(3, dtype=bool)) is training


def test_without_a_null_candidate_something_is_always_fitted():
    p, pose = helix()
    noise = np.random.default_rng(0).normal(size=p.shape)
    training = train_rbf(p, noise, pose, settings=dataclasses.replace(SMALL, null_candidate=False))
    assert training.learned.all()
    assert np.any(training.network.predict(p) != 0.0)


def test_too_few_places_teach_nothing():
    p = volume(12)
    repeated = np.repeat(p, 5, axis=0)
    training = train_rbf(repeated, surface(repeated), np.repeat(np.arange(12), 5), settings=SMALL)
    assert not training.learned.any()


def test_a_straight_line_needs_no_nodes():
    p = volume(200)
    y = 0.3 + p @ np.array([[0.01], [-0.02], [0.005]]) + 1e-3 * np.random.default_rng(0).normal(size=(200, 1))
    training = train_rbf(p, y, np.arange(200), settings=SMALL)
    assert training.chosen.affine
    far = np.array([[500.0, -300.0, 200.0]])
    straight = train_rbf(p, y, np.arange(200), settings=dataclasses.replace(SMALL, ridges=(1e6,))).network
    np.testing.assert_allclose(straight.predict(far), 0.3 + far @ [[0.01], [-0.02], [0.005]], atol=0.01)


def test_training_is_reproducible_and_independent_of_output_units():
    p, pose = helix()
    y = surface(p) + NOISE * np.random.default_rng(0).normal(size=p.shape)
    first, second = (train_rbf(p, y, pose, settings=SMALL) for _ in range(2))
    np.testing.assert_array_equal(first.network.predict(p), second.network.predict(p))
    microns = train_rbf(p * 1e3, y * 1e3, pose, settings=SMALL)
    assert microns.chosen == first.chosen
    np.testing.assert_allclose(microns.network.predict(p * 1e3), 1e3 * first.network.predict(p), rtol=1e-4, atol=1e-4)


def test_the_table_holds_every_setting_and_the_chosen_one_leads_it():
    p, pose = helix()
    settings = dataclasses.replace(SMALL, affine=(False,))
    training = train_rbf(p, surface(p)[:, :1], pose, settings=settings)
    assert len(training.tried) == 1 + 2 * 3 * 5
    best = min(training.tried, key=lambda row: row.heldout_rms[0])
    assert best.candidate == training.chosen
    assert best.ridge == training.ridges[0]
    assert training.heldout_rms[0] >= best.heldout_rms[0]  # judged without the fold the choice looked at


def test_fewer_distinct_inputs_than_centres_are_enough():
    p = np.repeat(volume(25), 4, axis=0)
    training = train_rbf(p, surface(p), np.repeat(np.arange(25), 4))
    assert training.network.widths.shape[0] <= 25
    assert {row.candidate.centres for row in training.tried} == {0, 8, 16, 25}


def test_a_constant_input_is_harmless():
    p, pose = helix()
    p[:, 2] = 411.7
    training = train_rbf(p, surface(p), pose, settings=SMALL)
    assert np.all(training.heldout_rms < 0.01 * training.null_rms)
    assert training.network.inside(p).all()


def test_fitting_with_given_settings_interpolates():
    p = volume(160)
    network = fit_rbf(p, surface(p), centres=160, spread=2.0, ridge=1e-13)
    np.testing.assert_array_less(rms(network.predict(p) - surface(p)), 1e-3)
    affine = fit_rbf(p, surface(p), centres=10, spread=2.0, affine=True)
    assert np.any(affine.slope.detach().numpy() != 0)


@pytest.mark.parametrize("groups", [1, 3, 10, 47])
def test_groups_are_never_split(groups):
    codes = np.random.default_rng(0).integers(0, groups, size=300) * 13 - 5
    folds = deal_folds(codes, 10, seed=3)
    assert len(folds) == min(10, len(np.unique(codes)))
    np.testing.assert_array_equal(np.sort(np.concatenate(folds)), np.arange(300))
    for index, rows in enumerate(folds):
        others = np.concatenate([np.empty(0, dtype=int), *(folds[:index] + folds[index + 1 :])])
        assert not set(codes[rows]) & set(codes[others])


def test_the_choice_ignores_the_fold_left_out_and_takes_the_first_at_a_tie():
    squares = np.array([[[[1.0], [9.0]]], [[[2.0], [0.0]]], [[[2.0], [0.0]]]])  # (3, 1, 2, 1)
    held_out = HeldOut(squares, np.full((2, 1), 10.0), np.array([5, 5]), places=50)
    assert choose(held_out).candidate == 1
    assert choose(held_out, without=1).candidate == 0


@pytest.mark.parametrize(("left", "learned"), [(1.0, True), (4.0, False)])
def test_a_fold_with_nothing_to_gain_does_not_veto_a_gain_by_half(left, learned):
    """Of three folds one has no error to begin with: Student's t of so few is no proof, an error by half is."""
    null, squares = np.array([[10.0], [10.0], [1.0]]), np.array([left, left, 1.0]).reshape(1, 1, 3, 1)
    verdict = judge(HeldOut(squares, null, np.array([5, 5, 5]), places=50), SMALL)
    assert verdict.p_value[0] > SMALL.significance
    assert (verdict.learned[0], verdict.heldout_rms[0] < verdict.null_rms[0]) == (learned, learned)


@pytest.mark.parametrize(
    ("inputs", "outputs", "groups", "message"),
    [
        (np.ones((4, 3)), np.ones((5, 3)), np.arange(4), r"\(4, 3\) and outputs \(5, 3\)"),
        (np.ones(4), np.ones((4, 3)), np.arange(4), "give"),
        (np.empty((0, 3)), np.empty((0, 1)), np.empty(0, dtype=int), "n >= 1"),
        (np.array([[1.0], [np.nan], [2.0]]), np.ones((3, 1)), np.arange(3), "training row 1"),
        (np.ones((3, 1)), np.ones((3, 1)), np.arange(2), "one integer for each of the 3 rows"),
        (np.ones((3, 1)), np.ones((3, 1)), np.ones(3), "one integer"),
        (np.ones((3, 1)), np.ones((3, 1)), np.ones(3, dtype=int), "two groups or more"),
    ],
)
def test_data_that_cannot_be_trained_on_is_refused(inputs, outputs, groups, message):
    with pytest.raises(TrainingDataError, match=message):
        train_rbf(inputs, outputs, groups)


@pytest.mark.parametrize(
    "changes",
    [
        {"centre_counts": ()},
        {"centre_counts": (0,)},
        {"spreads": (0.0,)},
        {"ridges": (0.0,)},
        {"affine": ()},
        {"widths": "wide"},
        {"method": "newton"},
        {"rate": 0.0},
        {"rate": 1.5},
        {"epochs": 0},
        {"folds": 1},
        {"significance": 1.0},
        {"restarts": 0},
        {"neighbours": 0},
    ],
)
def test_settings_that_cannot_work_are_refused(changes):
    with pytest.raises(TrainingDataError, match=next(iter(changes))):
        dataclasses.replace(SMALL, **changes)
