"""Foreign rigs: drawings far from singularities, paths inside them, noise as its name says; sound means nominal."""

import itertools

import numpy as np
import pytest
import torch

from ptt.challenge.truth import reading_noise
from ptt.errors import TableError
from ptt.machine import format_machine, parse_machine
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.draw_foreign import CONDITIONS, draw_foreign
from ptt.rig.draw_machine import GRID, draw_machine_file, singularity_margins
from ptt.rig.draw_noise import NOISES, draw_noise, stated_sigma
from ptt.rig.loaded import nominal_tool
from ptt.rig.nominal import ideal_machine, nominal_sliders
from ptt.rig.paths import CURVES, PATHS, RASTER_VISITS, draw_plan, make_path
from ptt.rig.schedule import TARGET
from ptt.rig.schema import Tracker
from ptt.rig.tracker import read_points

SEEDS = range(40)


# --- drawings ------------------------------------------------------------------------------------------------------


def test_drawings_are_of_many_kinds_and_can_be_written() -> None:
    files = [draw_machine_file(seed).file for seed in SEEDS]
    specs = [file.machine for file in files]
    assert min(s.link_length_mm for s in specs) < 220.0 and max(s.link_length_mm for s in specs) > 700.0
    assert {s.sliders for s in specs} == {"above", "below"} and {s.moves for s in specs} == {"sliders", "straight"}
    assert any(max(np.abs(s.slider_lean_deg)) > 5.0 for s in specs)
    gaps = np.array([np.diff(s.slider_azimuth_deg) for s in specs])
    assert (np.abs(gaps - 120.0) > 5.0).any() and (np.abs(gaps - 120.0) < 1e-9).all(axis=1).any()
    assert {f.tracker.frame for f in files} == {"fitted", "trusted", "fitted-per-run", "measured"}
    assert all(parse_machine(format_machine(file)) == file for file in files)
    assert draw_machine_file(3).file == files[3] and draw_machine_file(41).file != draw_machine_file(42).file


@pytest.mark.parametrize("seed", range(0, 40, 4))
def test_workspaces_are_reached_and_far_from_singularities(seed: int) -> None:
    foreign = draw_machine_file(seed)
    drawing, tool = ideal_machine(foreign.file.machine), GRID * foreign.half_size
    height = nominal_sliders(drawing, tool)
    low, high = foreign.file.machine.slider_travel_mm
    assert (height > low).all() and (height < high).all()
    np.testing.assert_allclose(nominal_tool(drawing, height), tool, atol=1e-9)
    # How far the tool goes for a little of each slider, by the platform's own closure.
    step = 1e-4
    turned = [nominal_tool(drawing, height + step * unit) - tool for unit in np.eye(3)]
    forward = np.stack(turned, axis=-1) / step
    gain = np.linalg.svd(forward, compute_uv=False)[:, 0]
    np.testing.assert_allclose(singularity_margins(drawing, tool)["gain"], gain, rtol=1e-4)
    assert gain.max() < 4.6


def test_turning_is_held_where_the_constraint_equation_says_so() -> None:
    """g_1 g_2 w_3 + g_2 g_3 w_1 + g_1 g_3 w_2 = 0 is the constraint singularity of an upright, even machine."""
    spec = draw_machine_file(0).file.machine.model_copy(
        update={"slider_azimuth_deg": (0.0, 120.0, 240.0), "slider_lean_deg": (0.0, 0.0, 0.0)}
    )
    drawing = ideal_machine(spec)
    rho, link = spec.base_radius_mm - spec.platform_radius_mm, spec.link_length_mm
    tool = np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3)) * 0.55 * link
    q = tool[:, None, :2] - rho * drawing.outward[:, :2]
    square = link**2 - (q**2).sum(-1)
    good = (square > 0.0).all(axis=1)
    g = (q * drawing.outward[:, :2]).sum(-1)[good]
    w = np.sqrt(square[good])
    volume = np.abs(sum(g[:, i] * g[:, j] * w[:, 3 - i - j] for i, j in itertools.combinations(range(3), 2)))
    volume *= np.sqrt(0.75) / link**3
    turn = singularity_margins(drawing, tool)["turn"][good]
    # |det| of three vectors no longer than 1 is at most its least singular value times the two others, 1.5 together.
    assert (turn * 1.5 > volume * 0.999).all()
    assert ((turn < 0.02) == (volume < 0.02)).mean() > 0.9
    assert volume[turn < 0.005].max() < 0.01 and (turn < 0.005).any()


