"""A position loop followed through time: nothing here knows what the program takes for a speed at a corner."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from conftest import BENCH as MACHINE
from told_models import with_effects

from ptt.challenge.challenge import bench as bench_machine
from ptt.correct.compensate import compensate
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.errors import ModelError
from ptt.judge.ladder.climb import climb
from ptt.machine import load_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.run.pace import EVEN, MEAN, SMOOTH, pace_of
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

BENCH = bench_machine()
MECHANISM = build_mechanism(BENCH.machine)
LAG = np.array([0.02, 0.03, 0.012])  # s, the reciprocal of each loop's gain
PIECES = 200  # of a move, along each of which the command runs evenly


def arrive(sent: np.ndarray, feed: np.ndarray, moves: str) -> np.ndarray:
    """Where the sliders are at the instant in which the last command of each move is given, (n, 3) mm.

    A move takes as long as the tool's way at its feed. Either all sliders run from pose to pose at an even speed, or
    the tool does. Each slider closes its distance to its command as a proportional loop does, q' = (b - q) / tau, which
    has this solution while the command runs evenly.
    """
    place = MECHANISM.forward(torch.as_tensor(sent)).numpy()
    part = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    at, reached = sent[0], [sent[0]]
    for index in range(1, len(sent)):
        lasts = np.linalg.norm(place[index] - place[index - 1]) / feed[index] / PIECES
        way = sent[index - 1] + part * (sent[index] - sent[index - 1])
        if moves == "straight":
            tool = place[index - 1] + part * (place[index] - place[index - 1])
            way = MECHANISM.inverse(torch.as_tensor(tool)).numpy()
        for begin, end in pairwise(way):
            behind = (end - begin) / lasts * LAG
            at = end - behind + (at - begin + behind) * np.exp(-lasts / LAG)
        reached.append(at)
    return np.array(reached)


def lags_of(found: Diagnosis) -> list[float]:
    return [one.value for one in found.candidates[0].parameters if one.name.startswith("lag")]


@pytest.mark.parametrize("moves", ["sliders", "straight"])
def test_a_loop_that_lags_is_told_and_led_though_every_row_is_a_corner(moves: str) -> None:
    file = replace(BENCH, machine=BENCH.machine.model_copy(update={"moves": moves}))
    random, rows = np.random.default_rng(3), 90
    target = random.uniform(-60.0, 60.0, (rows, 3))
    feed = random.choice([8.0, 16.0, 30.0], rows)
    sent = MECHANISM.inverse(torch.as_tensor(target)).numpy()
    table = make_table(target, sent, feed_mm_s=feed)
    actual = MECHANISM.forward(torch.as_tensor(arrive(sent, feed, moves))).numpy()
    read = actual + random.normal(0.0, 0.004, target.shape)
    found = diagnose(Model(file), build_problem(file, replace(table, measured=read)))
    assert (found.verdict, found.suggested) == ("missing", (("following-error",),))
    np.testing.assert_allclose(lags_of(found), LAG, rtol=0.02)
    commands = compensate(found.model, make_table(target, feed_mm_s=feed)).q
    assert np.isfinite(commands).all()
    there = MECHANISM.forward(torch.as_tensor(arrive(commands, feed, moves))).numpy()
    before, after = (np.linalg.norm(place - target, axis=1)[1:].mean() for place in (actual, there))
    assert before > 0.2
    assert after < 0.03 * before


def test_where_the_lag_is_as_long_as_a_move_to_a_stop_no_command_reaches_the_target_and_that_is_said() -> None:
    """The axis lags by all of the move then, whatever is sent: the system that commands are solved from is singular."""
    file, step, lag = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml"), 0.1, 0.02
    place = np.column_stack([np.zeros((6, 2)), step * np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0])])
    late = with_effects(file, following_error={"lag_s": [lag] * 3, "pace": 2.0})
    sent = compensate(late, make_table(place, feed_mm_s=np.full(6, step / lag)), nearest=False)
    assert sent.status.tolist() == ["ok"] * 2 + ["out of reach"] * 4


def helix(random: np.random.Generator) -> np.ndarray:
    turn = np.linspace(0.0, 8.0 * np.pi, 200)
    return np.column_stack([60.0 * np.cos(turn), 60.0 * np.sin(turn), np.linspace(-40.0, 40.0, 200)])


def raster(random: np.random.Generator) -> np.ndarray:
    lines = [(side * x, y, z) for z in (-30.0, 30.0) for side, y in RASTER for x in np.linspace(-60.0, 60.0, 10)]
    return np.array(lines)


def cloud(random: np.random.Generator) -> np.ndarray:
    return random.uniform(-60.0, 60.0, (200, 3))


RASTER = [(1 if line % 2 else -1, y) for line, y in enumerate(np.linspace(-50.0, 50.0, 10))]


def speeds(meant: str, sent: np.ndarray, target: np.ndarray, feed: np.ndarray) -> np.ndarray:
    """What a simulation of one's own may take for the speed of the sliders at a row, (n, 3) mm/s."""
    way = np.diff(target, axis=0)
    lasts = np.linalg.norm(way, axis=1) / feed[1:]
    if meant == "both sides":
        return np.asarray(np.gradient(sent, np.append(0.0, np.cumsum(lasts)), axis=0))
    if meant == "the move there":
        move = np.diff(sent, axis=0) / lasts[:, None]
        return np.concatenate([move[:1], move])
    tool = np.concatenate([way[:1], way / lasts[:, None]])
    tool[0] /= lasts[0]
    jacobian = MECHANISM.jacobian(torch.as_tensor(sent)).numpy()
    return np.linalg.solve(jacobian, tool[:, :, None])[:, :, 0]


