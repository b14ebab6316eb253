"""Dependence of an error on one variable: known causes are named first, noise names nothing."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ptt.dependence.chance import gumbel_tail, log_chance, slow_excess
from ptt.dependence.contexts import context_views, joint_residual, level, residual_views
from ptt.dependence.dependence import Dependence
from ptt.dependence.following import dependence_of, depends_on
from ptt.dependence.parts import by_level, part_of
from ptt.dependence.periods import periodogram, refine_frequency, trial_frequencies
from ptt.dependence.strata import find_poses, whiten
from ptt.dependence.where import where_it_fails, worst_region
from ptt.machine import parse_machine
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table

SIGMA = 0.005
ROD, REACH = 300.0, 100.0
TOWER = np.column_stack([np.cos(np.radians([0, 120, 240])), np.sin(np.radians([0, 120, 240]))])
MACHINE = """
[machine]
kind = "three-ptt"
name = "bench"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_azimuth_deg = [0.0, 120.0, 240.0]
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0
[tracker]
frame = "fitted"
"""


class Bench:
    """Poses of a linear delta with its heights, Jacobian db/dp and contexts; no code of the library."""

    def __init__(self, design: str, rows: int, random: np.random.Generator) -> None:
        place = {
            "path": lambda: path(rows),
            "volume": lambda: volume(rows, random),
            "warm": lambda: np.tile(volume(rows // 4, random), (4, 1)),
        }[design]()
        self.place = np.round(place, 4)
        n = len(self.place)
        arm = self.place[:, None, :2] - REACH * TOWER
        drop = -np.sqrt(ROD**2 - np.square(arm).sum(axis=2))
        self.height = self.place[:, 2:] - drop
        self.jacobian = np.concatenate([arm / drop[:, :, None], np.ones((n, 3, 1))], axis=2)
        self.side = arrivals(self.height)
        self.time = np.arange(n) * 12.0 + (np.arange(n) * 4 // n) * 1800.0 * (design == "warm")
        self.warmth = 20.0 + 8.0 * -np.expm1(-self.time / 4000.0)
        self.group = np.unique(self.place, axis=0, return_inverse=True)[1].reshape(-1)
        self.block = np.arange(n) * 10 // n
        self.context = {f"b{i + 1}": self.height[:, i] for i in range(3)}
        self.context |= {f"direction{i + 1}": self.side[:, i] for i in range(3)}
        self.context |= {"time": self.time} | dict(zip("xyz", self.place.T, strict=True))
        if design == "warm":
            self.context["temperature"] = self.warmth + 0.02 * random.normal(size=n)

    def tool(self, slider: np.ndarray) -> np.ndarray:
        """Tool error of slider errors, (n, 3)."""
        return np.linalg.solve(self.jacobian, slider[:, :, None])[:, :, 0]

    def views(self, error: np.ndarray) -> dict[str, np.ndarray]:
        inner = np.einsum("nij,nj->ni", self.jacobian, error)
        return dict(zip("xyz", error.T, strict=True)) | {f"slider {i + 1}": inner[:, i] for i in range(3)}

    def level(self, error: np.ndarray) -> np.ndarray:
        """Without its best rigid motion."""
        turn = np.stack([np.cross(axis, self.place) for axis in np.eye(3)], axis=2)
        columns = np.concatenate([np.tile(np.eye(3), (len(error), 1, 1)), turn], axis=2).reshape(-1, 6)
        return error - (columns @ np.linalg.lstsq(columns, error.ravel(), rcond=None)[0]).reshape(-1, 3)

    def find(self, error: np.ndarray, seed: int = 0) -> tuple[Dependence, ...]:
        return depends_on(self.views(self.level(error)), self.context, self.group, self.block, seed=seed)


def volume(rows: int, random: np.random.Generator) -> np.ndarray:
    """Random poses, every third part as groups Q P S P Q P S P, now and then a datum."""
    places: list[np.ndarray] = []
    while len(places) < rows:
        if len(places) % 36 < 12:
            pose = random.uniform([-55, -55, -45], [55, 55, 45])
            way = random.normal(size=3)
            way *= 12.0 / np.linalg.norm(way)
            places += [pose - way, pose, pose + way, pose] * 2
        else:
            places.append(random.uniform([-60, -60, -50], [60, 60, 50]))
        if len(places) % 30 == 0:
            places += [np.array([10.0, 14.0, 30.0]), np.zeros(3)]
    return np.array(places[:rows])


def path(rows: int) -> np.ndarray:
    """A helix there and back, twice."""
    step = np.arange(1, rows // 4 + 1)
    angle = 4.0 * np.pi * step / len(step)
    helix = np.column_stack([60.0 * np.cos(angle), 60.0 * np.sin(angle), -30.0 + 60.0 / len(step) * step])
    return np.tile(np.concatenate([helix, helix[-2:0:-1]]), (2, 1))


def arrivals(height: np.ndarray) -> np.ndarray:
    side = np.sign(np.diff(height, axis=0, prepend=height[:1]))
    side[0] = side[1]
    for row in range(1, len(side)):
        side[row] = np.where(side[row] == 0, side[row - 1], side[row])
    return np.where(side == 0, 1.0, side)


def hidden(kind: str, bench: Bench, random: np.random.Generator) -> tuple[np.ndarray, int, float]:
    """A fault in tool space at unit size, the slider it sits on, and its place or period."""
    leg = int(random.integers(3))
    height, slider = bench.height[:, leg], np.zeros((len(bench.height), 3))
    middle = height.mean() + random.uniform(-20.0, 20.0)
    if kind == "hose":
        angle = random.uniform(0.0, 2.0 * np.pi)
        anchor = np.array([350.0 * np.cos(angle), 350.0 * np.sin(angle), random.uniform(100.0, 300.0)])
        way = anchor - bench.place
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return np.maximum(length - np.linalg.norm(anchor) + random.uniform(0, 15), 0.0) * way / length, leg, 0.0
    if kind == "roller":
        middle = 5.0 * random.choice([random.uniform(0.6, 0.85), random.uniform(1.25, 1.75), random.uniform(2.3, 3.4)])
    slider[:, leg] = {
        "splice": lambda: (height > middle) * 1.0,
        "damage": lambda: 0.5 * (1.0 + np.cos(2.0 * np.pi * np.clip((height - middle) / 10.0, -0.5, 0.5))),
        "roller": lambda: np.cos(2.0 * np.pi * height / middle + random.uniform(0.0, 6.0)),
        "play": lambda: -bench.side[:, leg] / 2.0,
        "warm play": lambda: -np.maximum(bench.warmth - random.uniform(21.0, 24.0), 0.0) * bench.side[:, leg],
        "smooth": lambda: np.sin((height - middle) / 40.0),
    }[kind]()
    return bench.tool(slider), leg, float(middle)


def draw(kind: str, design: str, seed: int, *, ratio: float = 2.0, rows: int = 300, noise: str = "white"):
    """A fault of `ratio` x the noise once the frame is out, with noise; what is found, the slider, the place."""
    random = np.random.default_rng([seed, sum(map(ord, kind + design))])
    bench = Bench(design, rows, random)
    error, leg, place = (np.zeros_like(bench.place), 0, 0.0) if kind == "none" else hidden(kind, bench, random)
    error = bench.level(error)
    size = np.sqrt(np.square(error).sum(axis=1).mean())
    error = error * (ratio * SIGMA * np.sqrt(3.0) / size) if size > 0 else error
    return bench.find(error + SIGMA * scatter(noise, bench, random), seed), leg, place


def scatter(noise: str, bench: Bench, random: np.random.Generator) -> np.ndarray:
    white = random.normal(size=bench.place.shape)
    if noise == "repeats":
        return 0.45 * white + 0.9 * random.normal(size=(bench.group.max() + 1, 3))[bench.group]
    if noise == "drift":
        return white + 3.0 * np.cumsum(random.normal(size=white.shape), axis=0) / np.sqrt(len(white))
    return random.standard_t(3, size=white.shape) if noise == "heavy" else white


def is_right(kind: str, leg: int, place: float, item: Dependence) -> bool:
    if kind == "hose":
        return item.on in ("x", "y", "z")
    if kind == "play":
        return item.on == f"direction{leg + 1}"
    if kind == "warm play":
        return item.on == f"direction{leg + 1}" and item.with_ == "temperature"
    if item.on != f"b{leg + 1}":
        return False
    return kind != "roller" or (item.period_mm is not None and abs(item.period_mm / place - 1.0) < 0.03)


CASES = [
    ("splice", "volume"),
    ("splice", "path"),
    ("damage", "volume"),
    ("damage", "path"),
    ("roller", "volume"),
    ("roller", "path"),
    ("hose", "volume"),
    ("play", "volume"),
    ("warm play", "warm"),
    ("smooth", "volume"),
]


@pytest.mark.parametrize(("kind", "design"), CASES)
def test_the_cause_comes_first_at_twice_the_noise(kind: str, design: str) -> None:
    right = 0
    for seed in range(10):
        found, leg, place = draw(kind, design, seed)
        right += bool(found) and is_right(kind, leg, place, found[0])
    assert right >= 9


@pytest.mark.parametrize(("design", "noise", "rows"), [
    ("volume", "white", 300), ("path", "white", 300), ("volume", "repeats", 300), ("path", "repeats", 300),
    ("volume", "white", 60), ("volume", "heavy", 150),
])  # fmt: skip
def test_noise_depends_on_nothing(design: str, noise: str, rows: int) -> None:
    alarms = sum(bool(draw("none", design, seed, noise=noise, rows=rows)[0]) for seed in range(25))
    assert alarms <= 1


@pytest.mark.parametrize("design", ["volume", "path"])
def test_drift_is_blamed_on_time_alone(design: str) -> None:
    first, machine = 0, 0
    for seed in range(15):
        found, _, _ = draw("none", design, seed, noise="drift")
        first += found[0].on == "time"
        machine += any(item.on != "time" for item in found)
    assert first >= 14
    assert machine <= 2


def test_a_step_and_a_bump_are_found_where_they_sit() -> None:
    for kind in ("splice", "damage"):
        found, leg, place = draw(kind, "volume", 3, ratio=4.0)
        item = next(item for item in found if item.residual == f"slider {leg + 1}" and item.on == f"b{leg + 1}")
        assert item.place is not None
        assert item.place[0] - 0.5 <= place <= item.place[1] + 0.5
        assert item.shape == {"splice": "step", "damage": "bump"}[kind]
        assert item.place[1] - item.place[0] < {"splice": 3.0, "damage": 16.0}[kind]


def test_a_slider_that_explains_as_much_comes_before_the_tool() -> None:
    found, leg, _ = draw("damage", "volume", 5, ratio=6.0)
    assert (found[0].residual, found[0].on) == (f"slider {leg + 1}", f"b{leg + 1}")


def test_the_list_is_sorted_complete_and_repeatable() -> None:
    found, _, _ = draw("splice", "volume", 1, ratio=3.0)
    again, _, _ = draw("splice", "volume", 1, ratio=3.0)
    assert all(a.share >= b.share for a, b in pairwise(found))
    assert [item.to_dict() for item in found] == [item.to_dict() for item in again]
    for item in found:
        assert 0.0 < item.share <= 1.0
        assert 0.0 <= item.p_value <= 0.01
        assert item.curve.shape[1] == 3
        assert np.isfinite(item.curve).all()
        assert set(item.to_dict()) >= {"residual", "on", "share", "p_value", "period_mm"}


def test_the_share_is_of_the_variance_and_not_of_chance() -> None:
    """y = f(v) + noise of equal variance: half the variance, with no more bias than its spread."""
    shares = []
    for seed in range(20):
        random = np.random.default_rng([seed, 4])
        value = random.uniform(0.0, 100.0, 300)
        wave = np.sin(value / 12.0)
        error = wave / wave.std() + random.normal(size=300)
        found = depends_on({"x": error}, {"z": value}, np.arange(300), np.arange(300) // 30, seed=seed)
        shares.append(found[0].share)
    assert abs(np.mean(shares) - 0.5) < 0.03


def test_one_pose_visited_often_proves_nothing() -> None:
    """A datum read forty times with an error of its own is one place, not forty."""
    for seed in range(8):
        random = np.random.default_rng([seed, 9])
        group = np.concatenate([np.arange(100), np.full(40, 100)])
        value = random.uniform(0.0, 100.0, 101)[group]
        error = random.normal(size=101)[group] + 0.05 * random.normal(size=140)
        assert depends_on({"x": error}, {"z": value, "b1": value}, group, np.arange(140) // 14, seed=seed) == ()


def test_gross_outliers_and_missing_rows_do_not_hide_the_cause() -> None:
    random = np.random.default_rng(2)
    bench = Bench("volume", 300, random)
    error = bench.tool(0.02 * (bench.height > [270.0, 1e9, 1e9])) + SIGMA * random.normal(size=bench.place.shape)
    views = bench.views(bench.level(error))
    wild = random.permutation(300)[:15]
    for values in views.values():
        values[wild] += random.normal(size=15) * 0.5
        values[random.permutation(300)[:5]] = np.nan
    assert depends_on(views, bench.context, bench.group, bench.block)[0].on == "b1"


def test_payload_levels_and_gaps_in_temperature() -> None:
    random = np.random.default_rng(6)
    payload = np.repeat([0.0, 2.5, 5.0], 80)
    warmth = 20.0 + np.linspace(0.0, 5.0, 240) + random.normal(size=240)
    warmth[::9] = np.nan
    error = 0.004 * payload + SIGMA * random.normal(size=240)
    context = {"payload": payload, "temperature": warmth}
    found = depends_on({"z": error}, context, np.tile(np.arange(80), 3), np.arange(240) // 24)
    assert found[0].on == "payload"
    assert found[0].shape == "levels"
    np.testing.assert_allclose(np.diff(found[0].curve[:, 1]), 0.01, atol=0.003)


def test_too_little_to_say_anything() -> None:
    values = np.arange(8.0)
    assert depends_on({"x": values}, {"z": values}, np.arange(8), np.zeros(8, int)) == ()
    assert depends_on({"x": np.arange(50.0)}, {"z": np.ones(50)}, np.arange(50), np.zeros(50, int)) == ()


def test_log_chances_agree_with_the_beta_distribution() -> None:
    from scipy import stats

    for dims, freedom in ((1, 40), (2, 290), (7, 120)):
        share = np.array([0.01, 0.05, 0.1, 0.5, 0.8])
        exact = -stats.beta(dims / 2, freedom / 2).logsf(share)
        np.testing.assert_allclose(log_chance(share, dims, freedom), exact, rtol=1e-3, atol=1e-3)
    deep = log_chance(np.array([0.99, 0.999]), 1, 3000)  # chance below what a float can hold
    assert np.isfinite(deep).all()
    assert deep[1] > deep[0] > 5000.0


@settings(max_examples=30, deadline=None)
@given(st.floats(0.5, 3.0), st.floats(0.0, 20.0))
def test_gumbel_tail_is_a_falling_chance(scale: float, place: float) -> None:
    largest = place + scale * np.random.default_rng(0).gumbel(size=200)
    tail = gumbel_tail(np.linspace(place - 5.0, place + 60.0, 40), largest)
    assert ((tail >= 0.0) & (tail <= 1.0)).all()
    assert (np.diff(tail) <= 0.0).all()


def test_white_noise_is_rarely_slow_and_drift_always() -> None:
    random = np.random.default_rng(1)
    white = [slow_excess(random.normal(size=300), 10).max() > 0 for _ in range(200)]
    drift = [slow_excess(np.cumsum(random.normal(size=300)), 10).max() > 5 for _ in range(50)]
    assert np.mean(white) < 0.06
    assert all(drift)


def test_whitening_gives_poses_the_weight_of_their_independent_rows() -> None:
    """Covariance of whitened nested errors is a multiple of the identity, by 2000 draws."""
    random = np.random.default_rng(8)
    group = np.repeat(np.arange(6), [1, 2, 3, 4, 1, 5])
    draws = 0.5 * random.normal(size=(16, 20000)) + 1.5 * random.normal(size=(6, 20000))[group]
    poses = find_poses(np.column_stack([draws[:, 0]]), group)
    true = type(poses)(poses.number, poses.first, poses.size, 9.0)
    covariance = np.cov(whiten(draws, true, means=False)) / 0.25
    np.testing.assert_allclose(covariance, np.eye(16), atol=0.06)


def test_a_few_rounded_repeats_say_nothing_of_what_poses_share() -> None:
    """A datum read five times to the same hundredth does not make every other row worth nothing beside its visits."""
    random = np.random.default_rng(2)
    readings = np.round(0.008 * random.normal(size=(70, 3)), 2)
    group = np.arange(70)
    group[[0, 16, 32, 48, 64]] = 0
    readings[[0, 16, 32, 48, 64]] = [
        [0.0, 0.0, 0.01],
        [0.0, 0.01, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
    ]
    assert find_poses(readings, group).ratio == 0.0
    shared = np.repeat(0.02 * random.normal(size=(35, 3)), 2, axis=0) + 0.002 * random.normal(size=(70, 3))
    assert find_poses(shared, np.arange(70) // 2).ratio > 10.0


def test_periodogram_finds_a_line_between_trials_and_knows_noise() -> None:
    random = np.random.default_rng(3)
    height = random.uniform(200.0, 340.0, 300)
    error = 0.008 * np.cos(2.0 * np.pi * height / 7.31 + 0.4) + SIGMA * random.normal(size=300)
    lines = periodogram(height, error)
    assert lines.share.max() > lines.chance
    assert 1.0 / refine_frequency(height, error, 1.0 / lines.best) == pytest.approx(7.31, rel=2e-3)
    quiet = [periodogram(height, random.normal(size=300)) for _ in range(60)]
    assert np.mean([item.share.max() > item.chance for item in quiet]) < 0.06
    assert not len(trial_frequencies(np.arange(10.0)))


def _problem(seed: int = 0):
    random = np.random.default_rng(seed)
    bench = Bench("volume", 200, random)
    error = bench.tool(0.03 * (bench.height > [1e9, 275.0, 1e9])) + SIGMA * random.normal(size=bench.place.shape)
    payload = np.repeat([0.0, 2.0], 100)
    table = make_table(bench.place, measured=bench.place + error, payload_kg=payload, time_s=bench.time)
    problem = build_problem(parse_machine(MACHINE), table)
    return problem, problem.measured - problem.view.p.numpy(), bench


def test_a_problem_is_seen_in_tool_and_slider_space() -> None:
    problem, residual, bench = _problem()
    residual[3] = np.nan
    views, context = residual_views(problem, residual), context_views(problem)
    assert list(views) == ["x", "y", "z", "slider 1", "slider 2", "slider 3"]
    inner = np.column_stack([views[f"slider {i}"] for i in (1, 2, 3)])
    seen = np.isfinite(residual[:, 0])
    expected = np.einsum("nij,nj->ni", bench.jacobian, residual)
    np.testing.assert_allclose(inner[seen], expected[seen], atol=1e-9)
    assert np.isnan(inner[3]).all()
    assert {"b1", "b2", "b3", "x", "y", "z", "time", "payload", "direction1"} <= set(context)
    assert not {"run", "temperature"} & set(context)
    found = dependence_of(problem, residual)
    assert found[0].on == "b2"


def test_levelling_takes_out_the_frame() -> None:
    problem, residual, bench = _problem()
    turned = residual + np.cross(np.array([1e-3, -2e-3, 5e-4]), bench.place) + [0.1, 0.2, -0.3]
    np.testing.assert_allclose(level(problem, turned), level(problem, residual), atol=3e-3)


def test_redundant_arms_get_the_smallest_joint_errors() -> None:
    random = np.random.default_rng(5)
    jacobian, error = random.normal(size=(20, 3, 6)), random.normal(size=(20, 3))
    inner = joint_residual(jacobian, error)
    np.testing.assert_allclose(np.einsum("nck,nk->nc", jacobian, inner), error, atol=1e-9)
    other = inner + np.linalg.svd(jacobian)[2][:, -1]  # the null space adds length
    assert (np.linalg.norm(inner, axis=1) < np.linalg.norm(other, axis=1)).all()


def test_where_it_fails_names_the_place_and_the_rows() -> None:
    problem, residual, bench = _problem()
    corner = (bench.place > [20.0, -1e9, -1e9]).all(axis=1)
    residual = 0.2 * residual
    residual[corner] += [0.2, 0.0, 0.0]
    where = where_it_fails(problem, residual)
    assert where.region is not None
    assert corner[((bench.place >= where.region.low) & (bench.place <= where.region.high)).all(axis=1)].mean() > 0.9
    assert where.region.mean > 0.15 > where.region.error
    sizes = np.linalg.norm(residual, axis=1)
    assert [row.size for row in where.rows] == sorted(sizes, reverse=True)[:10]
    assert where.rows[0].line == problem.table.line[int(sizes.argmax())]
    assert [part.label for part in where.by_joint] == ["slider 1", "slider 2", "slider 3"]
    assert [part.label for part in where.by_payload] == ["0 kg", "2 kg"]
    assert sum(part.rows for part in where.by_time) == sum(part.rows for part in where.by_payload) == 200
    assert where.to_dict()["worst_region"] is not None
    assert {row.run for row in where.rows} <= set(problem.table.run_label)


def test_parts_say_um_or_urad() -> None:
    way, turn = part_of("slider 1", np.full(4, 2e-3)).to_dict(), part_of("joint 1", np.full(4, 2e-6), "rad").to_dict()
    assert (way["rms_um"], turn["rms_urad"]) == (pytest.approx(2.0), pytest.approx(2.0))
    assert "rms_um" not in turn


def test_regions_need_readings_and_levels_need_variety() -> None:
    assert worst_region(np.zeros((0, 3)), np.zeros(0)) is None
    assert worst_region(np.eye(3), np.ones(3)) is None
    assert by_level(np.full(5, 2.0), np.ones(5), "kg") == ()
    assert sum(part.rows for part in by_level(np.arange(40.0), np.ones(40), "kg")) == 40


def test_the_noise_of_loud_coordinates_is_not_carried_into_a_quiet_one() -> None:
    """A frame fitted by weights to sound readings that scatter by 0.5 um along y and by 7 um across it."""
    problem, _, bench = _problem()
    sigma = 1e-3 * np.array([7.0, 0.5, 7.0])
    sharp = problem.with_noise(Noise(np.diag(np.square(sigma)), "std columns"))
    turns = np.stack([np.cross(axis, bench.place - bench.place.mean(axis=0)) for axis in np.eye(3)], axis=2)
    rigid = np.concatenate([np.tile(np.eye(3), (200, 1, 1)), turns], axis=2) / sigma[:, None]
    wrong = 0
    for seed in range(8):
        white = np.random.default_rng(seed).normal(size=(200, 3))
        solved = np.linalg.lstsq(rigid.reshape(-1, 6), white.ravel(), rcond=None)[0]
        sound = (white - rigid @ solved) * sigma
        np.testing.assert_array_equal(level(sharp, sound), sound)
        wrong += bool(dependence_of(sharp, sound))
    assert wrong <= 1
    bent = sound + 0.03 * rigid[:, :, 5] * sigma  # what is lacking holds the frame off by 30 urad
    np.testing.assert_allclose(level(sharp, bent), level(problem, sound), atol=2e-4)
