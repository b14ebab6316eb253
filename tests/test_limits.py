"""Where the limits of docs/promises.md lie: what is just within is read, what is just beyond is refused by its name."""

from pathlib import Path

import pytest

from ptt.documents import parse_json, parse_toml
from ptt.errors import InputError, TableError
from ptt.files import read_text
from ptt.run.reading import read_table

HEAD = "x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas"
ROWS = ("1,2,3,1.1,2,3", "2,2,3,2.1,2,3", "3,2,3,3.1,2,3")
GREATEST = {
    "x_meas": 1e9, "time_s": 1e20, "payload_kg": 1e9, "temp_c": 1e6, "feed_mm_s": 1e12, "tau1": 1e12, "x_std": 1e9,
}  # fmt: skip


def put(place: Path, lines: list[str]) -> Path:
    path = place / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def with_column(title: str, last: str) -> list[str]:
    """A run whose last row has a value in a column more, or in one of its own."""
    if title in HEAD.split(","):
        cells = ROWS[2].split(",")
        cells[HEAD.split(",").index(title)] = last
        return [HEAD, *ROWS[:2], ",".join(cells)]
    others = {"time_s": ("0", "1")}.get(title, ("1", "1"))
    return [f"{HEAD},{title}", *(f"{row},{value}" for row, value in zip(ROWS, (*others, last), strict=True))]


@pytest.mark.parametrize("title", GREATEST)
def test_numbers_are_read_up_to_their_limit_and_refused_beyond(title: str, tmp_path: Path) -> None:
    joints = {"joints": 3} if title == "tau1" else {}
    read_table(put(tmp_path, with_column(title, repr(0.9 * GREATEST[title]))), **joints)
    with pytest.raises(TableError, match=rf"row 4, column {title}: .*beyond any machine"):
        read_table(put(tmp_path, with_column(title, repr(1.1 * GREATEST[title]))), **joints)


def test_angles_have_theirs(tmp_path: Path) -> None:
    head = "q1_cmd_rad,q2_cmd_rad,x_meas,y_meas,z_meas"
    for size, fits in ((0.9e9, True), (1.1e9, False)):
        path = put(tmp_path, [head, "0.1,0.2,1,2,3", "0.2,0.2,1,2,3", f"{size!r},0.2,1,2,3"])
        if fits:
            read_table(path, 2, joint_prefix="q")
        else:
            with pytest.raises(TableError, match=r"row 4, column q1_cmd_rad: .*beyond any machine"):
                read_table(path, 2, joint_prefix="q")


def test_numbers_of_a_machine_file_have_theirs() -> None:
    assert parse_toml("a = 0.9e12", "m.toml") == {"a": 0.9e12}
    with pytest.raises(InputError, match=r"m.toml key a: 1.1e\+12 is beyond any machine"):
        parse_toml("a = 1.1e12", "m.toml")
    assert parse_toml("[m]\na_mm = [1e6, 9_999_999]", "m.toml")["m"]["a_mm"][1] == 9_999_999
    for length in ("1.1e7", "11_000_000", "[0.0, -1e11]"):
        with pytest.raises(InputError, match=r"m.toml key m.a_mm.*is beyond any machine"):
            parse_toml(f"[m]\na_mm = {length}", "m.toml")


@pytest.mark.parametrize(("count", "fits"), [(1990, True), (2010, False)])
def test_columns_are_counted(count: int, fits: bool, tmp_path: Path) -> None:
    lines = [HEAD, *ROWS]
    more = [
        f"{line}{''.join(f',c{i}' if row == 0 else ',1' for i in range(count - 6))}" for row, line in enumerate(lines)
    ]
    if fits:
        assert read_table(put(tmp_path, more)).rows == 3
    else:
        with pytest.raises(TableError, match="2010 columns"):
            read_table(put(tmp_path, more))


@pytest.mark.parametrize(("length", "fits"), [(290, True), (310, False)])
def test_titles_are_measured(length: int, fits: bool, tmp_path: Path) -> None:
    lines = [f"{HEAD},{'n' * length}", *(f"{row},1" for row in ROWS)]
    if fits:
        assert read_table(put(tmp_path, lines)).rows == 3
    else:
        with pytest.raises(TableError, match="310"):
            read_table(put(tmp_path, lines))


@pytest.mark.parametrize(("length", "fits"), [(99_000, True), (101_000, False)])
def test_lines_are_measured(length: int, fits: bool, tmp_path: Path) -> None:
    lines = [f"{HEAD},name", *(f"{row},{'n' * length}" for row in ROWS)]
    if fits:
        assert read_table(put(tmp_path, lines)).rows == 3
    else:
        with pytest.raises(TableError, match=r"1010\d\d characters, more than 100000"):
            read_table(put(tmp_path, lines))


def test_files_are_weighed_before_they_are_read(tmp_path: Path) -> None:
    """Files with a hole in them: large by their length, nothing on the disk."""
    for name, size, read, said in (
        ("run.csv", 2 * 1024**3 + 1, read_table, "2147 MB, more than"),
        ("machine.toml", 64 * 1024**2 + 1, read_text, "67 MB, more than"),
    ):
        with (tmp_path / name).open("wb") as file:
            file.truncate(size)
        with pytest.raises(InputError, match=said):
            read(tmp_path / name)


def test_levels_are_counted_in_toml_and_json() -> None:
    deep = "[" * 70 + "]" * 70
    with pytest.raises(InputError, match="60 levels"):
        parse_toml("a = " + "[" * 70 + "1" + "]" * 70, "m.toml")
    with pytest.raises(InputError, match="levels"):
        parse_json(deep.replace("[]", "[1]"), "n.json")
    assert parse_json("[" * 50 + "1" + "]" * 50, "n.json")
