"""The store: nothing twice, nothing lost, whoever is killed and however many work at once."""

import json
import platform
import subprocess
import sys
from datetime import datetime
from functools import partial
from pathlib import Path

import duckdb
import numpy as np
import pytest
from command_line import invoke
from fleet_work import outcome

from ptt.commands.main import run
from ptt.errors import InputError
from ptt.files import sha256
from ptt.fleet.database import rows, transaction
from ptt.fleet.readings import read_columns, write_readings
from ptt.fleet.run import run_all
from ptt.fleet.store import add_machine, add_run, create_store, date_of, open_store, read_date
from ptt.run.from_columns import columns_to_table
from ptt.run.reading import read_table
from ptt.run.table import make_table
from ptt.run.written import table_to_frame, write_table

ROOT = Path(__file__).resolve().parents[1]
MACHINE = ROOT / "data" / "sealed_one" / "machine.toml"
fleet = partial(invoke, "fleet")
NASTY = 'mill "3"\'; DROP TABLE runs; -- <script>\n$x$ 机床'


def table(seed: int, rows: int = 20):
    random = np.random.default_rng(seed)
    target = random.uniform(-50.0, 50.0, (rows, 3))
    return make_table(
        target, target + 250.0, target + 1e-3 * random.normal(size=(rows, 3)), temp_c=random.normal(20.0, 1.0, rows),
        name=np.array([f"p,{i}" if i % 2 else "" for i in range(rows)]), run=np.arange(rows) // 12,
    )  # fmt: skip


def fill(folder: Path, machines: int = 2, runs: int = 3):
    store = create_store(folder)
    for machine in range(machines):
        name = f"m{machine}"
        add_machine(store, name, MACHINE)
        for number in range(runs):
            path = folder.parent / f"{name}-2026-{number + 1:02d}-05.csv"
            write_table(table(100 * machine + number), path)
            add_run(store, name, path, read_table(path), None, ordered=False, units_said=False)
    return store


def test_readings_come_back_bit_for_bit(tmp_path):
    path = tmp_path / "a.csv"
    given = table(1)
    given.measured[3] = np.nan  # a reading that was not observed
    write_table(given, path)
    whole = read_table(path)
    write_readings(whole, NASTY, "abc", tmp_path / "a.parquet")
    back = columns_to_table(read_columns(tmp_path / "a.parquet"), whole.source, whole.run_sha256[0])
    assert table_to_frame(back).equals(table_to_frame(whole))
    for name in ("target", "command", "measured", "temp_c", "run", "line", "role", "name"):
        np.testing.assert_array_equal(getattr(back, name), getattr(whole, name), err_msg=name)
    assert (back.run_label, back.run_sha256, back.source) == (whole.run_label, whole.run_sha256, whole.source)


def test_a_real_run_and_an_arms_run_come_back_too(tmp_path):
    whole = read_table(ROOT / "data" / "experiment1.csv")
    write_readings(whole, "m", "abc", tmp_path / "b.parquet")
    back = columns_to_table(read_columns(tmp_path / "b.parquet"), whole.source, "x")
    assert table_to_frame(back).equals(table_to_frame(whole)) and list(back.extra) == list(whole.extra)
    arm = make_table(None, np.zeros((4, 6)) + 0.1, np.ones((4, 3)), joint_prefix="q")
    write_readings(arm, "m", "abc", tmp_path / "c.parquet")
    back = columns_to_table(read_columns(tmp_path / "c.parquet"), "c", "x")
    assert back.joint_prefix == "q" and back.command.shape == (4, 6) and np.isnan(back.target).all()


def test_the_same_run_twice_is_one_run_and_its_file_is_kept_unchanged(tmp_path):
    store, path = create_store(tmp_path / "s"), tmp_path / "a 2026-03-15.csv"
    write_table(table(1), path)
    add_machine(store, NASTY, MACHINE)
    one = add_run(store, NASTY, path, read_table(path), None, ordered=False, units_said=False)
    two = add_run(store, NASTY, path, read_table(path), None, ordered=False, units_said=False)
    late = add_run(store, NASTY, path, read_table(path), datetime(2026, 5, 1), ordered=False, units_said=False)
    rows = store.ask("SELECT * FROM runs")
    assert (one.new, two.new, late.new, len(rows)) == (True, False, False, 1)
    assert two.date == late.date == "2026-03-15 (as it is kept)"  # what is told is what the store holds
    assert sha256(store.folder / rows[0]["kept"]) == sha256(path) == rows[0]["run"]
    assert rows[0]["machine"] == NASTY and rows[0]["date"].date().isoformat() == "2026-03-15"
    add_machine(store, "other", MACHINE)
    with pytest.raises(InputError, match="is already a run of 'mill"):
        add_run(store, "other", path, read_table(path), None, ordered=False, units_said=False)


