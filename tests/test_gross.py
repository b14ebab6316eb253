"""Readings that miss by far: gross errors, poses that are missed alike, and chance."""

import numpy as np
import pytest

from ptt.diagnosis.noise.gross import alone, stand_out
from ptt.fitting.outliers import linear_residual


def test_gross_errors_do_not_hide_in_a_noise_that_they_have_widened():
    random = np.random.default_rng(5)
    left = random.normal(size=(200, 3))
    left[[20, 90, 160]] += 15.0
    widened = left / 5.0
    rows = np.ones(200, dtype=bool)
    assert not stand_out(widened, rows).any()
    assert np.flatnonzero(stand_out(widened, rows, least=0.0)).tolist() == [20, 90, 160]


def test_gross_errors_to_one_side_do_not_draw_a_fit_after_them():
    """A line through 60 rows of noise one, six of which are off by 100 near its end: least squares follow them."""
    random = np.random.default_rng(7)
    along = np.linspace(0.0, 1.0, 60)
    columns = np.zeros((60, 3, 2))
    columns[:, 0, 0], columns[:, 0, 1] = 1.0, along
    rows = random.normal(size=(60, 3))
    rows[:, 0] += 20.0 - 40.0 * along
    rows[50:56, 0] += 100.0
    left, weight = linear_residual(rows, columns, np.zeros(0), np.zeros((0, 2)))
    sound = np.delete(np.arange(60), np.arange(50, 56))
    truth = rows[:, 0] - 20.0 + 40.0 * along
    assert np.abs(left[:, 0] - truth).max() < 1.5  # three standard errors of a line through so few
    assert weight[50:56].max() < 0.01 and np.median(weight[sound]) > 0.5
    drawn = columns[:, 0] @ np.linalg.lstsq(columns[:, 0], rows[:, 0], rcond=None)[0]
    assert np.abs(drawn - rows[:, 0] + truth).max() > 15.0


def unloaded(places: np.ndarray) -> np.ndarray:
    """Places at one load and one feed, as `places_of` has them."""
    return np.column_stack([places, np.zeros((len(places), 2))])


@pytest.mark.parametrize("often", [2, 5])
def test_a_pose_that_most_visits_miss_alike_has_no_gross_errors(often):
    """Rows 10 and 30 miss one pose alike: at all of two visits it is the pose, at two of five it is chance."""
    random = np.random.default_rng(3)
    left, places = random.normal(size=(60, 3)), unloaded(100.0 * random.normal(size=(60, 9)))
    left[[10, 30]] += (0.0, 25.0, 0.0)
    left[[11, 21, 31]] += 25.0 * np.eye(3)
    places[[10, 30, 40, 45, 50][:often]] = places[10]
    rows = np.ones(60, dtype=bool)
    lone = alone(stand_out(left, rows), left, rows, places)
    assert lone[[11, 21]].all() and bool(lone[[10, 30]].all()) is (often > 2)


@pytest.mark.parametrize(("others", "gone", "gross"), [(0, 0, False), (60, 0, True), (0, 60, True)])
def test_two_visits_that_miss_alike_are_chance_where_so_many_beams_were_broken(others, gone, gross):
    """Of 400 poses that were visited twice one pair of broken beams agrees; alone it is the pose."""
    random = np.random.default_rng(4)
    pose = unloaded(100.0 * random.normal(size=(400, 9)))
    left, places = random.normal(size=(800, 3)), np.tile(pose, (2, 1))
    wide = 2 + np.arange(others) * 6
    left[wide] += 30.0 * random.normal(size=(others, 3))
    left[[1, 401]] = (0.0, 25.0, 0.0)
    rows = np.ones(800, dtype=bool)
    lone = alone(stand_out(left, rows), left, rows, places, gone)
    assert bool(lone[[1, 401]].all()) is gross and lone[[1, 401]].any() == gross


@pytest.mark.parametrize("off", ["along one line", "to any side"])
def test_far_rows_that_crowd_in_one_place_are_its_own_where_they_are_off_along_one_line(off):
    """Six readings by the ends of one joint's travel: a worn nut errs along its way there, broken beams anyhow."""
    random = np.random.default_rng(11)
    left, places = random.normal(size=(300, 3)), unloaded(100.0 * random.normal(size=(300, 9)))
    far = np.arange(10, 300, 48)
    places[far, 4] = 900.0 + np.arange(len(far))  # one joint's travel alone: in space they are far from each other
    sides = (
        np.tile((0.0, 0.6, 0.8), (len(far), 1)) if off == "along one line" else np.tile(np.eye(3), (3, 1))[: len(far)]
    )
    left[far] += 40.0 * sides * (-1.0) ** np.arange(len(far))[:, None]
    rows = np.ones(300, dtype=bool)
    lone = alone(stand_out(left, rows), left, rows, places)
    assert lone[far].any() == lone[far].all() == (off == "to any side")