@pytest.mark.parametrize(
    ("meant", "path", "moves"),
    [
        pytest.param(meant, path, moves, marks=() if moves == asked.get(path) else pytest.mark.long)
        for asked in ({helix: "straight", cloud: "sliders"},)
        for meant in ("both sides", "the move there", "the tool's way there")
        for path in (helix, raster, cloud)
        for moves in ("sliders", "straight")
    ],
)
def test_whatever_speed_a_row_means_the_lag_alone_is_told(path: Callable, meant: str, moves: str) -> None:
    file = replace(BENCH, machine=BENCH.machine.model_copy(update={"moves": moves}))
    random = np.random.default_rng(3)
    target = path(random)
    feed = np.repeat(random.choice([10.0, 20.0, 30.0], 20), len(target) // 20)
    sent = MECHANISM.inverse(torch.as_tensor(target)).numpy()
    late = MECHANISM.forward(torch.as_tensor(sent - LAG * speeds(meant, sent, target, feed))).numpy()
    read = late + random.normal(0.0, 0.004, target.shape)
    found = diagnose(Model(file), build_problem(file, make_table(target, sent, feed_mm_s=feed, measured=read)))
    assert (found.verdict, found.suggested) == ("missing", (("following-error",),))
    np.testing.assert_allclose(lags_of(found), LAG, rtol=0.01)


@pytest.mark.parametrize("clock", [False, pytest.param(True, marks=pytest.mark.long)])
def test_ten_rows_to_a_turn_tell_the_lag_of_a_smooth_way(clock: bool) -> None:
    """The tool runs along an ellipse, first slowly: chords are shorter than its way, and their mean slower."""
    turn = np.linspace(0.0, 20.0 * np.pi, 200 * 100 + 1)
    way = np.column_stack([60.0 * np.cos(turn), 45.0 * np.sin(turn), np.linspace(-40.0, 40.0, len(turn))])
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1)))
    rows = np.searchsorted(length, np.linspace(0.0, length[-1], 101)[:-1])
    target, feed = way[rows], np.repeat([15.0, 30.0], 50)
    every = MECHANISM.inverse(torch.as_tensor(way)).numpy()
    velocity = np.gradient(every, length, axis=0)[rows] * feed[:, None]
    late = MECHANISM.forward(torch.as_tensor(every[rows] - 0.05 * LAG * velocity)).numpy()
    told = {"time_s": np.append(0.0, np.cumsum(np.diff(length[rows]) / feed[1:]))} if clock else {}
    file = replace(BENCH, machine=BENCH.machine.model_copy(update={"moves": "smooth"}))
    read = late + np.random.default_rng(4).normal(0.0, 0.004, late.shape)
    table = make_table(target, every[rows], feed_mm_s=feed, measured=read, **told)
    found = diagnose(Model(file), build_problem(file, table))
    assert (found.verdict, found.suggested) == ("missing", (("following-error",),))
    theta, std = found.model.terms[0].theta[:3].numpy(), found.model.terms[0].std
    assert std is not None and (np.abs(theta - 0.05 * LAG) < 3.0 * std[:3].numpy()).all()


