"""The way out that a finding prints is followed by hand, word for word: with that done the set-up is whole."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tomlkit
from setup_mistakes import agreement, with_columns
from setup_mistakes_cases import CASES, Case
from setup_mistakes_runs import draw_run

from ptt.machine import MachineFile, load_machine
from ptt.run.reading import read_table
from ptt.run.table import Table
from ptt.run.written import write_table
from ptt.setup import Finding, check_setup

READ = ["x_meas", "y_meas", "z_meas"]
Hand = Callable[[re.Match[str], pd.DataFrame, Path], pd.DataFrame]
BLIND = {"targets in the workpiece's frame", "readings in another order than the poses"}  # no cure to type


def rename(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    """'x_meas_in, ...' stands for y and z as well, 'b1_cmd_m, ...' for b2 and b3."""
    new = [title for title in re.split(r", | and ", found[1]) if title != "..."]
    titles = {title.rpartition("_")[0]: title for title in new}
    for old, title in list(titles.items()):
        others = zip("xyz", "xyz", strict=True) if old[0] == "x" else [("1", each) for each in "123"]
        titles |= {old.replace(a, b, 1) if old[0] != "x" else b + old[1:]: title.replace(a, b, 1) if old[0] != "x"
                   else b + title[1:] for a, b in others if old[0] in "xb"}  # fmt: skip
    by_quantity = {"temp": "temp_c", "time": "time_s", "payload": "payload_kg", "feed_mm": "feed_mm_s"}
    return run.rename(columns={by_quantity.get(old, old): title for old, title in titles.items()})


def negate(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    return run.assign(**{title: -run[title] for title in found[1].split(" and ")})


def swap(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    return run.assign(**{found[1]: run[found[2]], found[2]: run[found[1]]})


def compute(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    formulas = dict(part.split(" = ") for part in found[1].split(", "))
    return run.assign(**{title: run.eval(formula) for title, formula in formulas.items()})


def draw(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    said = dict(part.split(" = ") for part in found[1].replace(" if the drawing agrees", "").split(" and "))
    document = tomlkit.parse(machine.read_text())
    for key, value in said.items():
        document["machine"][key] = tomlkit.parse(f"value = {value}")["value"]  # type: ignore[index]
    machine.write_text(tomlkit.dumps(document))
    return run


def move(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    first = int(found[2]) - 2 if found[2] else 0
    by = int(found[4]) * (1 if found[3] == "down" else -1)
    moved = run.copy()
    moved.loc[first:, READ] = run.loc[first:, READ].shift(by)
    return moved


def take_off(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    moved, rows = run.copy(), slice(int(found[2]) - 2, int(found[3]) - 2)
    moved.loc[rows, READ] -= [float(value) for value in found[1].split(", ")]
    return moved


def by_number(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    return run.iloc[np.argsort(run["name"].str[1:].astype(int), kind="stable")]


def state(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    machine.write_text(re.sub(r"sigma_mm = \S+", f"sigma_mm = {found[1]}", machine.read_text()))
    return run


def celsius(found: re.Match[str], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    return run.assign(temp_c=(run["temp_c"] - 32.0) / 1.8)


HANDS: dict[str, Hand] = {
    r"rename the columns? \(?([\w, .]*?)\)?": rename,
    r"negate ([\w ]+)": negate,
    r"swap (\w+) and (\w+)": swap,
    r"write (?:all at once, by the old values, )?(b\d_cmd = .*)": compute,
    r"write (.*)": draw,
    r"move (the readings from row (\d+) on|all readings) (up|down) by (\d), and leave the row .* empty": move,
    r"subtract \((.*)\) mm from x_meas, y_meas, z_meas of rows (\d+) to (\d+), or empty those cells": take_off,
    r"sort the rows by time": lambda found, run, machine: run.sort_values("time_s", kind="stable"),
    r"sort the rows by the number in their name": by_number,
    r"turn the column into deg C: .*": celsius,
    r"divide the column by ([\d.]+)": lambda found, run, machine: run.assign(
        payload_kg=run["payload_kg"] / float(found[1])
    ),
    r"state it in mm: ([\d.e-]+)": state,
}


def follow(findings: tuple[Finding, ...], run: pd.DataFrame, machine: Path) -> pd.DataFrame:
    for finding in findings:
        hand, found = next(
            (hand, found) for text, hand in HANDS.items() if (found := re.fullmatch(text, finding.fix)) is not None
        )
        run = hand(found, run, machine)
    return run


def write_text_of(file: MachineFile, path: Path) -> None:
    """A machine file as a person writes it."""
    spec, lines = file.machine.model_dump(mode="json", exclude_none=True), ["[machine]"]
    lines += [f"{key} = {tomlkit.item(value).as_string()}" for key, value in spec.items()]
    lines += ["[tracker]", f'frame = "{file.tracker.frame if file.tracker.frame != "measured" else "fitted"}"']
    lines += [f"sigma_mm = {file.tracker.sigma_mm}"] if file.tracker.sigma_mm else []
    path.write_text("\n".join(lines) + "\n")


def typed(case: Case, have: str, seed: int) -> tuple[MachineFile, Table]:
    file, table = draw_run(seed)
    return case.make(file, with_columns(table, have), np.random.default_rng([seed, 5]))


@pytest.mark.parametrize("have", ["both", "sliders"])
@pytest.mark.parametrize("case", [case for case in CASES if case.title not in BLIND], ids=lambda case: case.title)
def test_the_way_out_leads_out(case: Case, have: str, tmp_path: Path) -> None:
    if have not in case.have:
        pytest.skip("nothing of that mistake shows in such a run")
    seed = 6
    file, made = typed(case, have, seed)
    write_text_of(file, tmp_path / "machine.toml")
    write_table(made, tmp_path / "run.csv")
    table = read_table(tmp_path / "run.csv", judge_scale=False, judge_order=False)
    found = check_setup(load_machine(tmp_path / "machine.toml"), table)
    assert found.sure
    done = follow(found.sure, pd.read_csv(tmp_path / "run.csv"), tmp_path / "machine.toml")
    done.to_csv(tmp_path / "done.csv", index=False)
    cured = read_table(tmp_path / "done.csv", judge_scale=False, judge_order=False)
    machine = load_machine(tmp_path / "machine.toml")
    assert check_setup(machine, cured).ok
    sound = with_columns(draw_run(seed)[1], have)
    before = agreement(replace(draw_run(seed)[0], tracker=machine.tracker), sound)
    assert (agreement(machine, cured) <= 1.5 * before + 0.1).all()