def test_a_machine_needs_a_drawing_once_and_keeps_it(tmp_path):
    store = create_store(tmp_path / "s")
    with pytest.raises(InputError, match="--model"):
        add_machine(store, "a", None)
    with pytest.raises(InputError, match="no name"):
        add_machine(store, "  ", MACHINE)
    add_machine(store, "a", MACHINE)
    assert add_machine(store, "a", None).machine == add_machine(store, "a", MACHINE).machine
    other = tmp_path / "other.toml"
    other.write_text(MACHINE.read_text().replace("300.0", "301.0"))
    with pytest.raises(InputError, match=r"differs from the stored drawing of 'a' in \[machine\]"):
        add_machine(store, "a", other)
    stated = {
        "tracker": 'frame = "trusted"',
        "controller": 'compensates = ["backlash"]',
        "targets": "origin_mm = [1, 2, 3]",
    }
    for section, text in stated.items():  # what is stored would be taken, and what was given be lost unseen
        other.write_text(MACHINE.read_text().partition("[tracker]")[0] + f"[{section}]\n{text}\n")
        with pytest.raises(InputError, match=rf"in .*\[{section}\]"):
            add_machine(store, "a", other)


def test_a_broken_file_among_the_runs_keeps_no_other_out_and_makes_no_machine(tmp_path, capsys):
    store = create_store(tmp_path / "s")
    paths = [tmp_path / f"{name}-2026-0{number}-05.csv" for number, name in enumerate(("a", "broken", "c"), 1)]
    for number in (0, 2):
        write_table(table(number), paths[number])
    paths[1].write_text(f"{paths[0].read_text()}1,2\n")
    call = ["fleet", "add", str(store.folder), "mill", "--model", str(MACHINE)]
    assert run([*call, str(paths[1])]) == 2
    assert not store.ask("SELECT machine FROM machines UNION SELECT machine FROM models")
    capsys.readouterr()
    assert run([*call, *map(str, paths), str(tmp_path / "nowhere.csv")]) == 2
    told = capsys.readouterr()
    assert [line.partition(":")[0] for line in told.out.splitlines()] == [paths[0].name, paths[2].name]
    error = next(line for line in told.err.splitlines() if line.startswith("error"))
    assert "2 of 4 files were not added; the others were" in error
    assert f"{paths[1].name} row 22" in error and "nowhere.csv" in error
    assert {row["file"] for row in store.ask("SELECT file FROM runs")} == {paths[0].name, paths[2].name}
    assert run([*call[:3], "press", "--model", str(MACHINE), str(paths[0])]) == 2  # another machine's run
    assert len(store.ask("SELECT machine FROM machines")) == 1


def test_a_machine_file_in_place_of_the_name_gives_name_and_drawing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    paths = [tmp_path / f"run-2026-0{number}-05.csv" for number in range(1, 6)]
    for number, path in enumerate(paths):
        write_table(table(number), path)
    drawing = MACHINE.read_text()
    named = [line for line in drawing.splitlines() if line.startswith("name = ")]
    called = named[0].split('"')[1]
    Path("press.toml").write_text("\n".join(line for line in drawing.splitlines() if line not in named))
    Path("fm.toml").write_text(drawing)
    store = create_store("plant")

    def added(*given: object) -> str:
        result = fleet("add", "plant", *given, "--json")
        assert result.exit_code == 0, result.stderr
        return json.loads(result.stdout)["machine"]

    assert added("fm.toml", paths[0], "--date", "2026-01-01", "--also", paths[1]) == called == added(called, paths[2])
    assert len(store.ask("SELECT run FROM runs WHERE machine = ?", called)) == 3  # each file is a run
    assert added(tmp_path / "fm.toml", paths[1]) == called
    assert added("press.toml", paths[3]) == "press"  # what has no name is called as its file is
    assert added("fm.toml", paths[4], "--model", "fm.toml") == "fm.toml"  # beside a drawing it is a name, as before
    Path("press").mkdir()  # a folder that is no compensator is no drawing either
    assert json.loads(fleet("show", "plant", "press", "--json").stdout)["machines"][0]["runs"] == 1
    assert json.loads(fleet("show", "plant", "press.toml", "--json").stdout)["machines"][0]["machine"] == "press"
    counts = {row["machine"]: row["runs"] for row in store.ask("SELECT machine, count(*) runs FROM runs GROUP BY ALL")}
    assert counts == {called: 3, "press": 1, "fm.toml": 1}
    Path("press.toml").write_text(Path("press.toml").read_text().replace("300.0", "301.0"))
    assert "differs from the stored drawing of 'press'" in fleet("add", "plant", "press.toml", paths[0]).stderr
    assert fleet("remove", "plant", tmp_path / "press.toml", paths[3].name).exit_code == 0
    missing = fleet("add", "plant", "nowhere.toml", paths[0])
    assert missing.exit_code == 2 and "in place of the name" in missing.stderr


def test_a_name_that_is_no_text_is_refused_and_nothing_kept(tmp_path):
    store = create_store(tmp_path / "store")
    with pytest.raises(InputError, match="is not UTF-8"):
        add_machine(store, "mill \udcff", MACHINE)
    with transaction(store.file) as connection:
        assert not rows(connection, "SELECT 1 FROM machines")
        with pytest.raises(InputError, match="is not UTF-8"):
            rows(connection, "SELECT 1 FROM machines WHERE machine = ?", "mill \udcff")


