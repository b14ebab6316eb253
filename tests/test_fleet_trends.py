"""What moves over runs: drifts and jumps are named on the value that moves, and on a sound machine nothing is."""

import re
from dataclasses import replace
from datetime import date, datetime, timedelta

import numpy as np
import pytest
from scipy import stats

from ptt.fleet.alarms import Names, alarm_of_movement, amount, unlike
from ptt.fleet.overview import Standing, _beside_sisters, _series
from ptt.fleet.past import Past, alarms_of_changes, alarms_of_runs
from ptt.fleet.trends import Moves, Series, movements
from ptt.fleet.words import machine_in_words

COUNT, ROWS, DAYS = 5, 120, 30.4
EPOCH = date(1970, 1, 1)  # from which days are counted


def series(random, runs=12, drift=None, jump=None, scatter=0.0, understated=1.0) -> Series:
    """Runs by rows: three values whose sum no row tells (sliders beside a tracker's z), and two that are told alone.

    Readings are drawn row by row and summed up here, so nothing of the estimate is used.
    """
    days = np.arange(runs) * DAYS + random.uniform(-3.0, 3.0, runs)
    blind = np.eye(COUNT)
    blind[:3, :3] -= 1.0 / 3.0
    start, information, score = random.normal(size=COUNT), [], []
    for day in days:
        now = start + scatter * random.normal(size=COUNT)
        if drift:
            now[drift[0]] += drift[1] * day
        if jump and day >= days[jump[1]]:
            now[jump[0]] += jump[2]
        rows = 10.0 * random.normal(size=(ROWS, COUNT)) @ blind
        readings = rows @ now + understated * random.normal(size=ROWS)
        information.append(rows.T @ rows)
        score.append(rows.T @ readings)
    return Series(tuple(f"v{i}" for i in range(COUNT)), days, np.array(information), np.array(score))


def test_on_sound_machines_nothing_moves():
    random = np.random.default_rng(1)
    worse = [
        bool(
            movements(
                series(random, int(random.integers(2, 14)), understated=float(random.choice([1.0, 2.0])))
            ).movements
        )
        for _ in range(300)
    ]
    # One percent is promised; 300 draws of it show 9 or fewer in 99.9 of 100.
    assert sum(worse) <= stats.binom.ppf(0.999, 300, 0.01)


def test_runs_that_scatter_by_more_than_their_rows_say_are_not_drifts():
    random = np.random.default_rng(2)
    worse = [bool(movements(series(random, 8, scatter=0.1)).movements) for _ in range(150)]
    assert sum(worse) <= stats.binom.ppf(0.999, 150, 0.02)


@pytest.mark.parametrize("runs", [3, 4, 6])
def test_one_value_that_is_set_anew_for_each_run_is_no_drift(runs):
    random, worse = np.random.default_rng(20 + runs), 0
    for _ in range(60):
        given = series(random, runs)
        anew = 0.03 * random.normal(size=runs)  # three stated standard errors
        score = given.score + given.information[:, :, 4] * anew[:, None]
        worse += bool(movements(replace(given, score=score)).movements)
    assert worse <= stats.binom.ppf(0.999, 60, 0.02)


def test_a_drift_of_many_standard_errors_is_found_in_five_runs():
    random = np.random.default_rng(31)
    found = [movements(series(random, 5, drift=(4, 25 * 0.009 / (4 * DAYS)))).movements for _ in range(40)]
    named = [bool(each) and (each[0].place, each[0].kind) == (4, "drift") for each in found]
    assert sum(named) >= 32  # of 60 others 93 in a hundred were


@pytest.mark.parametrize("place", [0, 1, 4])
def test_a_drift_is_named_on_its_own_value_alone_with_its_slope(place):
    random, pulls = np.random.default_rng(3 + place), []
    for _ in range(40):
        slope = float(random.choice([-1.0, 1.0])) * 6e-4
        found = movements(series(random, drift=(place, slope))).movements
        assert [(each.place, each.kind) for each in found[:1]] == [(place, "drift")]
        pulls.append((found[0].size - slope) / found[0].std)
    assert abs(np.mean(pulls)) < 4.0 / np.sqrt(40) and 0.6 < np.std(pulls) < 1.4