def circles(random: np.random.Generator, waits: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Six circles, every other one the other way round, each entered by a run-up that is not in the table.

    Args:
        random: of the readings' scatter.
        waits: between circles, s.

    Returns:
        Targets (240, 3) mm, feeds (240,) mm/s, times (240,) s and readings of loops that lag.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    target, speed, lasts, feeds = [], [], [], []
    for number, (radius, feed) in enumerate(
        zip((40.0, 40.0, 25.0, 25.0, 60.0, 60.0), (30, 30, 10, 10, 20, 20), strict=True)
    ):
        way = 1.0 if number % 2 else -1.0
        turn = np.column_stack([np.cos(way * angle), np.sin(way * angle), np.zeros(40)])
        along = way * feed * np.column_stack([-turn[:, 1], turn[:, 0], np.zeros(40)])
        target.append(radius * turn)
        speed.append(along)
        feeds.append(np.full(40, float(feed)))
        lasts.append(np.append(waits, np.full(39, 2.0 * radius * np.sin(np.pi / 40.0) / feed)))
    p = torch.as_tensor(np.concatenate(target))
    sent = MECHANISM.inverse(p)
    joints = np.linalg.solve(MECHANISM.jacobian(sent).numpy(), np.concatenate(speed)[:, :, None])[:, :, 0]
    late = MECHANISM.forward(sent - torch.as_tensor(LAG * joints)).numpy()
    return (
        p.numpy(),
        np.concatenate(feeds),
        np.cumsum(np.concatenate(lasts)),
        late + random.normal(0.0, 0.004, late.shape),
    )


def test_a_circle_that_is_entered_anew_after_a_pause_is_passed_as_it_goes_on() -> None:
    target, feed, time, read = circles(np.random.default_rng(5), 25.0)
    table = make_table(target, feed_mm_s=feed, time_s=time, measured=read)
    found = diagnose(Model(BENCH), build_problem(BENCH, table))
    assert (found.verdict, found.suggested) == ("missing", (("following-error",),))
    np.testing.assert_allclose(lags_of(found), LAG, rtol=0.02)
    # Where the clock leaves no time for a run-up, the row is passed as it is reached.
    at_once = replace(table, time_s=circles(np.random.default_rng(5), 2.0)[2])
    starts = np.arange(len(target)) == 0
    paused, hurried = (pace_of(target, starts, each) for each in (table, at_once))
    assert paused is not None and hurried is not None
    along, arriving = paused.velocity(target)[40], hurried.velocity(target)[40]
    np.testing.assert_allclose(along / np.linalg.norm(along), [0.0, 1.0, 0.0], atol=0.01)
    np.testing.assert_allclose(arriving / np.linalg.norm(arriving), [0.0, -1.0, 0.0], atol=0.1)


def test_a_pause_among_corners_leaves_every_row_passed_as_it_is_reached() -> None:
    target, feed = cloud(np.random.default_rng(6)), 20.0
    lasts = np.linalg.norm(np.diff(target, axis=0, prepend=target[:1]), axis=1) / feed
    starts, feeds = np.arange(len(target)) == 0, np.full(len(target), feed)
    waited = np.where(np.arange(len(target)) == 50, 1800.0, lasts)
    tables = [make_table(target, feed_mm_s=feeds, time_s=np.cumsum(each)) for each in (lasts, waited)]
    even, broken = (pace_of(target, starts, each) for each in tables)
    assert even is not None and broken is not None
    np.testing.assert_array_equal(even.velocity(target), broken.velocity(target))


def test_a_pace_that_there_is_not_is_refused() -> None:
    entry = '[[effect]]\nname = "following-error"\n[effect.parameters]\nlag_s = { value = 0.02 }\n'
    with pytest.raises(ModelError, match=r"'pace' is out of its bounds.*0 to 7"):
        read_model(parse_machine(MACHINE + entry + "pace = { value = 8 }"))


def test_a_lag_that_names_no_pace_means_the_speed_of_a_smooth_way() -> None:
    entry = '[[effect]]\nname = "following-error"\n[effect.parameters]\nlag_s = { value = [0.02, 0.03, 0.012] }\n'
    (term,) = read_model(parse_machine(MACHINE + entry)).terms
    np.testing.assert_array_equal(term.theta, [*LAG, SMOOTH])


@pytest.mark.parametrize("lags", [True, False])
def test_a_reading_on_arrival_lags_though_the_clock_goes_on_behind_it(lags: bool) -> None:
    """Each move begins at a standstill, is read in the instant of its last command, and is followed by a pause."""
    random, rows = np.random.default_rng(5), 90
    target, feed = random.uniform(-60.0, 60.0, (rows, 3)), random.choice([8.0, 16.0, 30.0], rows)
    sent = MECHANISM.inverse(torch.as_tensor(target)).numpy()
    lasts = np.linalg.norm(np.diff(target, axis=0, prepend=target[:1]), axis=1) / feed

    def read_at(q: np.ndarray) -> np.ndarray:
        share = 1.0 - np.exp(-lasts[1:, None] / LAG)
        behind = np.diff(q, axis=0) / lasts[1:, None] * LAG * share
        return MECHANISM.forward(torch.as_tensor(q - lags * np.vstack([0.0 * LAG, behind]))).numpy()

    there = read_at(sent)
    table = make_table(target, sent, feed_mm_s=feed, time_s=np.cumsum(lasts + 4.0))
    problem = build_problem(BENCH, replace(table, measured=there + random.normal(0.0, 0.004, target.shape)))
    assert not problem.view.velocity.any() and "speed" not in problem.view.varies
    found = diagnose(Model(BENCH), problem)
    assert found.verdict == ("missing" if lags else "nothing-missing")
    assert found.suggested == ((("following-error",),) if lags else ())
    assert ("though by the clock it stood" in found.words) is lags
    if lags:
        np.testing.assert_allclose(lags_of(found), LAG, rtol=0.02)
        commands = compensate(found.model, make_table(target, feed_mm_s=feed)).q
        before, after = (np.linalg.norm(place - target, axis=1)[1:].mean() for place in (there, read_at(commands)))
        assert after < 0.02 * before


@pytest.mark.parametrize(("pace", "held"), [(EVEN, True), (EVEN + 4, False)])
def test_a_lag_on_the_move_is_kept_where_the_machine_stood(pace: int, held: bool) -> None:
    """Feeds vary, and tell only of a lag that follows them in spite of the clock."""
    random, rows = np.random.default_rng(6), 60
    target, feed = random.uniform(-60.0, 60.0, (rows, 3)), random.choice([8.0, 16.0, 30.0], rows)
    lasts = np.linalg.norm(np.diff(target, axis=0, prepend=target[:1]), axis=1) / feed
    table = make_table(target, feed_mm_s=feed, time_s=np.cumsum(lasts + 4.0))
    problem = build_problem(BENCH, replace(table, measured=target + random.normal(0.0, 0.004, target.shape)))
    entry = f'[[effect]]\nname = "following-error"\n[effect.parameters]\nlag_s = {{ value = {LAG.tolist()} }}\n'
    model = read_model(parse_machine(f"{MACHINE}{entry}pace = {{ value = {pace} }}\n"))
    ladder = climb(model, problem, [])
    lag = ladder.model.terms[0].theta[:3].numpy()
    assert np.allclose(lag, LAG) is held and bool(np.abs(lag).max() < 1e-3) is not held
    assert any("is kept as it was" in note for note in ladder.notes) is held


@pytest.mark.parametrize(("feeds", "tells"), [((8.0, 16.0, 30.0), True), ((16.0,), False), ((16.0, np.nan), False)])
def test_speeds_by_the_feed_are_kept_of_a_stand_where_feeds_vary(feeds: tuple[float, ...], tells: bool) -> None:
    random = np.random.default_rng(8)
    target = random.uniform(-60.0, 60.0, (40, 3))
    table = make_table(target, feed_mm_s=random.choice(feeds, 40), time_s=60.0 * np.arange(40))
    view = build_problem(BENCH, replace(table, measured=target)).view
    assert not view.velocity.any() and (view.fed is not None) is tells


@pytest.mark.parametrize("told", ["feed", "clock"])
def test_a_lap_that_begins_where_another_ended_is_passed_at_its_own_feed(told: str) -> None:
    """The pose in which laps meet is told twice, and nothing stands there."""
    turn = np.tile(np.linspace(0.0, 2.0 * np.pi, 41), 3)
    feed = np.repeat([8.0, 20.0, 50.0], 41)
    wave, ahead = (np.stack([np.cos(turn + by), np.sin(turn + by), 0.0 * turn], axis=1) for by in (0.0, np.pi / 2.0))
    target = np.round(40.0 * wave, 9)
    way = np.linalg.norm(np.diff(target, axis=0, prepend=target[:1]), axis=1)
    time = np.cumsum(np.maximum(way / feed, 1e-3))
    table = make_table(target, feed_mm_s=feed if told == "feed" else None, time_s=time)
    view = build_view(BENCH, table)
    tool = (view.jacobian @ view.velocity[:, :, None])[:, :, 0].numpy()
    np.testing.assert_allclose(tool / feed[:, None], ahead, atol=0.02)


def test_a_row_that_repeats_the_end_of_a_line_at_once_has_no_speed_of_the_move_to_it():
    """Lines read on the move that share the row where the tool turns: on a way through the rows a lap begins there."""
    line = np.column_stack([np.arange(6.0), np.zeros(6), np.zeros(6)])
    place = np.concatenate([line, line[::-1], line])
    lasts = np.concatenate([[0.0], np.linalg.norm(np.diff(place, axis=0), axis=1)]) / 10.0
    table = make_table(place, feed_mm_s=np.full(18, 10.0), time_s=np.cumsum(lasts))
    starts = np.arange(18) == 0
    even, mean = (pace_of(place, starts, table, kind=kind) for kind in (EVEN, MEAN))
    assert even is not None and mean is not None
    np.testing.assert_allclose(even.velocity(place)[[5, 6, 7, 12, 13], 0], [10.0, 0.0, -10.0, 0.0, 10.0], atol=1e-9)
    assert mean.velocity(place)[6, 0] == pytest.approx(-10.0)