def test_a_folder_that_holds_something_else_is_not_made_a_store(tmp_path):
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(InputError, match="not an empty folder"):
        create_store(tmp_path)
    with pytest.raises(InputError, match="no fleet's store"):
        open_store(tmp_path)
    (tmp_path / "fleet.duckdb").write_text("not a database, but long enough to be looked into " * 400)
    with pytest.raises(InputError, match="cannot be opened"):
        open_store(tmp_path)


def test_what_a_broken_off_init_left_is_in_nobodys_way(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left = tmp_path / f".fleet.duckdb.{platform.node().replace('.', '-')}.{gone.pid}.0123"
    left.write_text("half of it")
    create_store(tmp_path)
    assert not left.exists() and open_store(tmp_path).ask("SELECT run FROM runs") == []


def test_dates_are_read_from_a_name_or_said(tmp_path):
    path = tmp_path / "run_20260315_b.csv"
    path.write_text("x")
    for name in ("run_20260315_b.csv", "run_2026_03_15.csv", "run_2026.03.15.csv", "SN12345678_2026-03-15.csv"):
        named = path.with_name(name)
        named.write_text("x")
        assert date_of(named) == (datetime(2026, 3, 15), "by the file's name")
    for name in ("run_2026-13-45.csv", "run_2026-0315.csv", "120260315.csv", "run.csv"):
        named = path.with_name(name)
        named.write_text("x")
        assert date_of(named)[1] == "the file's own date"
    assert read_date("2026-03-15T10:00:00+02:00").isoformat() == "2026-03-15T08:00:00"
    with pytest.raises(InputError, match="--date"):
        read_date("15.3.")


@pytest.mark.parametrize("damage", ["cut", "flipped"])
def test_a_damaged_store_is_said_to_be_one(tmp_path, damage, capsys):
    folder = tmp_path / "store"
    fill(folder, machines=1, runs=1)
    file = folder / "fleet.duckdb"
    data = bytearray(file.read_bytes())
    # Blocks are of 256 kB after three heads of 4 kB; each begins with its checksum.
    middle = 3 * 4096 + 262144 * ((len(data) - 3 * 4096) // 262144 // 2)
    for at in range(3 * 4096, len(data), 4096):
        data[at + 100] ^= 1
    file.write_bytes(bytes(data[:middle] if damage == "cut" else data))
    outcome = fleet("show", folder)
    assert outcome.exit_code == 2
    assert "fleet.duckdb: " in outcome.stderr and len(outcome.stderr.strip().splitlines()) == 1
    assert "unexpected" not in outcome.stderr


def test_anybodys_sql_reads_the_store(tmp_path):
    store = fill(tmp_path / "s", 2, 2)
    run_all(store, work=lambda task, tell: outcome(task))
    connection = duckdb.connect(str(store.file), read_only=True)
    try:
        joined = connection.execute(
            f"SELECT r.machine, count(*) FROM read_parquet('{store.folder}/readings/*.parquet', union_by_name = true) "
            "p JOIN runs r ON r.run = p.run_sha256 JOIN outcomes o ON o.run = r.run GROUP BY ALL ORDER BY ALL"
        ).fetchall()
    finally:
        connection.close()
    assert joined == [("m0", 40), ("m1", 40)]


def test_the_command_line_says_and_does_all_that(tmp_path, monkeypatch):
    monkeypatch.setattr("ptt.fleet.work.work", lambda task, tell: outcome(task))
    store, path = tmp_path / "s", tmp_path / "a.csv"
    write_table(table(1), path)
    assert fleet("init", store).exit_code == 0
    assert fleet("init", store).exit_code == 2
    assert "--model" in fleet("add", store, "a", path).stderr
    added = fleet("add", store, NASTY, path, "--model", MACHINE, "--date", "2026-03-15", "--json")
    assert json.loads(added.stdout)["runs"][0]["new"] is True
    assert json.loads(fleet("show", store, "--json").stdout)["machines"][0]["verdict"] is None
    assert json.loads(fleet("run", store, "--json").stdout)["runs"] == 1
    assert json.loads(fleet("run", store, "--json").stdout)["runs"] == 0
    machine = json.loads(fleet("show", store, "--json").stdout)["machines"][0]
    assert {"machine", "runs", "last", "verdict", "error_um", "alarms"} <= set(machine)
    assert (machine["machine"], machine["runs"], machine["error_um"]) == (NASTY, 1, 5.0)
    assert "\n" not in fleet("show", store).stdout.splitlines()[1].replace("\\n", "")
    out = tmp_path / "r.html"
    assert fleet("report", store, "--out", out).exit_code == 0
    page = out.read_text()
    assert "<script" not in page and "&lt;script&gt;" in page and "http" not in page.replace("http-equiv", "")
    assert fleet("show", store, "nobody").exit_code == 2
    assert fleet("run", store, "--workers", "1", "--scheduler", "x").exit_code == 2


def test_without_duckdb_the_way_to_get_it_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "duckdb", None)
    result = fleet("init", tmp_path / "s")
    assert result.exit_code == 2 and "pip install 'ptt[fleet]'" in result.stderr