def test_a_jump_is_dated_between_two_runs_and_a_drift_beside_it_is_found_too():
    random = np.random.default_rng(7)
    found = movements(given := series(random, drift=(1, 6e-4), jump=(4, 7, 0.1))).movements
    jump = next(each for each in found if each.kind == "jump")
    assert (jump.place, jump.before, jump.day) == (4, given.days[6], given.days[7])
    assert abs(jump.size - 0.1) < 4.0 * jump.std
    assert [each.place for each in found if each.kind == "drift"] == [1]


def test_a_drift_of_one_slider_among_three_is_worth_what_a_line_through_differences_says():
    """Scipy's line through the differences of two sliders, which the tracker's z does not touch, has the same slope."""
    given = series(np.random.default_rng(11), drift=(1, 1e-3))
    found = movements(given).movements[0]
    each = [
        np.linalg.lstsq(info, score, rcond=1e-9)[0] for info, score in zip(given.information, given.score, strict=True)
    ]
    line = stats.linregress(given.days, [value[1] - 0.5 * (value[0] + value[2]) for value in each])
    assert abs(found.size - line.slope) < 3.0 * line.stderr


def test_a_jump_that_few_runs_cannot_prove_does_not_tilt_values_that_look_like_it():
    """Three runs, the last with one value far off: each run's own least squares, from its rows, is what is shown."""
    random = np.random.default_rng(17)
    alike = np.linalg.cholesky(np.full((COUNT, COUNT), 0.8) + 0.2 * np.eye(COUNT)).T
    truth = np.tile(random.normal(size=COUNT), (3, 1))
    truth[2, 4] += 0.4
    rows = 10.0 * random.normal(size=(3, ROWS, COUNT)) @ alike
    readings = np.einsum("rnp,rp->rn", rows, truth) + random.normal(size=(3, ROWS))
    information, score = np.einsum("rnp,rnq->rpq", rows, rows), np.einsum("rnp,rn->rp", rows, readings)
    found = movements(Series(tuple("abcde"), DAYS * np.arange(3), information, score))
    assert not found.movements
    np.testing.assert_allclose(
        found.values, [np.linalg.lstsq(*each, rcond=None)[0] for each in zip(rows, readings, strict=True)]
    )
    np.testing.assert_allclose(found.std, np.sqrt([np.diag(np.linalg.inv(each)) for each in information]))
    assert (np.abs(found.values - truth) < 4.0 * found.std).all()


def words(kind: str, slope: float, usual: float) -> str:
    given = (
        series(np.random.default_rng(5), drift=(4, slope))
        if kind == "drift"
        else series(np.random.default_rng(5), jump=(4, 6, slope))
    )
    moves = movements(given)
    names = Names(given.names, [f"play of slider {i}" for i in range(COUNT)], ["mm"] * COUNT, np.full(COUNT, usual))
    alarm = alarm_of_movement(moves.movements[0], moves, names, given.days)
    return "" if alarm is None else alarm.words


def test_an_alarm_of_a_drift_says_its_pace_and_the_day_on_which_the_usual_size_is_passed():
    """A thousandth of the usual 100 um a day; the day follows from where the value was drawn to begin."""
    text = words("drift", 1e-3, 0.1)
    told = re.fullmatch(
        r"play of slider 4 grows by ([\d.]+) \+- ([\d.]+) um a month, .* its usual size of 100 um about (\S+)", text
    )
    assert told is not None, text
    pace, error = float(told[1]), float(told[2])
    assert abs(pace - 0.1 * 365.25 / 12.0) < 4.0 * error < 0.5
    random = np.random.default_rng(5)
    random.uniform(size=12)  # the days of the runs
    passed = EPOCH + timedelta(days=(1.0 - float(random.normal(size=COUNT)[4])) / 1e-3)
    assert abs(date.fromisoformat(told[3]) - passed) < timedelta(days=4.0 * error / pace * 760.0)  # so far ahead