# --- paths ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", CURVES)
def test_curves_stay_inside_and_fill_the_room(kind: str) -> None:
    room = np.array([50.0, 40.0, 20.0])
    poses = make_path(kind, 300, room, np.random.default_rng(1))
    assert poses.shape == (300, 3)
    assert (np.abs(poses) <= room + 1e-4).all()
    across = np.ptp(poses, axis=0) / (2.0 * room)
    assert across[:2].min() > 0.45
    assert (across[2] < 1e-9) == (kind == "circle")


@pytest.mark.parametrize(("path", "rows"), list(itertools.product(PATHS, (24, 300))))
def test_plans_have_about_the_rows_asked_for_and_can_be_run(path: str, rows: int) -> None:
    for seed in range(4):
        drawn = draw_foreign(seed, "volume", path=path, rows=rows, repeats="cycles")
        result = simulate(drawn.rig, drawn.targets)
        pose = (result.frame["role"] == "pose").to_numpy()
        read = pose & ("read" not in drawn.targets or np.resize(drawn.targets["read"] == 1, len(pose)))
        assert 0.5 * rows <= read.sum() <= 1.4 * rows + 16
        assert (np.abs(drawn.targets[TARGET]) <= drawn.half_size + 1e-3).all().all()


def test_poses_of_a_run_without_stops_lie_close() -> None:
    """Speeds between poses are told by chords: the way turns by no more than a few degrees from one to the next."""
    for seed in range(12):
        drawn = draw_foreign(seed, "speed", rows=130, noise="white")
        way = np.diff(drawn.targets[TARGET].to_numpy(), axis=0)
        # The middle of a spiral is a corner, which the rig rounds off.
        unit = (way / np.linalg.norm(way, axis=1, keepdims=True))[10:]
        assert ((unit[1:] * unit[:-1]).sum(1) > np.cos(np.radians(20.0))).all(), drawn.notes
        assert drawn.rig.tracker.datum_every == 0


def test_forms_of_repeats() -> None:
    foreign = draw_machine_file(2)
    drawing = ideal_machine(foreign.file.machine)

    def plan(form: str):
        return draw_plan(5, drawing, foreign.half_size, 240, "cloud", form)

    none, cycles, nine = plan("none"), plan("cycles"), plan("nine")
    assert none.cycles == 1 and none.targets["name"].is_unique and len(none.targets) == 240
    assert cycles.cycles > 1 and len(cycles.targets) * cycles.cycles <= 240 and cycles.targets["name"].is_unique
    assert (len(nine.targets), nine.cycles) == RASTER_VISITS
    again, shuffled = plan("consecutive").targets["name"].to_numpy(), plan("shuffled").targets["name"]
    visits = len(again) // len(set(again))
    assert visits > 1 and (again.reshape(-1, visits) == again[::visits, None]).all()
    assert (shuffled.value_counts() == visits).all()
    assert (shuffled.to_numpy()[1:] == shuffled.to_numpy()[:-1]).mean() < 0.1


@pytest.mark.parametrize("seed", range(0, 12, 3))
def test_one_way_means_every_slider_comes_upwards(seed: int) -> None:
    drawn = draw_foreign(seed, "volume", path="one-way", rows=60, repeats="none", noise="white")
    rig = parse_rig(
        {
            "machine": drawn.rig.machine.machine.model_dump(mode="json"),
            "conditions": {"report_direction": True},
        }
    )
    frame = simulate(rig, drawn.targets, noise=False).frame
    read = frame["x_meas"].notna()
    assert read.sum() == len(frame) // 2
    assert (frame.loc[read, ["dir1", "dir2", "dir3"]] == 1.0).all().all()


