"""Set-up mistakes are named with a proof and undone; sound set-ups are left alone."""

import re
from pathlib import Path

import numpy as np
import pytest
from setup_mistakes import agreement, try_case
from setup_mistakes_cases import CASES
from setup_mistakes_runs import draw_run

from ptt.machine import MachineFile, load_machine, parse_machine
from ptt.run.reading import read_table
from ptt.run.table import Table, take_rows
from ptt.setup import MISTAKES, check_setup

DATA = Path(__file__).parent.parent / "data" / "sealed_one"


@pytest.mark.parametrize("seed", [0, pytest.param(6, marks=pytest.mark.long)])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)
def test_every_mistake_is_named_and_cured_on_foreign_machines(case: object, seed: int) -> None:
    """A drawn machine, run with everything; the benchmark does it on twenty and with fewer columns."""
    have = case.have[0]  # type: ignore[attr-defined]
    tried = try_case(case, have, seed)  # type: ignore[arg-type]
    assert tried.shows
    assert tried.named, str(tried.found)
    assert tried.cured, str(tried.found)


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(4, 12))])
def test_sound_set_ups_with_faults_are_not_accused(seed: int) -> None:
    file, table = draw_run(20_000 + seed, faults=seed % 4, rows=None if seed % 2 else 20)
    for have in (table, table.replace(target=np.full_like(table.target, np.nan)), table.replace(command=None)):
        assert check_setup(file, have).findings == ()


def test_the_sample_runs_are_sound(sound: tuple[MachineFile, Table]) -> None:
    assert check_setup(*sound).findings == ()
    root = DATA.parent
    for run, machine in (("experiment1.csv", "machine.toml"), ("volume.csv", "machine.toml")):
        assert check_setup(load_machine(root / machine), read_table(root / run)).findings == ()


def test_what_is_the_same_thing_is_said_as_one(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, table.replace(measured=table.measured * [1.0, 1.0, -1.0]))
    (only,) = found.findings
    assert only.mistake == "axis-sign"
    assert "z negated" in only.words
    assert "swapped" in only.words
    assert only.before_um is not None and only.after_um is not None
    assert only.before_um > 1000.0 * only.after_um


def test_a_blunder_of_the_drawing_is_cured_in_its_text() -> None:
    text = (
        '[machine] # ours\nkind = "three-ptt"\nbase_radius_mm = 100\nplatform_radius_mm = 200\nlink_length_mm = 300\n'
    )
    drawing = parse_machine(text + "slider_travel_mm = [150, 420]\n")
    run = read_table(DATA / "run.csv")
    found = check_setup(drawing, run)
    assert [item.mistake for item in found.findings] == ["radii-interchanged"]
    assert "# ours" in found.file.text
    assert parse_machine(found.file.text).machine.base_radius_mm == 200.0  # type: ignore[union-attr]


def test_compensated_commands_are_no_mistake(sound: tuple[MachineFile, Table]) -> None:
    """Commands that a compensation moved by up to a millimetre lie beside the targets' own."""
    file, table = sound
    assert table.command is not None
    away = np.sin(table.target / 20.0)
    assert check_setup(file, table.replace(command=table.command + away)).findings == ()