def test_an_alarm_of_a_jump_says_its_size_and_the_runs_between_which_it_came():
    text = words("jump", 0.4, 0.1)
    told = re.search(r"jumped by \+([\d.]+) \+- ([\d.]+) um between (\S+) and (\S+), from", text)
    assert told is not None, text
    assert abs(float(told[1]) - 40.0) < 4.0 * float(told[2]) < 4.0
    days = series(np.random.default_rng(5), jump=(4, 6, 0.4)).days
    assert [date.fromisoformat(each) for each in told.groups()[2:]] == [EPOCH + timedelta(days[at]) for at in (5, 6)]


def test_a_machine_unlike_its_sisters_is_named_and_no_other():
    random = np.random.default_rng(4)
    values = {f"m{i}": (float(random.normal(20.0, 2.0)), 0.5) for i in range(30)}
    assert not unlike(values)
    assert list(unlike(values | {"m7": (55.0, 0.5)})) == ["m7"]
    assert not unlike({name: values[name] for name in list(values)[:4]} | {"m7": (55.0, 0.5)})  # too few to tell


@pytest.mark.parametrize(
    "machines", [6, pytest.param(7, marks=pytest.mark.long), pytest.param(12, marks=pytest.mark.long), 30]
)
def test_sisters_that_differ_by_chance_alarm_as_seldom_as_promised_however_many_values_are_compared(machines: int):
    random, compared, false = np.random.default_rng(1), 20, 0
    for _ in range(400):
        values = random.normal(20.0, 2.0, (compared, machines))
        found = [unlike({str(i): (v, 0.0) for i, v in enumerate(row)}, compared) for row in values.tolist()]
        false += any(found)
    assert false <= 10  # 4 of 400 by ALPHA, and three standard deviations


def test_one_of_six_sisters_far_off_is_named_though_many_values_are_compared():
    values = {f"m{i}": (20.0 + i, 0.5) for i in range(5)}
    assert list(unlike(values | {"m7": (120.0, 0.5)}, 20)) == ["m7"]


def test_a_value_is_given_to_the_last_figure_of_its_error():
    assert amount(0.0040312, "mm", 0.000041) == "4.031 +- 0.041 um"
    assert amount(-0.27246, "mm", 0.0127, sign=True) == "-272 +- 13 um"
    assert amount(0.0781, "mm") == "78 um"


def past(month: int, verdict: str | None, added: tuple[str, ...] = (), error: float = 5.0) -> Past:
    words = f"{verdict} of {month}"
    return Past(f"r{month}", f"{month}.csv", datetime(2026, month, 5), 80, verdict, error, 5.5, 6.0, words, added)


def test_physics_that_came_stays_an_alarm_after_the_model_has_it():
    runs = [past(1, "missing"), past(2, "new", ("once-per-rev",), 32.2), past(3, "same"), past(4, None)]
    (alarm,) = alarms_of_runs(runs)
    assert (alarm.effect, alarm.trend, alarm.when) == ("once-per-rev", "new", "2026-02-05")
    assert "32.2 um, where 5.5 um" in alarm.words
    assert alarms_of_runs([runs[0], runs[2]]) == []


def test_a_last_run_that_could_not_be_used_or_named_is_an_alarm_until_a_better_one_comes():
    assert [alarm.trend for alarm in alarms_of_runs([past(1, "missing"), past(2, "new"), past(3, None)])] == ["new"]
    assert [alarm.trend for alarm in alarms_of_runs([past(1, "missing"), past(2, "setup")])] == ["setup"]
    assert alarms_of_runs([past(1, "missing"), past(2, "setup"), past(3, "same")]) == []


def test_what_the_last_run_shows_otherwise_is_an_alarm_before_it_is_a_trend():
    worn = replace(past(3, "changed"), changed=(("backlash", "gap_mm 2", "Slider 2 loses 45 um"),))
    (alarm,) = alarms_of_changes([past(1, "missing"), worn, past(4, None)], [])
    assert (alarm.effect, alarm.parameter, alarm.trend, alarm.when) == ("backlash", "gap_mm 2", "changed", "2026-03-05")
    assert alarm.words == "Slider 2 loses 45 um"
    assert alarms_of_changes([worn], [alarm]) == []  # a trend of the same value says more
    all_of_it = replace(worn, changed=tuple(("backlash", f"gap_mm {joint}", "All at once") for joint in (1, 2, 3)))
    (whole,) = alarms_of_changes([all_of_it], [])  # one sentence for three values
    assert (whole.effect, whole.parameter, whole.words) == ("backlash", "", "All at once")
    assert alarms_of_changes([replace(worn, accepted=True)], []) == alarms_of_changes([worn, past(4, "same")], []) == []


