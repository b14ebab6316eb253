"""Readings that lie beside other rows than their own are named and moved back."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from setup_mistakes import agreement, try_case
from setup_mistakes_cases import CASES
from setup_mistakes_runs import draw_run

import ptt
from ptt.errors import WorkspaceError
from ptt.machine import MachineFile
from ptt.run.table import Table, take_rows
from ptt.setup import check_setup

SEALED = Path(__file__).parents[1] / "data" / "sealed_one"


@pytest.mark.parametrize("missed", [40, 121, 122, 200])
def test_the_reading_that_was_missed_is_the_one_left_empty(sound: tuple[MachineFile, Table], missed: int) -> None:
    file, table = sound
    early = np.vstack([np.delete(table.measured, missed, axis=0), table.measured[-1:]])[:-1]
    rows = take_rows(table, np.arange(table.rows - 1))
    found = check_setup(file, rows.replace(measured=early))
    assert [item.mistake for item in found.findings] == ["row-shift"]
    assert f"from row {table.line[missed]} on" in found.findings[0].words
    true = table.measured[:-1].copy()
    true[missed] = np.nan
    assert found.table is not None
    np.testing.assert_array_equal(found.table.measured, true)


def test_sliders_on_a_small_path_are_no_row_shift() -> None:
    """A row less brings the error from 1,044 to 205 um there, the sliders' true order to 153."""
    case = next(case for case in CASES if case.title == "sliders numbered the other way")
    tried = try_case(case, "sliders", 5003)
    assert [item.mistake for item in tried.found.findings] in ([], ["slider-order"])


def test_a_row_at_which_the_links_do_not_meet_is_told_by_check_as_by_every_other_verb(tmp_path: Path) -> None:
    frame = pd.read_csv(SEALED / "run.csv")
    frame.loc[50, "b1_cmd"] += 900.0
    frame.to_csv(tmp_path / "run.csv", index=False)
    machine = ptt.load(SEALED / "machine.toml")
    for rows in (tmp_path / "run.csv", frame):
        with pytest.raises(WorkspaceError, match=r"row 52, columns b1_cmd, .*do not meet .* \(1 of 296 rows\)"):
            ptt.check(machine, rows)


def slips(sound: tuple[MachineFile, Table], *missed: int) -> np.ndarray:
    """Readings of which some were missed, those after each moved up."""
    kept = np.delete(sound[1].measured, missed, axis=0)
    return np.vstack([kept, np.full((len(missed), 3), np.nan)])


def test_two_readings_missed_are_found_both(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, table.replace(measured=slips(sound, 70, 211)))
    assert {item.mistake for item in found.sure} == {"row-shift"}
    assert found.table is not None
    true = table.measured.copy()
    true[[70, 211]] = np.nan
    np.testing.assert_array_equal(found.table.measured, true)


@pytest.mark.parametrize("factor", [1.0, 1.0 / 25.4])
def test_a_missed_reading_in_a_left_handed_frame(sound: tuple[MachineFile, Table], factor: float) -> None:
    """Neither shows without the other; in inches on top there are three mistakes."""
    file, table = sound
    found = check_setup(file, table.replace(measured=factor * slips(sound, 122) * [1.0, 1.0, -1.0]))
    assert {item.mistake for item in found.sure} == {"row-shift", "axis-sign"} | (
        {"unit-scale"} if factor < 1 else set()
    )
    assert found.table is not None
    cured = agreement(found.file, found.table)
    assert (cured < 1.5 * agreement(file, table) + 1e-3).all()


def test_readings_from_the_last_row_to_the_first() -> None:
    file, table = draw_run(9003, rows=60)
    (only,) = check_setup(file, table.replace(measured=table.measured[::-1])).findings
    assert only.mistake == "row-order" and "in reverse order" in only.words


def test_readings_of_every_second_row_may_be_late(sound: tuple[MachineFile, Table]) -> None:
    """Moved back, they stand in rows that had none before: no row tells both errors."""
    file, table = sound
    every = np.where(np.arange(table.rows)[:, None] % 2 == 0, table.measured, np.nan)
    found = check_setup(file, table.replace(measured=np.roll(every, 1, axis=0)))
    assert [item.mistake for item in found.sure] == ["row-shift"]
    assert "late from the first row on" in found.sure[0].words


def test_targets_out_of_reach_are_named_by_the_titles_of_their_own_file(tmp_path: Path) -> None:
    frame = pd.read_csv(SEALED / "run.csv").drop(columns=["b1_cmd", "b2_cmd", "b3_cmd"], errors="ignore")
    frame.to_csv(tmp_path / "near.csv", index=False)
    frame.loc[[40, 44, 60], "x_cmd"] = 500.0
    frame.rename(columns={"x_cmd": "X cmd [mm]"}).to_csv(tmp_path / "far.csv", index=False)
    machine = ptt.load(SEALED / "machine.toml")
    told = r"far\.csv row 42, columns X cmd \[mm\], y_cmd, z_cmd: no joint .* \(3 of 296 rows, also rows 46, 62\)"
    with pytest.raises(WorkspaceError, match=told) as refused:
        ptt.compare(machine, tmp_path / "far.csv")
    assert refused.value.exit_code == 3 and refused.value.rows == (40, 44, 60)
    frame.to_csv(tmp_path / "far.csv", index=False)
    with pytest.raises(
        WorkspaceError, match=r"far\.csv:run 1 row 42, columns x_cmd"
    ):  # of two files, the one that it is in
        ptt.compare(machine, ptt.read(tmp_path / "near.csv", machine, also=[tmp_path / "far.csv"]))
