"""`ptt predict` of a long file in parts: the bytes that it writes at once, without the whole list ever in memory."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from test_long_predict import late, model_of, targets_of

from ptt.commands.main import run
from ptt.correct import blocks, stream
from ptt.door import streaming
from ptt.door.streaming import merged
from ptt.effects.drive import AxisCompliance, FollowingError
from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.model.entries import read_model, write_model
from ptt.model.model import Term
from ptt.run.readers import parts
from ptt.run.spool import Spool
from ptt.run.table import Table, make_table
from ptt.run.written import write_table

COMPLIANT = torch.full((3,), 2e-4, dtype=torch.float64)


@pytest.fixture
def folder(tmp_path: Path, bench: MachineFile) -> Path:
    (tmp_path / "model.toml").write_text(format_machine(write_model(model_of(bench))))
    return tmp_path


def listed(bench: MachineFile, folder: Path, **columns) -> Path:
    targets = targets_of(bench).replace(**columns)
    write_table(targets, folder / "targets.csv")
    return folder / "targets.csv"


def whole(targets: Path, *more: str) -> int:
    out, model = targets.parent / "whole.csv", targets.parent / "model.toml"
    return run(["predict", str(targets), "--model", str(model), "--out", str(out), *more])


def in_parts(monkeypatch: pytest.MonkeyPatch, targets: Path, *more: str, rows: int = 40, lines: int = 33) -> int:
    monkeypatch.setattr(streaming, "LONG", 0)
    monkeypatch.setattr(parts, "LINES", lines)
    for module in (blocks, stream):
        monkeypatch.setattr(module, "ROWS", rows)
    monkeypatch.setattr(blocks, "NEIGHBOUR_ROWS", 12)
    out, model = targets.parent / "parts.csv", targets.parent / "model.toml"
    return run(["predict", str(targets), "--model", str(model), "--out", str(out), *more])


def texts(folder: Path) -> tuple[str, str]:
    return (folder / "whole.csv").read_text(), (folder / "parts.csv").read_text()


@pytest.mark.parametrize("more", ["", "runs", "names"])
def test_parts_write_what_the_whole_writes(bench, folder, monkeypatch, capsys, more: str) -> None:
    rows = np.arange(260)
    columns = {
        "": {},
        "runs": {"run": rows * 3 // 260, "run_label": ("a", "b", "c")},
        "names": {
            "name": np.where(rows > 100, 'p "1", #', ""),
            "extra": {"mine": np.array([f"x{row}" for row in rows])},
        },
    }[more]
    targets = listed(bench, folder, **columns)
    assert whole(targets, "--json") == in_parts(monkeypatch, targets, "--json") == 3  # rows out of reach
    said = [line.replace("parts.csv", "whole.csv") for line in capsys.readouterr().out.splitlines()]
    assert len(said) == 2
    assert said[0] == said[1]
    one, two = texts(folder)
    assert "nearest_mm" in one
    assert one == two


@pytest.mark.parametrize("feed", [False, True])
def test_rows_beyond_the_models_run_are_counted_once_each(bench, folder, monkeypatch, capsys, feed: bool) -> None:
    rows = np.arange(260)
    columns = {"time_s": 0.1 * rows + 1e6 * (rows < 100), "run": rows // 100, "run_label": ("a", "b", "c")}
    if feed:  # told in the first part alone, it stands for the whole list
        columns["feed_mm_s"] = np.where(rows < 30, 500.0, np.nan)
    targets = listed(bench, folder, **columns)
    model = model_of(bench, Term(FollowingError(), late(1e-4)))
    history = ({"kind": "added", "ranges": {"feed_mm_s": [20.0, 30.0]}},)
    written = write_model(replace(model, file=replace(bench, history=history)))
    (folder / "model.toml").write_text(format_machine(written))
    assert whole(targets) == in_parts(monkeypatch, targets) == 3
    said = [line for line in capsys.readouterr().err.splitlines() if "speed goes beyond" in line]
    assert len(said) == 2 and said[0] == said[1]
    one, two = (pd.read_csv(folder / name)["status"] for name in ("whole.csv", "parts.csv"))
    assert (one == two).all() and (one == "uncertain").any()


def test_a_block_and_what_lies_beside_it_are_in_memory(bench, folder, monkeypatch) -> None:
    asked, take = [], Spool.take

    def noted(spool: Spool, first: int, last: int) -> Table:
        asked.append(last - first)
        return take(spool, first, last)

    monkeypatch.setattr(Spool, "take", noted)
    monkeypatch.setattr(blocks, "CHUNK", 60)
    monkeypatch.setattr(streaming, "CHUNK", 80)
    monkeypatch.setattr(streaming, "STRETCH_ROWS", 20)
    in_parts(monkeypatch, listed(bench, folder))
    assert max(asked) <= 40 + 12 + 60


def test_a_cell_far_down_is_named_and_nothing_is_written(bench, folder, monkeypatch, capsys) -> None:
    targets = listed(bench, folder)
    lines = targets.read_text().splitlines()
    lines[2] = f"# a comment\n\n{lines[2]}"
    lines[200] = lines[200].replace(lines[200].split(",")[1], "x")
    targets.write_text("\n".join(lines))
    assert in_parts(monkeypatch, targets) == 2
    assert "row 203, column y_cmd: not a number ('x')" in capsys.readouterr().err
    assert not (folder / "parts.csv").exists()


@pytest.mark.parametrize("how", ["utf-16", "stamps", "semicolons"])
def test_what_only_the_whole_tells_is_read_as_a_whole(bench, folder, monkeypatch, how: str) -> None:
    targets = listed(bench, folder)
    text = targets.read_text()
    if how == "stamps":
        head, *rows = text.splitlines()
        stamped = [f"{row},2026-01-05 10:{index // 60:02d}:{index % 60:02d}" for index, row in enumerate(rows)]
        text = "\n".join([f"{head},time", *stamped])
    if how == "semicolons":
        text = text.replace(",", ";").replace(".", ",")
    targets.write_text(text, encoding="utf-16" if how == "utf-16" else "utf-8")
    assert whole(targets) == in_parts(monkeypatch, targets) == 3
    one, two = texts(folder)
    assert one == two


def test_what_stands_in_an_empty_cell_the_rows_of_another_part_may_tell(folder, monkeypatch, capsys) -> None:
    warm = "".join(f"{i},2,10,{20 + 0.1 * i if i not in (32, 33) else ''},{'' if i == 60 else 1}\n" for i in range(90))
    (folder / "targets.csv").write_text("x_cmd,y_cmd,z_cmd,temp_c,payload_kg\n" + warm)
    assert whole(folder / "targets.csv") == in_parts(monkeypatch, folder / "targets.csv") == 0
    one, two = texts(folder)
    assert one == two
    assert one.splitlines()[33].startswith("32.0,2.0,10.0,23.2,1.0,")
    laden = read_model(parse_machine((folder / "model.toml").read_text())) + Term(AxisCompliance(), COMPLIANT)
    (folder / "model.toml").write_text(format_machine(write_model(laden)))
    assert in_parts(monkeypatch, folder / "targets.csv") == 2
    assert "targets.csv row 62, column payload_kg: empty, and axis-compliance depends on it" in capsys.readouterr().err


def test_titles_of_parts_keep_their_order() -> None:
    assert merged(["x", "z", "q"], ["n", "x", "y", "z", "q", "end"]) == ["n", "x", "y", "z", "q", "end"]


def test_columns_of_the_input_come_first_in_their_own_order_empty_ones_too(folder, monkeypatch) -> None:
    targets = folder / "targets.csv"
    targets.write_text(
        "note,z_cmd [m],role,y_cmd,temp_c,x_cmd,name\n" + "".join(f"a{i},0.01,,2,,{i},\n" for i in range(90))
    )
    more = ("--set", "payload_kg=2", "--reversal", "none")
    assert whole(targets, *more) == in_parts(monkeypatch, targets, *more) == 0
    one, two = texts(folder)
    head, first, *_ = one.splitlines()
    assert head.startswith("note,z_cmd,role,y_cmd,temp_c,x_cmd,name,payload_kg,b1,b2,b3,reversal1,")
    assert first.startswith("a0,10.0,pose,2.0,,0.0,,2.0,")
    assert one == two


def test_a_list_of_which_nothing_can_be_sent_says_so_row_by_row(bench, folder, monkeypatch) -> None:
    place = np.column_stack([np.linspace(900.0, 990.0, 100), np.zeros(100), np.full(100, 10.0)])
    write_table(make_table(place), folder / "targets.csv")
    targets = folder / "targets.csv"
    assert whole(targets, "--anyway") == in_parts(monkeypatch, targets, "--anyway") == 3
    one, two = texts(folder)
    assert one.count("out of reach") == 100
    assert one == two


CREEP = """
import torch
from ptt.effects import Effect, Parameter

class Creep(Effect):
    "The head sinks with the hours."
    name, stage, follows_clock = "creep", "structure", True
    parameters = (Parameter("sink", "mm/s", 1e-3, "height lost a second"),)

    def basis(self, view, shape):
        return view.time[:, None, None] * torch.eye(3, dtype=torch.float64)[:, 2:]
"""


def test_rows_of_later_parts_that_are_not_sent_keep_their_time(bench, folder, monkeypatch) -> None:
    targets = listed(bench, folder, time_s=np.arange(260.0))
    (folder / "creep.py").write_text(CREEP)
    text = (folder / "model.toml").read_text()
    entry = '[[effect]]\nname = "creep"\n[effect.parameters]\nsink_mm_per_s = { value = 0.01 }'
    (folder / "model.toml").write_text(f"{text}\n{entry}\n")
    more = ("--effects", str(folder / "creep.py"))
    assert whole(targets, *more) == in_parts(monkeypatch, targets, *more) == 3
    one, two = texts(folder)
    assert "nearest_mm" in one
    assert one == two