def test_a_value_that_no_run_tells_is_shown_as_none():
    names = Names(("a x 1", "a x 2"), ("x of joint 1", "x of joint 2"), ("rad", "rad"), np.full(2, 1e-4))
    values, std = np.array([[1.0, np.nan], [1.1, np.nan]]), np.array([[0.1, np.inf], [0.1, np.inf]])
    unseen = np.array([[0.0, np.nan], [0.0, 0.99]])
    moves = Moves((), values, std, unseen, np.zeros((2, 2)), 1.0)
    text = machine_in_words(Standing("arm", "", (past(1, "same"), past(2, "same")), (), names, np.arange(2.0), moves))
    told, untold = (line.split() for line in text.splitlines() if line.startswith("x of joint"))
    assert told[4:6] == ["100", "+-"] and untold[4:] == ["-", "not", "measured"]


def test_a_value_of_which_a_run_sees_next_to_nothing_is_not_told_as_measured():
    """Two values that are seen only together, one of them in a hundredth of their common direction, and one alone."""
    way = np.array([np.sqrt(0.99), 0.1, 0.0])
    information = 1e8 * np.outer(way, way) + np.diag([0.0, 0.0, 1e8])
    found = movements(Series(tuple("abc"), np.zeros(1), information[None], 0.5 * information.sum(axis=1)[None]))
    np.testing.assert_allclose(found.unseen[0], [0.01, 0.99, 0.0], atol=1e-9)
    assert np.isfinite(found.values[0]).tolist() == [True, False, True]
    np.testing.assert_allclose(found.marginal_std[0, [0, 2]], [0.1, 1e-4], rtol=1e-3)


def test_what_is_seen_of_a_value_in_combinations_is_told_with_the_error_of_the_value_itself():
    """Three sliders whose common height the frame takes up: a third of each is not seen, and may be as is usual."""
    known = series(np.random.default_rng(3), runs=1)
    found = movements(known)
    np.testing.assert_allclose(found.unseen[0, :3], 1.0 / 3.0, atol=0.01)
    assert (found.std[0, :3] < 0.01).all() and (np.abs(found.marginal_std[0, :3] - np.sqrt(1.0 / 3.0)) < 0.01).all()


@pytest.mark.parametrize(("unseen", "compared"), [(1.0 / 3.0, True), (0.9, False)])
def test_what_is_mostly_unseen_of_a_value_is_not_compared_with_sisters(unseen: float, compared: bool):
    names, one = Names(("a x 1",), ("x of joint 1",), ("rad",), np.full(1, 1e-4)), np.ones((1, 1))
    values = (0.1, 0.11, 0.09, 0.1, 0.12, 0.08, 0.1, 5.0)
    moves = [Moves((), value * one, 1e-3 * one, unseen * one, 0.0 * one, 1.0) for value in values]
    some = [Standing(f"arm {n}", "", (), (), names, np.zeros(1), each) for n, each in enumerate(moves)]
    assert [bool(each.alarms) for each in _beside_sisters(some)] == [*[False] * 7, compared]


def test_runs_stored_in_other_usual_sizes_are_one_series():
    """A release that calls another size usual makes no jump: sums of a run are in the usual sizes of its time."""
    size, information = 0.03, 4e6  # mm and 1/mm^2
    told = [
        {"names": ["a"], "labels": ["a"], "units": ["mm"], "usual": [usual], "date": datetime(2026, 1, day),
         "information": [information * usual**2], "score": [information * size * usual]}
        for day, usual in ((1, 0.1), (2, 0.02))
    ]  # fmt: skip
    names, series = _series(told)
    assert names.usual.tolist() == [0.02]
    np.testing.assert_allclose(names.usual * series.score[:, 0] / series.information[:, 0, 0], size)
