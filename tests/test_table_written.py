"""Runs side by side, in order, and written: whole or not at all, without loss."""

import os
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from test_table import HEADER, ROWS, csv, write

from ptt.errors import InputError, TableError
from ptt.run.readers.scale import scale_hint
from ptt.run.reading import read_table
from ptt.run.table import Table, concat_tables, make_table
from ptt.run.written import write_table


def test_also_keeps_runs_apart(tmp_path: Path) -> None:
    first = write(tmp_path, csv(ROWS[0] + ",a", ROWS[1] + ",b", header=HEADER + ",run"), "first.csv")
    second = write(tmp_path, csv(*ROWS, header=HEADER), "second.csv")
    third = write(tmp_path, csv(*ROWS[::-1], header=HEADER), "third.csv")
    table = read_table(first, also=[second, third])
    assert table.rows == 8
    assert table.run.tolist() == [0, 1, 2, 2, 2, 3, 3, 3]
    assert table.run_label == (f"{first}:a", f"{first}:b", str(second), str(third))
    assert table.place(3, "x_meas") == f"{second} row 3, column x_meas"
    again = tmp_path / "again.csv"
    write_table(table, again)
    assert read_table(again).run.tolist() == table.run.tolist()


@pytest.mark.parametrize("twin", [csv(*ROWS), "# the same once more\n" + csv(*ROWS)], ids=["copy", "same rows"])
def test_a_run_that_is_there_twice_is_said_by_name(tmp_path: Path, twin: str) -> None:
    first, second = write(tmp_path, csv(*ROWS), "first.csv"), write(tmp_path, twin, "second.csv")
    both = read_table(first, also=[second])
    assert both.rows == 2 * len(ROWS)
    (told,) = [line for line in both.understood.lines if "holds the same rows as" in line]
    assert told.startswith(f"warning: {second} holds the same rows as {first}")
    later = write(tmp_path, csv(*ROWS[:-1]), "later.csv")
    assert not any("the same rows" in line for line in read_table(first, also=[later]).understood.lines)


def test_concat_fills_and_refuses() -> None:
    plain = make_table(np.eye(3), measured=np.eye(3))
    loaded = make_table(np.eye(3), measured=np.eye(3), payload_kg=2.0)
    assert_array_equal(concat_tables([plain, loaded]).payload_kg, [np.nan] * 3 + [2.0] * 3)
    assert concat_tables([plain]) is plain
    other = plain.replace(source="other", run_label=("a",))
    nested = concat_tables([concat_tables([plain, other]), plain])
    assert nested.run_label == concat_tables([plain, other, plain]).run_label == ("table", "other:a", "table#2")
    assert nested.run.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    with pytest.raises(TableError, match="no joint commands while the other files have them"):
        concat_tables([plain, make_table(np.eye(3), command=np.eye(3))])
    with pytest.raises(TableError, match="another machine"):
        concat_tables([make_table(np.eye(3), command=np.eye(3)), make_table(np.eye(3), command=np.ones((3, 6)))])


def test_make_table_defaults() -> None:
    table = make_table(np.zeros((4, 3)), time_s=1.0, name=np.array(["a", "b", "c", "d"]))
    assert table.rows == 4
    assert table.role.tolist() == ["pose"] * 4
    assert not table.observed.any()
    assert_array_equal(table.time_s, np.ones(4))
    assert make_table(None, command=np.zeros((2, 6))).joints == 6
    changed = table.replace(source="other")
    assert isinstance(changed, Table)
    assert (changed.source, table.source) == ("other", "table")
    assert make_table(np.zeros((3, 3)), run=np.array([0, 2, 2])).run_label == ("0", "1", "2")


def test_write_is_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, "before\n")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fail)
        with pytest.raises(InputError, match="disk full"):
            write_table(make_table(np.eye(3)), path)
    assert path.read_text(encoding="utf-8") == "before\n"
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.csv"]
    with pytest.raises(InputError, match="cannot be written"):
        write_table(make_table(np.eye(3)), path / "run.csv")
    write_table(make_table(np.eye(3), measured=np.eye(3)), tmp_path / "new" / "run.csv")
    assert read_table(tmp_path / "new" / "run.csv").rows == 3
    with pytest.raises(TableError, match="line break in"):
        write_table(make_table(np.eye(3), name=np.array(["a", "b\nc", "d"])), path)


FLOATS = st.floats(-1e6, 1e6)  # what no machine can mean is refused
NAMES = st.text(st.characters(exclude_categories=("C", "Z")), max_size=6)


@settings(max_examples=60, deadline=None)
@given(data=st.data(), n=st.integers(2, 6), joints=st.sampled_from([0, 3, 6]))
def test_round_trip_is_lossless(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, n: int, joints: int
) -> None:
    def block(width: int, elements: st.SearchStrategy[float] = FLOATS) -> np.ndarray:
        return np.array(data.draw(st.lists(elements, min_size=n * width, max_size=n * width))).reshape(n, width)

    gaps = st.one_of(st.just(np.nan), FLOATS)
    table = make_table(
        block(3),
        command=block(joints) if joints else None,
        measured=block(3, gaps),
        name=np.array(data.draw(st.lists(NAMES, min_size=n, max_size=n))),
        time_s=np.arange(n) + block(1)[0, 0] * 1e-300,
        temp_c=block(1, st.one_of(st.just(np.nan), st.floats(-273.0, 1e6)))[:, 0],
        repeat=np.arange(n, dtype=float),
        joint_prefix="q" if joints == 6 else "b",
    )
    table.measured[0] = table.target[0]
    assume(scale_hint(table.target, table.measured) is None)  # spreads a thousand times apart are refused
    path = tmp_path_factory.mktemp("trip") / "run.csv"
    write_table(table, path)
    again = read_table(path, joints=joints or 3, joint_prefix=table.joint_prefix)
    for name in ("target", "measured", "command", "name", "role", "run", "repeat", "time_s", "line"):
        assert_array_equal(getattr(again, name), getattr(table, name), err_msg=name)
    if not np.isnan(table.temp_c).all():
        assert_array_equal(again.temp_c, table.temp_c)


@pytest.mark.long
def test_a_million_rows_take_no_longer_for_a_row_than_fifty_thousand(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    line = [",".join(map(repr, row)) for row in random.normal(size=(1000, 9)).round(6).tolist()]
    head = "x_cmd,y_cmd,z_cmd,b1_cmd,b2_cmd,b3_cmd,x_meas,y_meas,z_meas,time_s"
    took = []
    for rows in (50_000, 1_000_000):
        body = "\n".join(f"{line[i % 1000]},{i}" for i in range(rows))
        path = write(tmp_path, f"{head}\n{body}\n")
        start = time.process_time()
        assert read_table(path).rows == rows
        took.append((time.process_time() - start) / rows)
    assert took[1] < 2.0 * took[0]  # what a first file loads, and what memory costs, are in there
