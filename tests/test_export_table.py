"""The grid of corrections: its entries are those of `ptt predict`, and it is off by no more than it says."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch

from ptt.correct.compensate import compensate
from ptt.correct.exports.format import Options
from ptt.correct.exports.table import MOST_POINTS, _axes, _count, write
from ptt.correct.training.compensator import Compensator
from ptt.effects.links import LinkLength
from ptt.effects.reversal import Backlash
from ptt.effects.screw import OncePerRev
from ptt.effects.structure import ColumnBend
from ptt.effects.towers import TowerTilt
from ptt.errors import InputError
from ptt.machine import MachineFile
from ptt.machine_schema import TargetsSpec
from ptt.model.model import Model, Term
from ptt.run.table import make_table


def _model(file: MachineFile) -> Model:
    values = {
        LinkLength(): [0.3, -0.2, 0.1],
        TowerTilt(): [2e-3, -1e-3, 1e-3, 3e-3, -2e-3, 1e-3],
        Backlash(): [0.04, 0.05, 0.06, 1.0],
        ColumnBend(): [2e-3, 1e-3, 1e-5, 2e-5],
    }
    model = Model(file)
    for effect, numbers in values.items():
        model = model + Term(effect, torch.tensor(numbers, dtype=torch.float64))
    return model


def test_entries_and_the_error_between_them(bench: MachineFile, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    model = _model(bench)
    result = write(Compensator(model, None, {}), path, Options(step=25.0))
    assert set(result.holds) == {"link-length", "tower-tilt"}
    assert {item.effect for item in result.cannot_hold} == {"backlash", "column-bend"}
    assert result.error_um.model < 1.0 < result.error_um.format < 0.2 * result.error_um.drawing
    grid = pd.read_csv(path, comment="#")
    places = grid[["x_mm", "y_mm", "z_mm"]].to_numpy()
    there = grid["sent"].to_numpy() == 1
    still = model.without("backlash").without("column-bend")
    sent, drawn = compensate(still, make_table(places)), compensate(Model(bench), make_table(places))
    both = there & drawn.sent
    shift = grid[["db1_mm", "db2_mm", "db3_mm"]].to_numpy()
    np.testing.assert_allclose((drawn.q + shift)[both], sent.q[both], rtol=0.0, atol=1e-6)
    assert both.sum() > 500
    # Amid cells that nobody chose, the linear rule is off by about what the head says.
    text = path.read_text()
    found = re.search(r"off by ([\d.e-]+) um rms, ([\d.e-]+) um at most", text)
    assert found is not None
    lookup = {tuple(place): value for place, value in zip(places[there].round(6), shift[there], strict=True)}
    random, middles, rule = np.random.default_rng(1), [], []
    for corner in places[there][random.choice(int(there.sum()), 200)]:
        corners = [corner + 25.0 * np.array([i, j, k]) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        values = [lookup.get(tuple(place.round(6))) for place in corners]
        if any(value is None for value in values):
            continue
        middles.append(corner + 12.5)
        rule.append(np.mean(values, axis=0))
    wanted = make_table(np.array(middles))
    exact = compensate(still, wanted).q - compensate(Model(bench), wanted).q
    off = 1e3 * np.abs(rule - exact).max(axis=1)
    assert 0.5 * float(found[1]) < np.sqrt(np.mean(np.square(off))) < 2.0 * float(found[1])
    assert max(off) <= 1.001 * float(found[2])


def test_entries_are_of_the_base_frame_whatever_frame_targets_are_stated_in(bench: MachineFile, tmp_path: Path) -> None:
    stated = replace(bench, targets=TargetsSpec(origin_mm=(50.0, 20.0, 10.0), turn_deg=(0.0, 0.0, 30.0)))
    entries = []
    for name, file in (("t.csv", bench), ("u.csv", stated)):
        result = write(Compensator(_model(file), None, {}), tmp_path / name, Options(step=40.0))
        assert result.error_um.format < 0.2 * result.error_um.drawing
        entries.append(pd.read_csv(tmp_path / name, comment="#"))
    pd.testing.assert_frame_equal(*entries)


def test_a_step_that_makes_no_table_is_refused_with_a_better_one(bench: MachineFile, tmp_path: Path) -> None:
    for step in (0.01, 5000.0):
        with pytest.raises(InputError, match="try"):
            write(Compensator(_model(bench), None, {}), tmp_path / "t.csv", Options(step=step))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("high", [(230.0, 220.0, 180.0), (2.0, 3.0, 0.4), (900.0, 700.0, 20.0)])
def test_the_step_that_is_named_is_the_first_that_is_taken(high: tuple[float, ...]) -> None:
    ends = -np.array(high), np.array(high)
    with pytest.raises(InputError, match=rf"more than {MOST_POINTS}; the workspace .*: try ") as refused:
        _axes(SimpleNamespace(targets=np.array(ends)), 1e-3)
    step = float(refused.value.fix.rsplit(" ", 1)[1])
    assert _count(*ends, step) <= MOST_POINTS < _count(*ends, 0.85 * step)


def test_waves_shorter_than_its_cells_are_left_out_and_it_is_said(bench: MachineFile, tmp_path: Path) -> None:
    """Between places that are whole turns apart they would come out as something else."""
    wave = Term(
        OncePerRev(), torch.tensor([0.05, 0.04, 0.03, 0.0, 0.0, 0.0, bench.machine.screw_lead_mm], dtype=torch.float64)
    )
    tilt = Term(TowerTilt(), torch.tensor([2e-3, -1e-3, 1e-3, 3e-3, -2e-3, 1e-3], dtype=torch.float64))
    result = write(Compensator(Model(bench) + wave + tilt, None, {}), tmp_path / "t.csv", Options(step=20.0))
    alone = write(Compensator(Model(bench) + tilt, None, {}), tmp_path / "u.csv", Options(step=20.0))
    assert result.holds == ("tower-tilt",) and alone.holds == ("tower-tilt",)
    assert result.cannot_hold[0].effect == "once-per-rev" and "too far apart" in result.cannot_hold[0].why
    entries, without = (pd.read_csv(tmp_path / name, comment="#") for name in ("t.csv", "u.csv"))
    pd.testing.assert_frame_equal(entries, without)
