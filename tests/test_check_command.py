"""`ptt check` and what other verbs do with its findings: JSON, cured files, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run_verb

from ptt.machine import MachineFile, load_machine
from ptt.run.reading import read_table
from ptt.run.table import Table
from ptt.run.written import write_table

DATA = Path(__file__).parent.parent / "data" / "sealed_one"


def test_check_writes_json_and_cured_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = read_table(DATA / "run.csv")
    write_table(run.replace(measured=run.measured / 25.4), tmp_path / "inch.csv")
    code = run_verb(
        "check", tmp_path / "inch.csv", "--model", DATA / "machine.toml", "--out-run", tmp_path / "cured.csv",
        "--out-model", tmp_path / "cured.toml", "--json",
    )  # fmt: skip
    said = json.loads(capsys.readouterr().out)
    assert code == 0
    assert said["ok"] is False
    assert said["findings"][0]["mistake"] == "unit-scale"
    assert set(said["findings"][0]) == {"mistake", "words", "fix", "rms_um", "sure"}
    np.testing.assert_allclose(read_table(tmp_path / "cured.csv").measured, run.measured, rtol=1e-12)
    assert load_machine(tmp_path / "cured.toml") == load_machine(DATA / "machine.toml")


def test_a_cured_run_has_all_columns_of_the_run_in_its_order(tmp_path: Path) -> None:
    """A deviation that stands alone, a role that is the same everywhere, an own column, a joint too many, a gap."""
    rows = (DATA / "run.csv").read_text().splitlines()[:61]
    titles = rows[0].split(",")
    x, y = titles.index("x_meas"), titles.index("y_meas")
    cells = [row.split(",") for row in rows]
    cells[30][x] = ""
    for row in cells[1:]:
        row[x], row[y] = row[y], row[x]
    ends = [["x_std", "operator", "dir4"], *[["0.004", "Ann", "1.0"]] * 60]
    text = "".join(",".join([*row, *end]) + "\n" for row, end in zip(cells, ends, strict=True))
    (tmp_path / "run.csv").write_text(text)
    machine, out = DATA / "machine.toml", tmp_path / "cured.csv"
    assert run_verb("check", tmp_path / "run.csv", "--model", machine, "--out-run", out) == 0
    cured = [line.split(",") for line in out.read_text().splitlines()]
    assert cured[0] == [*titles, "x_std", "operator", "dir4", "y_std"]
    assert {row[titles.index("repeat")] for row in cured[1:]} == {"1"}
    assert {(*row[-4:],) for row in cured[1:]} == {("", "Ann", "1.0", "0.004")}, (
        "the deviation goes where its readings go"
    )
    gap = cured[30]
    assert gap[x] == "" and float(gap[y]) == float(cells[30][x])


def test_a_file_in_which_nothing_was_undone_is_said_to_be_as_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    """A clock that goes back once is `perhaps` a mistake, a negated axis is one of the run, radii are the drawing's."""
    asked, flipped, turned = tmp_path / "asked.csv", tmp_path / "flipped.csv", tmp_path / "turned.toml"
    time = np.arange(sound[1].rows, dtype=float)
    time[100:110] -= 50.0
    write_table(sound[1].replace(time_s=time), asked)
    write_table(sound[1].replace(measured=sound[1].measured * [1.0, 1.0, -1.0]), flipped)
    drawing = (DATA / "machine.toml").read_text()
    turned.write_text(drawing.replace("200.0", "R").replace("100.0", "200.0").replace("R", "100.0"))
    as_it_was, undone = "unchanged: no certain mistake to correct", "with its certain mistakes corrected"
    for run, machine, of_run, of_machine in (
        (asked, DATA / "machine.toml", as_it_was, as_it_was),
        (flipped, DATA / "machine.toml", undone, as_it_was),
        (DATA / "run.csv", turned, as_it_was, undone),
    ):
        outs = tmp_path / "out.csv", tmp_path / "out.toml"
        run_verb("check", run, "--model", machine, "--out-run", outs[0], "--out-model", outs[1])
        told = capsys.readouterr()
        assert f"out.csv: the run, {of_run}" in told.err and f"out.toml: the machine file, {of_machine}" in told.err
        assert run is not asked or "perhaps row-order" in told.out


def test_verbs_refuse_what_is_sure_and_go_on_anyway(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    broken = tmp_path / "broken.csv"
    write_table(sound[1].replace(measured=sound[1].measured * [1.0, 1.0, -1.0]), broken)
    given = (broken, "--model", DATA / "machine.toml", "--json")
    assert run_verb("diagnose", *given) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"] == "setup"
    assert said["suggested"] == []
    assert said["verdict_probability"] == {"missing": 0.0, "nothing-missing": 0.0, "unknown": 0.0}
    assert said["setup"][0]["mistake"] == "axis-sign"
    assert run_verb("fit", *given) == 3
    assert "axis-sign" in capsys.readouterr().err
    assert run_verb("fit", *given, "--anyway") == 0
    assert json.loads(capsys.readouterr().out)["steps"]
    assert run_verb("compare", broken, "--model", DATA / "machine.toml") == 0
    assert capsys.readouterr().out.startswith("axis-sign: ")  # before any figure


def test_sliders_in_another_order_are_shown_first_and_may_be_gone_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    """Commands that contradict the targets: compare still compares, and `add --anyway` goes on by the commands."""
    _, table = sound
    assert table.command is not None
    write_table(table.replace(command=table.command[:, [1, 0, 2]]), tmp_path / "run.csv")
    given = (tmp_path / "run.csv", "--model", DATA / "machine.toml", "--json")
    assert run_verb("compare", *given) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["setup"][0]["mistake"] == "slider-order"
    assert data["rms_um"]["total"] > 1000.0
    words = ("backlash", *given[1:], "--out", tmp_path / "out.toml")
    assert run_verb("add", given[0], *words) == 3
    assert run_verb("add", given[0], *words, "--anyway") == 0
