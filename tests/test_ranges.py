"""What a model's run measured of loads, temperatures, speeds and times, and commands beyond it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_runs import machine, measure
from told_models import with_effects

from ptt.correct import blocks
from ptt.correct.compensate import compensate
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.ranges import ranges_of
from ptt.run.table import concat_tables, make_table

FILE = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")


def model_over(column: str, low: float, high: float, **effects: dict[str, object]) -> Model:
    """A model whose run had values of one context from `low` to `high`."""
    model = with_effects(FILE, **effects)
    history = ({"kind": "added", "ranges": {column: [low, high]}},)
    return replace(model, file=replace(model.file, history=history))


LAGS = model_over("feed_mm_s", 20.0, 30.0, following_error={"lag_s": [0.005] * 3})


def test_a_cell_without_a_feed_has_no_speed_whole_and_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    row = np.arange(40)
    place = np.column_stack([40.0 * np.sin(row / 15.0), 40.0 * np.cos(row / 15.0), np.zeros(40)])
    table = make_table(place, feed_mm_s=np.where(row % 4 == 0, np.nan, np.where(row < 30, 25.0, 90.0)))
    whole = compensate(LAGS, table).status
    assert (whole == np.where((row >= 30) & (row % 4 != 0), "uncertain", "ok")).all()
    monkeypatch.setattr(blocks, "ROWS", 15)
    assert (compensate(LAGS, table).status == whole).all()
