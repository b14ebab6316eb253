"""Lengths, angles, times and noise in another unit are named and turned."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from setup_mistakes import try_case
from setup_mistakes_cases import CASES
from setup_mistakes_runs import draw_run

from ptt.machine import MachineFile, load_machine
from ptt.run.reading import read_table
from ptt.run.table import Table, make_table, take_rows
from ptt.setup import check_setup
from ptt.setup.candidates import slider_formulas


def test_sixty_readings_of_one_pose_are_no_unit_mistake(sound: tuple[MachineFile, Table]) -> None:
    random = np.random.default_rng(3)
    pose = np.tile([10.0, 20.0, -5.0], (60, 1))
    table = make_table(pose, None, pose + random.normal(0.0, 0.004, (60, 3)))
    assert check_setup(sound[0], table).findings == ()


def test_readings_a_constant_aside_are_no_two_units_at_once(sound: tuple[MachineFile, Table]) -> None:
    """Shrunk a hundredfold, what is off by two centimetres would be a matter of ordinary faults."""
    file, table = sound
    trusted = replace(file, tracker=file.tracker.model_copy(update={"frame": "trusted"}))
    moved = replace(table, measured=table.target + np.array([-15.5, 6.6, 8.5]), command=None)
    found = check_setup(trusted, moved)
    assert [finding.mistake for finding in found.findings] == ["target-frame"]


def test_a_length_that_the_controller_has_is_named_by_its_digits() -> None:
    """25 mm more on the links moves the targets of a small path by 0.4 mm against the commands, but exactly."""
    case = next(case for case in CASES if case.title == "a length off by 20 to 50 mm")
    tried = try_case(case, "both", 5002)
    assert tried.named and tried.cured, str(tried.found)
    assert "targets and commands differ by 424 um" in tried.found.findings[0].words


def test_time_in_ms_shows_beside_the_feed(sound: tuple[MachineFile, Table]) -> None:
    """Rows that take a thousand times as long as their way at the feed, whatever the feed: nobody waits like that."""
    file, table = sound
    feed = np.where(np.arange(table.rows) % 3 == 0, 8.0, 40.0)
    way = np.linalg.norm(np.diff(table.target, axis=0, prepend=table.target[:1]), axis=1)
    seconds = np.cumsum(np.nan_to_num(way) / feed + 1e-3)
    timed = table.replace(feed_mm_s=feed, time_s=1e3 * seconds)
    assert [item.mistake for item in check_setup(file, timed).sure] == ["time-unit"]
    for sound_clock in (seconds, 100.0 * np.arange(table.rows), seconds + 100.0 * np.arange(table.rows)):
        assert check_setup(file, table.replace(feed_mm_s=feed, time_s=sound_clock)).findings == ()


@pytest.mark.parametrize(
    ("title", "stamps", "mistakes"),
    [
        ("time", [f"2026-03-{2 + row // 24:02d} {row % 24:02d}:00:00" for row in range(120)], []),
        ("time_h", [f"{row}" for row in range(120)], []),
        ("time_min", [f"{60 * row}" for row in range(120)], []),
        ("time_s", [f"{3600 * row}" for row in range(120)], ["time-unit"]),
        ("time", [f"{3600 * row}" for row in range(120)], ["time-unit"]),
    ],
)
def test_a_reading_an_hour_is_no_clock_in_ms_where_the_file_says_so(
    tmp_path: Path, title: str, stamps: list[str], mistakes: list[str]
) -> None:
    """Five days of dated readings were refused, and `rename the column time_ms` advised."""
    data = Path(__file__).resolve().parents[1] / "data" / "sealed_three"
    frame = pd.read_csv(data / "run.csv").head(120).drop(columns="time_s").assign(**{title: stamps})
    frame.to_csv(tmp_path / "run.csv", index=False)
    found = check_setup(load_machine(data / "machine.toml"), read_table(tmp_path / "run.csv"))
    assert [item.mistake for item in found.findings] == mistakes


def test_targets_in_metres_are_no_mistake_of_the_clock() -> None:
    case = next(case for case in CASES if case.title == "targets in metres")
    tried = try_case(case, "targets", 6000)
    assert [item.mistake for item in tried.found.findings] == ["unit-scale"]


@pytest.mark.parametrize("factor", [25.4, 1e3])
def test_a_run_in_one_wrong_unit_agrees_with_itself_and_not_with_the_travel(
    sound: tuple[MachineFile, Table], factor: float
) -> None:
    file, table = sound
    assert table.command is not None
    small = table.replace(
        target=table.target / factor, command=table.command / factor, measured=table.measured / factor
    )
    (only,) = check_setup(file, small).findings
    assert only.mistake == "unit-scale"
    assert "every length of the run" in only.words and "travel" in only.words
    assert only.words.endswith(" all are within it"), "and not 'all but 5%'"


def test_sliders_out_of_travel_are_not_taken_as_micrometres(sound: tuple[MachineFile, Table]) -> None:
    """Counted downward from 900 mm they lie beyond a travel that has zero in it, and a thousandth of them within."""
    file, table = sound
    assert table.command is not None
    spec = file.machine.model_copy(update={"slider_travel_mm": ((-420.0, 420.0),) * 3})
    found = check_setup(replace(file, machine=spec), table.replace(command=900.0 - table.command))
    assert [item.mistake for item in found.sure] == ["slider-sign"]
    assert found.sure[0].fix == "write b1_cmd = 900 - b1_cmd, b2_cmd = 900 - b2_cmd, b3_cmd = 900 - b3_cmd"


@pytest.mark.parametrize("away", [(0.0, 0.0, 400.0), (700.0, 0.0, 0.0)])
def test_targets_far_away_are_not_taken_as_micrometres(
    sound: tuple[MachineFile, Table], away: tuple[float, ...]
) -> None:
    """A work offset too much: a thousandth of them lies in reach, in one speck that no machine is bought for."""
    file, table = sound
    far = make_table(table.target + np.array(away))
    assert check_setup(file, far).findings == ()
    metres = make_table(1e3 * table.target)
    assert [finding.mistake for finding in check_setup(file, metres).sure] == ["unit-scale"]


def test_a_machine_file_in_metres_is_not_cured_by_a_smaller_run(sound: tuple[MachineFile, Table]) -> None:
    """A tripod of half a millimetre is none: the drawing is in another unit, and not every length of the run."""
    file, table = sound
    names = ("base_radius_mm", "platform_radius_mm", "link_length_mm")
    metres = {name: 1e-3 * getattr(file.machine, name) for name in names}
    travel = tuple((1e-3 * low, 1e-3 * high) for low, high in file.machine.travel_ends)
    small = replace(file, machine=file.machine.model_copy(update={**metres, "slider_travel_mm": travel}))
    found = check_setup(small, table)
    assert [finding.mistake for finding in found.sure] == ["unit-scale"]
    assert "the machine file's lengths taken as metres" in found.sure[0].words
    assert found.file.machine.link_length_mm == pytest.approx(file.machine.link_length_mm)
    np.testing.assert_allclose(found.file.machine.travel_ends, file.machine.travel_ends)


def test_azimuths_in_radians(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    spec = file.machine.model_copy(update={"slider_azimuth_deg": (0.0, 2.0943951, 4.1887902)})
    (only,) = check_setup(replace(file, machine=spec), table).findings
    assert only.mistake == "angle-unit" and "[0.0, 120.0, 240.0]" in only.fix


@pytest.mark.parametrize("stated", ["sigma_mm", "std"])
def test_noise_in_um_shows_without_repeats(stated: str) -> None:
    file, table = draw_run(20_003, faults=1, rows=60)
    once = np.unique(np.round(table.target, 6), axis=0, return_index=True)[1]
    table = take_rows(table, np.sort(once))
    sigma = {"sigma_mm": 4.0} if stated == "sigma_mm" else {}
    file = replace(file, tracker=file.tracker.model_copy(update=sigma))
    table = table if sigma else table.replace(std=np.full((table.rows, 3), 4.0))
    found = check_setup(file, table)
    assert [item.mistake for item in found.findings] == ["noise-implausible"] and not found.ok
    cured = found.file.tracker.sigma_mm if sigma else float(found.table.std[0, 0])
    assert cured == pytest.approx(0.004)
    fair = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.15}))
    assert check_setup(fair, table.replace(std=None)).ok


def test_std_columns_of_zeros_are_said_to_say_nothing(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, table.replace(std=np.zeros((table.rows, 3))))
    (said,) = found.findings
    assert said.mistake == "noise-implausible" and "treated as not stated" in said.words and found.ok


def test_interchanged_sliders_are_swapped_and_others_are_written_by_the_old_values():
    """'b1 = b2, b2 = b1' one after the other would make both alike."""
    heights = np.random.default_rng(0).normal(size=(9, 3))
    assert slider_formulas(heights, heights[:, [1, 0, 2]]) == "swap b1_cmd and b2_cmd"
    turned = slider_formulas(heights, heights[:, [1, 2, 0]])
    assert turned == "write all at once, by the old values, b1_cmd = b2_cmd, b2_cmd = b3_cmd, b3_cmd = b1_cmd"
    assert slider_formulas(heights, heights) == ""