def test_a_row_is_read_or_not_by_a_number() -> None:
    drawn = draw_foreign(0, path="cloud", rows=30, repeats="none")
    with pytest.raises(TableError, match="column read"):
        simulate(drawn.rig, drawn.targets.assign(read="no"))


# --- sound rigs ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", CONDITIONS)
def test_a_sound_rig_is_nominal_whatever_its_drawing(protocol) -> None:
    for seed in range(12):
        drawn = draw_foreign(seed, protocol)
        result = simulate(drawn.rig, drawn.targets, noise=False)
        pose = (result.frame["role"] != "base").to_numpy()
        np.testing.assert_allclose(result.truth[pose], result.frame[TARGET].to_numpy(float)[pose], atol=1e-8)
        assert parse_rig(format_rig(drawn.rig)) == drawn.rig
        varies = {name: result.frame[name].nunique() > 1 for name in ("payload_kg", "temp_c", "feed_mm_s")}
        wanted = {"payload": "payload_kg", "warmup": "temp_c", "speed": "feed_mm_s"}.get(protocol)
        assert varies == {name: name == wanted for name in varies}
        assert drawn.truth == {}


def test_draws_repeat() -> None:
    one, two = draw_foreign(9, "payload"), draw_foreign(9, "payload")
    assert one.rig == two.rig and one.absent == two.absent
    assert one.targets.equals(two.targets) and one.rig != draw_foreign(10, "payload").rig
    assert draw_foreign(9, noise="heavy").rig.machine.machine == one.rig.machine.machine


@pytest.mark.parametrize("seed", range(6))
def test_the_library_has_the_same_drawing(seed: int) -> None:
    """Rig and library know nothing of each other, and agree on every drawing."""
    drawn = draw_foreign(seed, rows=40)
    frame = simulate(drawn.rig, drawn.targets, noise=False).frame
    poses = frame[frame["role"] != "base"]
    mechanism = ThreePtt.from_spec(drawn.rig.spec)
    tool = mechanism.forward(torch.tensor(poses[["b1_cmd", "b2_cmd", "b3_cmd"]].to_numpy(float))).numpy()
    np.testing.assert_allclose(tool, poses[TARGET].to_numpy(float), atol=1e-8)


# --- noise ---------------------------------------------------------------------------------------------------------


def errors(values: dict, points: np.ndarray, step: float = 10.0, seed: int = 1) -> np.ndarray:
    tracker = Tracker.model_validate({k: v for k, v in values.items() if k != "missing_share"})
    time = step * np.arange(len(points))
    run = np.zeros(len(points), dtype=int)
    reading = read_points(tracker, points, time, run, seed=seed, setup_seed=0, noise=True)
    keep = ~reading.outlier
    return (reading.measured - points)[keep]


@pytest.mark.parametrize("kind", NOISES)
def test_noise_is_as_large_as_it_is_said_to_be(kind: str) -> None:
    points = np.random.default_rng(2).uniform(-200, 200, (6000, 3))
    for seed in range(3):
        values = draw_noise(kind, seed)
        assert values == draw_noise(kind, seed)
        drawn = draw_foreign(seed, noise=kind)
        tracker = {name: getattr(drawn.rig.tracker, name) for name in values}
        assert tracker == {key: tuple(v) if isinstance(v, list) else v for key, v in values.items()}
        rig = parse_rig({"machine": drawn.rig.machine.machine.model_dump(mode="json"), "tracker": values})
        error = errors(values, points, step=3000.0)
        size = np.sqrt(np.square(error).sum(1).mean())
        # Heavy tails make the scatter of so many readings itself scatter; the rest is sampling.
        assert size == pytest.approx(reading_noise(rig, points).total, rel=0.15 if "heavy_dof" in values else 0.06)


