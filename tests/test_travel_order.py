"""The clock and the order of the rows: midnight, rows that are not in travel order, clocks that restart."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.errors import TableError
from ptt.machine import load_machine
from ptt.run.reading import read_table
from ptt.run.restarts import restarts, restarts_of_runs
from ptt.run.table import Table
from ptt.setup.order import find_disorder
from ptt.setup.setup import Setup

DATA = Path(__file__).resolve().parents[1] / "data"
MACHINE = load_machine(DATA / "sealed_one" / "machine.toml")
PLACES = np.random.default_rng(0).uniform(-50, 50, (8, 3)).round(3)


def file(folder: Path, times: list, title: str = "time", **columns: object) -> Path:
    frame = pd.DataFrame(PLACES[: len(times)], columns=["x_cmd", "y_cmd", "z_cmd"])
    for axis in "xyz":
        frame[f"{axis}_meas"] = frame[f"{axis}_cmd"] + 0.1
    frame.assign(**{title: times}, **columns).to_csv(folder / "run.csv", index=False)
    return folder / "run.csv"


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["23:58:00", "23:59:30", "00:01:00", "00:02:00"], [0, 90, 180, 240]),
        (["11:59:00 PM", "12:01:00 AM", "6:00:00 AM", "6:00:00 AM"], [0, 120, 21660, 21660]),
        (["22:00:00", "01:00:00", "23:00:00", "00:30:00"], [0, 10800, 90000, 95400]),
        (["2026-11-21 23:59:30", "2026-11-22 00:00:30"], [0, 60]),
    ],
)
def test_the_clock_goes_on_past_midnight(stamps: list[str], seconds: list[float], tmp_path: Path) -> None:
    table = read_table(file(tmp_path, stamps))
    assert table.time_s.tolist() == seconds
    assert ("on past midnight" in str(table.understood)) == ("-" not in stamps[0])


@pytest.mark.parametrize("order", [None, "time", "rows"])
def test_seconds_of_the_day_go_on_past_midnight_a_restarted_clock_does_not(order: str | None, tmp_path: Path) -> None:
    settings = {} if order is None else {"order": order}
    path = file(tmp_path, [86340.0, 86388.0, 0.0, 12.0, 24.0], name=list("abcde"))
    table = read_table(path, set_values=settings)
    assert "".join(table.name) == "abcde" and np.diff(table.time_s).tolist() == [48.0, 12.0, 12.0, 12.0]
    assert "past midnight" in str(table.understood)
    restarted = file(tmp_path, [50000.0, 60000.0, 0.0, 12.0, 24.0])
    if order is None:
        with pytest.raises(TableError, match="time goes back"):
            read_table(restarted)
    else:
        assert read_table(restarted, set_values=settings).time_s.max() < 86400.0


@pytest.mark.parametrize(
    "clock",
    [
        [86390.0, 10.0, 20.0, 86300.0, 30.0],  # out of order at midnight
        ["2025-01-01 08:00", "2025-01-02 07:50", "2025-01-01 08:10", "2025-01-01 08:20"],  # dates know their days
        [50000.0, 86390.0, 10.0, 50001.0],  # a day and more, or two clocks
    ],
)
def test_what_is_no_single_night_is_not_taken_for_one(clock: list, tmp_path: Path) -> None:
    with pytest.raises(TableError, match="time goes back"):
        read_table(file(tmp_path, clock))


def test_rows_that_are_not_in_travel_order_are_refused_until_said(tmp_path: Path) -> None:
    path = file(tmp_path, [0.0, 10.0, 30.0, 20.0, 40.0], name=list("abdce"))
    with pytest.raises(
        TableError, match=r"run\.csv row 5, column time: time goes back .*30 to 20 s, after row 4"
    ) as told:
        read_table(path)
    assert "--set order=time" in str(told.value) and "order=rows" in str(told.value)
    assert told.value.exit_code == 2
    kept = read_table(path, set_values={"order": "rows"})
    assert "".join(kept.name) == "abdce" and kept.time_s.tolist() == [0, 10, 30, 20, 40]
    ordered = read_table(path, set_values={"order": "time"})
    assert "".join(ordered.name) == "abcde" and (np.diff(ordered.time_s) > 0).all()
    assert ordered.line.tolist() == [2, 3, 5, 4, 6]  # errors still name the line of the file
    np.testing.assert_array_equal(ordered.measured, kept.measured[[0, 1, 3, 2, 4]])
    assert "2 of 5 moved" in str(ordered.understood)


def test_rows_that_nobody_said_the_order_of_are_not_put_down_to_a_set(tmp_path: Path) -> None:
    path = file(tmp_path, [0.0, 10.0, 30.0, 20.0, 40.0], name=list("abdce"))
    checked = read_table(path, judge_order=False)
    assert "".join(checked.name) == "abdce" and "time goes back; the rows are used in their" in str(checked.understood)
    assert "--set" not in str(checked.understood)
    assert "as --set order=rows says" in str(read_table(path, set_values={"order": "rows"}).understood)


def test_each_run_has_its_own_clock_and_seconds_may_be_equal(tmp_path: Path) -> None:
    path = file(tmp_path, [50.0, 50.0, 60.0, 0.0, 10.0, 10.0], run=list("aaabbb"))
    assert read_table(path).run.tolist() == [0, 0, 0, 1, 1, 1]
    turned = file(tmp_path, [50.0, 0.0, 60.0, 10.0, 55.0, 20.0], run=list("ababab"))
    with pytest.raises(TableError, match=r"row 6, column time: time goes back within run a \(from 60 to 55 s"):
        read_table(turned)
    with pytest.raises(TableError, match=r"row 3, column time_s: time goes back within run 1 \(from 50 to 0 s"):
        read_table(file(tmp_path, [50.0, 0.0], title="time_s", run=["run 1", "run 1"]))
    turned = file(tmp_path, [50.0, 0.0, 60.0, 10.0, 55.0, 20.0], run=list("ababab"))
    ordered = read_table(turned, set_values={"order": "time"})
    assert ordered.time_s.tolist() == [50, 0, 55, 10, 60, 20]  # each run sorted in its own places


def test_rows_without_a_time_stay_where_they_were(tmp_path: Path) -> None:
    path = file(tmp_path, [0.0, 30.0, "", 20.0, ""], name=list("abcde"))
    with pytest.raises(TableError, match="time goes back"):
        read_table(path)
    assert "".join(read_table(path, set_values={"order": "time"}).name) == "adebc"


def sessions(folder: Path, clocks: list[np.ndarray], places: list[np.ndarray]) -> Path:
    """Sessions of one machine, one behind another."""
    frame = pd.DataFrame(np.concatenate(places), columns=["x_cmd", "y_cmd", "z_cmd"])
    for axis in "xyz":
        frame[f"{axis}_meas"] = frame[f"{axis}_cmd"] + 0.1
    frame.assign(time_s=np.concatenate(clocks)).to_csv(folder / "run.csv", index=False)
    return folder / "run.csv"


WALK = np.random.default_rng(1).uniform(-50, 50, (60, 3)).round(3)


@pytest.mark.parametrize("other", [10.0, 10.7])
def test_two_sessions_with_clocks_of_their_own_are_not_sorted_into_one(other: float, tmp_path: Path) -> None:
    """Sorted by time their rows alternate, and the cures that keep them apart are named first."""
    path = sessions(tmp_path, [np.arange(20) * 10.0, np.arange(25) * other], [WALK[:20], WALK[20:45]])
    with pytest.raises(TableError, match="time goes back") as told:
        read_table(path)
    fix = told.value.fix
    assert "starts anew at row 22," in told.value.what and fix.index("column 'run'") < fix.index(
        "order=rows"
    ) < fix.index("order=t")
    (warning,) = [line for line in read_table(path, set_values={"order": "time"}).understood.lines if "warning" in line]
    assert "starts anew at row 22, and rows of different sessions alternate" in warning and "'run'" in warning
    (found,), cured = find_disorder(Setup(MACHINE, read_table(path, judge_order=False)))
    assert not found.sure and "row 22" in found.words and "column 'run'" in found.fix
    three = sessions(tmp_path, [np.arange(20) * each for each in (10.0, other, 9.0)], np.split(WALK, 3))
    (found,), cured = find_disorder(Setup(MACHINE, read_table(three, judge_order=False)))
    assert not found.sure and "rows 22, 42" in found.words
    assert np.array_equal(cured.table.line, np.arange(2, 62))


def test_rows_of_two_sessions_that_were_shuffled_are_said_to_be_at_two_places_at_once(tmp_path: Path) -> None:
    mixed = np.random.default_rng(2).permutation(40)
    clock = np.tile(np.arange(20) * 10.0, 2)[mixed]
    table = read_table(sessions(tmp_path, [clock], [WALK[:40][mixed]]), set_values={"order": "time"})
    assert any("20 rows have the time of the row before them and are elsewhere" in line for line in said(table))
    alone = np.random.default_rng(2).permutation(20)  # one session, and one whose clock shows whole minutes
    table = read_table(sessions(tmp_path, [10.0 * alone], [WALK[:20][alone]]), set_values={"order": "time"})
    assert said(table) == []
    minutes = np.repeat(np.arange(8) * 60.0, 5)[[*range(20), 25, *range(20, 25), *range(26, 40)]]
    assert said(read_table(sessions(tmp_path, [minutes], [WALK[:40]]), set_values={"order": "time"})) == []


def said(table: Table) -> list[str]:
    return [line for line in table.understood.lines if line.startswith("warning")]


def test_a_run_that_stands_twice_in_its_file_is_no_two_sessions(tmp_path: Path) -> None:
    path = sessions(tmp_path, [np.arange(20) * 10.0] * 2, [WALK[:20]] * 2)
    (warning,) = said(read_table(path, set_values={"order": "time"}))
    assert "all rows come again" in warning


def test_a_clock_starts_anew_near_the_start_of_the_rows_before() -> None:
    clock = np.arange(10) * 10.0
    assert restarts(np.concatenate([clock, clock + 5.0])).tolist() == [10]
    assert restarts(np.concatenate([clock[:4], [np.nan], clock])).tolist() == [5]
    for other in (clock, np.concatenate([clock + 1e4, clock]), np.concatenate([clock, clock + 50.0]), clock[::-1]):
        assert restarts(other).tolist() == []  # never, back to an earlier session, halfway, backwards


def test_clocks_of_several_runs_start_anew_where_each_row_that_goes_back_begins_a_session() -> None:
    clock, run = np.arange(10) * 10.0, np.repeat([0, 1], 20)
    twice = np.concatenate([clock, clock, clock + 3.0, clock])
    assert restarts_of_runs(twice, run, 2).tolist() == [10, 30]
    assert restarts_of_runs(np.ravel(twice.reshape(2, 20).T), np.tile([0, 1], 20), 2).tolist() == [20, 21]
    turned = np.concatenate([clock, clock, np.arange(20.0)[::-1]])  # the second run goes back row by row
    assert restarts_of_runs(turned, run, 20).tolist() == [] == restarts_of_runs(clock[:0], run[:0], 0).tolist()


def test_an_order_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TableError, match="no order 'name'"):
        read_table(file(tmp_path, [0.0, 1.0]), set_values={"order": "name"})
    frame = pd.read_csv(file(tmp_path, [0.0, 1.0])).drop(columns="time")
    frame.to_csv(tmp_path / "run.csv", index=False)
    with pytest.raises(TableError, match="no column of time to sort by"):
        read_table(tmp_path / "run.csv", set_values={"order": "time"})


def test_a_run_sorted_by_place_is_refused_and_sorted_back_by_the_command(tmp_path: Path) -> None:
    """Backlash of 30 um reads as something else once the order of travel is lost."""
    run, machine = DATA / "sealed_one" / "run.csv", DATA / "sealed_one" / "machine.toml"
    frame = pd.read_csv(run)
    frame.sort_values(["z_cmd", "x_cmd"]).to_csv(tmp_path / "run.csv", index=False)
    words = ["compare", str(tmp_path / "run.csv"), "--model", str(machine), "--json"]
    told = CliRunner().invoke(app, ["diagnose", *words[1:]])
    assert json.loads(told.stdout)["verdict"] == "setup" and "row-order" in told.stdout
    out = ["--out", str(tmp_path / "m.toml")]
    refused = CliRunner().invoke(app, ["add", str(tmp_path / "run.csv"), "backlash", *words[2:4], *out])
    assert refused.exit_code == 3 and "time goes back" in refused.stderr and refused.stdout == ""
    assert "the rows are used in their present order" in CliRunner().invoke(app, words).stderr
    sound = CliRunner().invoke(app, ["compare", str(run), "--model", str(machine), "--json"])
    again = CliRunner().invoke(app, [*words, "--set", "order=time"])
    first, second = (json.loads(done.stdout) for done in (sound, again))
    assert first["rms_um"] == pytest.approx(second["rms_um"], rel=1e-9)
    assert [item["on"] for item in first["depends_on"]] == [item["on"] for item in second["depends_on"]]


@pytest.mark.parametrize("labelled", [True, False])
def test_base_reflectors_in_a_group_of_their_own_are_put_where_the_clock_has_them(
    labelled: bool, tmp_path: Path
) -> None:
    """As exports have them that are sorted by group: at which nothing moves, and they were refused as a second run."""
    run = pd.read_csv(DATA / "volume.csv", dtype={"run": str})
    if not labelled:
        run.loc[run["role"] == "base", "run"] = ""
    run.to_csv(tmp_path / "true.csv", index=False)
    base = run["role"] == "base"
    by_name = run[base].sort_values("name", kind="stable")
    pd.concat([run[~base], by_name]).to_csv(tmp_path / "behind.csv", index=False)
    pd.concat([by_name, run[~base]]).to_csv(tmp_path / "before.csv", index=False)
    true = read_table(tmp_path / "true.csv")
    for title in ("behind.csv", "before.csv"):
        table = read_table(tmp_path / title)
        assert table.time_s.tolist() == true.time_s.tolist() and table.name.tolist() == true.name.tolist()
        np.testing.assert_array_equal(table.measured, true.measured)
        assert "readings of base reflectors put in order by their time" in table.understood.lines
    kept = read_table(tmp_path / "behind.csv", set_values={"order": "rows"})
    assert kept.line.tolist() == list(range(2, len(run) + 2))
    early = run[~base].iloc[[1, 0, *range(2, 320)]]  # poses out of order are refused as before
    pd.concat([early, by_name]).to_csv(tmp_path / "mixed.csv", index=False)
    with pytest.raises(TableError, match="time goes back"):
        read_table(tmp_path / "mixed.csv")