def test_two_mistakes_are_both_named(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    assert table.command is not None
    broken = table.replace(
        measured=table.measured / 25.4, command=table.command[:, [1, 0, 2]], temp_c=table.temp_c + 273.15
    )
    found = check_setup(file, broken)
    assert {item.mistake for item in found.sure} == {"unit-scale", "slider-order", "temperature-unit"}
    assert found.table is not None
    assert (agreement(found.file, found.table) < 1.5 * agreement(file, table)).all()


def test_names_are_those_of_the_docs_and_the_benchmark_knows_no_others() -> None:
    page = (DATA.parents[1] / "docs" / "setup.md").read_text()
    table = page.split("## Names")[1].split("## Measured")[0]
    cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert sorted(re.findall(r"`([a-z-]+)`", " ".join(cells))) == sorted(MISTAKES)
    assert {name for case in CASES for name in case.names} <= set(MISTAKES)


@pytest.mark.parametrize("rows", [3, 60])
def test_too_little_to_judge_is_said(sound: tuple[MachineFile, Table], rows: int) -> None:
    """Three poses, or sixty readings of one: nothing was judged, and nothing is said to hold together."""
    file, table = sound
    few = take_rows(table, np.arange(3) if rows == 3 else np.zeros(rows, dtype=int))
    found = check_setup(file, few)
    assert found.ok and "too little to judge" in str(found)
    assert found.to_dict()["too_little"] == f"{1 if rows == 60 else 3} different pose{'' if rows == 60 else 's'} " + (
        "with a reading, but 5 are needed"
    )
    assert check_setup(file, table).to_dict()["too_little"] is None


def test_a_small_path_shows_its_mistake_by_a_steep_fall() -> None:
    """The machine stands on its other side, the path is 36 mm high: 1.6 mm, and 4 um with the sliders above."""
    case = next(case for case in CASES if case.title == "sliders on the wrong side")
    tried = try_case(case, "sliders", 5005)
    assert tried.named and tried.cured, str(tried.found)


def test_without_readings_only_what_is_asked_holds_together(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    said = str(check_setup(file, table.replace(measured=np.full((table.rows, 3), np.nan))))
    assert said == f"no mistakes found in targets and commands; there are no readings ({table.rows} rows)"


def test_what_nothing_explains_does_not_hold_together(sound: tuple[MachineFile, Table]) -> None:
    """The readings of some other run: no known mistake, and no word of a set-up that holds."""
    file, table = sound
    other = np.random.default_rng(4).uniform(-80.0, 80.0, table.measured.shape)
    found = check_setup(file, table.replace(measured=other))
    assert found.ok and "no machine is built that far off" in str(found)
    assert "no mistakes found" not in str(found)
    assert check_setup(file, table).to_dict()["unexplained"] is None


def test_a_column_of_readings_that_stands_still_is_named_in_what_nothing_explains(sound) -> None:
    file, table = sound
    still = table.measured * [0.0, 1.0, 1.0] + [12.0, 0.0, 0.0]
    assert "x_meas is 12 in every row" in check_setup(file, table.replace(measured=still)).unexplained


def test_readings_that_are_far_off_in_a_part_of_the_run_alone_are_said() -> None:
    """Two sliders change places for a third of a run: the others agree, and hide it from any mean. Rows are lines."""
    file, table = draw_run(2, rows=90)
    assert table.command is not None
    row = np.arange(table.rows)
    there = (row >= 40) & (row < 70)
    other = np.where(there[:, None], table.command[:, [1, 0, 2]], table.command)
    found = check_setup(file, table.replace(target=np.full_like(table.target, np.nan), command=other))
    assert not found.findings and "between rows 42 and 71, are off the commands" in str(found)
    few = np.where((row < 3)[:, None], table.measured + 20.0, table.measured)  # gross errors
    assert check_setup(file, table.replace(measured=few)).to_dict()["unexplained"] is None


def test_poses_that_match_in_two_ways_are_named_and_left_alone() -> None:
    """A cube of poses looks the same from four sides: the order is wrong, and no reading can tell which is right."""
    file, table = draw_run(2, rows=100)
    grid = np.stack(np.meshgrid(*[np.linspace(-30.0, 30.0, 3)] * 3), axis=-1).reshape(-1, 3)
    cube = take_rows(table, np.arange(len(grid))).replace(target=grid, command=None, std=None)
    mixed = cube.replace(measured=np.random.default_rng(1).permutation(grid) + 500.0)
    found = check_setup(file, mixed)
    assert [item.mistake for item in found.sure] == [
        "row-order"
    ] and "several pairings match equally well" in found.sure[0].words
    np.testing.assert_array_equal(found.table.measured, mixed.measured)  # type: ignore[union-attr]