def test_white_heavy_and_quantised_noise() -> None:
    still = np.tile([[20.0, -30.0, 5.0]], (20000, 1))

    def beyond(values: dict) -> float:
        error = errors(values, still)
        return float((np.abs(error) > 4.0 * error.std()).mean())

    assert beyond({"white_mm": 0.005}) < 3e-4 < 2e-3 < beyond({"white_mm": 0.005, "heavy_dof": 3.0})
    digits = (errors({"white_mm": 0.005, "quantum_um": 10.0}, still) + still[0]) / 0.010
    np.testing.assert_allclose(digits, np.round(digits), atol=1e-6)
    assert len(np.unique(np.round(digits[:, 0]))) > 3


def test_range_and_direction_of_the_beam() -> None:
    station = np.array([0.0, -1000.0, 0.0])
    values = {"station_mm": station.tolist(), "radial_um": 0.5, "sideways_um_per_m": 6.0}
    for distance in (500.0, 1000.0, 2000.0):
        error = errors(values, np.tile(station + np.array([0.0, distance, 0.0]), (20000, 1)))
        assert 1e3 * error[:, 1].std() == pytest.approx(0.5, rel=0.03)
        assert 1e3 * error[:, [0, 2]].std() == pytest.approx(6.0 * distance / 1000.0, rel=0.03)


def test_axes_wander_and_outliers() -> None:
    still = np.zeros((20000, 3))
    error = errors({"white_mm": 0.001, "axis_um": [2.0, 6.0, 12.0]}, still)
    np.testing.assert_allclose(1e3 * error.std(0), np.hypot([2.0, 6.0, 12.0], 1.0), rtol=0.03)
    slow = errors({"white_mm": 0.0, "wander_um": 5.0, "wander_s": 100.0}, still, step=50.0)
    alike = (slow[1:] * slow[:-1]).mean() / np.square(slow).mean()
    assert alike == pytest.approx(np.exp(-0.5), abs=0.03)
    tracker = Tracker.model_validate(draw_noise("outliers", 4) | {"missing_share": 0.0})
    reading = read_points(tracker, still, np.arange(2e4), np.zeros(20000, dtype=int), seed=0, setup_seed=0, noise=True)
    assert reading.outlier.mean() == pytest.approx(tracker.outlier_share, rel=0.1)
    gross = np.linalg.norm(reading.measured[reading.outlier], axis=1)
    assert np.median(gross) > tracker.outlier_mm


def test_what_the_leaflet_says_is_what_one_coordinate_scatters_by() -> None:
    still = np.tile([[3000.0, 0.0, 300.0]], (20000, 1))
    for values in (
        {"white_mm": 0.004},
        {"white_mm": 0.006, "quantum_um": 10.0},
        {"axis_um": [2.0, 6.0, 12.0], "white_mm": 0.001},
        {"radial_um": 0.5, "sideways_um_per_m": 2.0},
    ):
        error = errors({**values, "station_mm": [0.0, 0.0, 300.0]}, still)
        assert stated_sigma(values, 3000.0) == pytest.approx(np.sqrt(np.square(error).mean()), rel=0.03)


@pytest.mark.parametrize("kind", ("white", "heavy", "range", "anisotropic", "quantised", "axes"))
def test_what_a_file_states_is_the_scatter_from_where_the_tracker_stands(kind: str) -> None:
    """Within the quarter by which a leaflet is off: what is stated for another place is no figure of this one."""
    told = 0
    for seed in range(12):
        drawn = draw_foreign(seed, noise=kind)
        sigma = drawn.rig.machine.tracker.sigma_mm
        if sigma is not None:
            told += 1
            poses = drawn.targets[list(TARGET)].dropna().to_numpy(float)
            assert 0.75 < sigma / (reading_noise(drawn.rig, poses).total / np.sqrt(3.0)) < 1.35
    assert told > 3


@pytest.mark.parametrize("seed", range(6))
def test_steep_machines_lean_far_or_lie_flat_and_have_room(seed: int) -> None:
    steep, plain = (draw_machine_file(seed, steep=steep) for steep in (True, False))
    leans = np.abs(steep.file.machine.slider_lean_deg)
    assert (leans > 7.0).all() and leans.max() >= 15.0 and np.abs(plain.file.machine.slider_lean_deg).max() <= 12.0
    assert steep.half_size.min() > 0.05 * steep.file.machine.link_length_mm
