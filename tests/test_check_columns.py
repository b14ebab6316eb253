"""Directions and values that cannot be are named by their rows."""

import numpy as np
import pytest

from ptt.machine import MachineFile
from ptt.run.table import Table
from ptt.setup import check_setup


def directions(table: Table, sign: float) -> Table:
    """The run with the direction of each move stated, or the opposite of it; unknown in its first row."""
    assert table.command is not None
    moved = np.diff(table.command, axis=0, prepend=np.nan)
    return table.replace(direction=np.where(np.abs(moved) > 1e-6, sign * np.sign(moved), np.nan))


def test_directions_opposite_to_the_moves_are_named_and_turned_round(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, directions(table, -1.0))
    assert [item.mistake for item in found.sure] == ["direction-sign"] and "dir1, dir2, dir3" in found.sure[0].fix
    assert found.table is not None
    np.testing.assert_array_equal(found.table.direction, directions(table, 1.0).direction)
    one = directions(table, 1.0)
    assert one.direction is not None
    found = check_setup(file, one.replace(direction=one.direction * [1.0, -1.0, 1.0]))
    assert "write dir2 with" in found.sure[0].fix


def test_directions_are_surely_wrong_only_where_play_shows_it(sound: tuple[MachineFile, Table]) -> None:
    """A machine without play that overtravels in every move is stated alike."""
    file, table = sound
    noise = np.random.default_rng(1).normal(0.0, 0.003, table.target.shape)
    found = check_setup(file, directions(table, -1.0).replace(measured=table.target + noise))
    assert [(item.mistake, item.sure) for item in found.findings] == [("direction-sign", False)]


def test_directions_of_joints_that_overtravel_are_not_accused(sound: tuple[MachineFile, Table]) -> None:
    """Stated as the moves go, from one side always, or opposite where the play of the readings says the same."""
    file, table = sound
    always = table.replace(direction=np.ones((table.rows, 3)))
    beyond = directions(table, -1.0).replace(measured=2.0 * table.target - table.measured)
    for run in (directions(table, 1.0), always, beyond):
        assert check_setup(file, run).findings == ()


@pytest.mark.parametrize("title", ["temp_c", "payload_kg", "feed_mm_s"])
@pytest.mark.parametrize("rows", [[9], [9, 41, 42]])
def test_values_that_cannot_be_are_named_by_their_rows(
    sound: tuple[MachineFile, Table], title: str, rows: list[int]
) -> None:
    file, table = sound
    values = np.full(table.rows, 20.0)
    values[rows] = 1e5
    found = check_setup(file, table.replace(**{title: values}))
    assert [item.mistake for item in found.sure] == ["stray-value"] == [item.mistake for item in found.findings]
    lines = ", ".join(str(table.line[row]) for row in rows)
    assert f"{title} is 100,000" in found.sure[0].words and f"row{'s' * (len(rows) > 1)} {lines}, and 20" in str(found)
    assert found.table is not None and np.isnan(getattr(found.table, title)[rows]).all()


def test_a_column_that_is_hot_or_heavy_throughout_or_grows_so_has_no_stray_values(
    sound: tuple[MachineFile, Table],
) -> None:
    file, table = sound
    warming = table.replace(temp_c=np.linspace(20.0, 101.0, table.rows))
    assert "stray-value" not in str(check_setup(file, warming))
    grams = table.replace(payload_kg=np.where(np.arange(table.rows) % 3 == 0, 2500.0, 0.0))
    assert [item.mistake for item in check_setup(file, grams).findings] == ["payload-unit"]


@pytest.mark.parametrize(
    ("loads", "told"),
    [
        ((24.516625, 49.03325), "sure"),  # 2.5 and 5 kg
        ((24.52, 49.03), "sure"),
        ((4.9, 9.8), "perhaps"),  # half a kilogram and one, but one load in fifty of one decimal would be so
        ((4.9, 9.7), ""),
        ((4.93, 9.8), ""),  # 0.503 kg is not round where hundredths are written
        ((5.0, 9.5), ""),
    ],
)
def test_loads_are_called_newtons_where_they_are_round_weights_to_their_last_digit(
    sound: tuple[MachineFile, Table], loads: tuple[float, float], told: str
) -> None:
    file, table = sound
    found = check_setup(file, table.replace(payload_kg=np.resize([0.0, *loads], table.rows)))
    own = [item for item in found.findings if item.mistake == "payload-unit"]
    assert [item.sure for item in own] == {"sure": [True], "perhaps": [False], "": []}[told]


def test_a_target_far_from_its_own_commands_is_named(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    target = table.target.copy()
    target[20] = 5000.0, 0.0, 0.0
    found = check_setup(file, table.replace(target=target))
    assert [item.mistake for item in found.findings] == ["stray-value"] and found.sure
    assert f"the target of row {table.line[20]} lies" in found.sure[0].words
    np.testing.assert_allclose(found.table.target, table.target, atol=1e-3)  # type: ignore[union-attr]
