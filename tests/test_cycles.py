"""What comes and goes with a period of its own, as a compressor does: told by that period, and not by the path's."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import SIGMA, machine

from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

MACHINE = bench()


@pytest.mark.parametrize("size_mm", [0.02, pytest.param(0.3, marks=pytest.mark.long)])
def test_a_cycle_over_time_is_told_by_its_period(size_mm: float) -> None:
    """A tool that sinks fast and rises slowly, eleven times in a run, however much the noise would have to remember."""
    drawn = draw_rig(11, MACHINE, "volume", rows=150)
    frame = simulate(drawn.rig, drawn.targets).frame
    read = frame["role"] != "base"
    period = float(np.ptp(frame.loc[read, "time_s"])) / 11.0
    part = np.mod(frame["time_s"] / period + 0.3, 1.0)
    frame["z_meas"] -= size_mm * (1.0 - np.exp(-3.0 * np.where(part < 0.35, part / 0.35, (1.0 - part) / 0.65)))
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table_of(frame, drawn.absent)))
    first = found.depends_on[0]
    assert found.verdict == "unknown" and (first.residual, first.on, first.unit) == ("z", "time", "s")
    assert first.period_mm == pytest.approx(period, rel=0.01) and first.share > 0.4
    assert "every" in first.words


@pytest.mark.parametrize("seed", [1, 2])
def test_a_cycle_does_not_drown_in_a_noise_that_is_told_by_itself(seed: int) -> None:
    """Nobody states the noise, which remembers, and no pose is repeated; all axes go up and down together."""
    random, rows = np.random.default_rng(seed), 90
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted", "sigma_mm": None}))
    time = 4.4 * np.arange(rows) + random.uniform(0.0, 1.0, rows)
    target = random.uniform(-60.0, 60.0, (rows, 3))
    part = np.mod(time / 51.0 + random.uniform(), 1.0) - 0.5
    noise = random.normal(0.0, 0.008, (rows, 3))
    for row in range(1, rows):
        noise[row] = 0.6 * noise[row - 1] + 0.8 * noise[row]
    read = target + part[:, None] * [0.15, -0.13, 0.27] + noise
    found = diagnose(Model(file), build_problem(file, make_table(target, measured=read, time_s=time)))
    assert found.verdict == "unknown" and found.depends_on[0].on == "time"
    assert found.depends_on[0].period_mm == pytest.approx(51.0, rel=0.015)


@pytest.mark.parametrize("seed", [2, pytest.param(3, marks=pytest.mark.long)])
def test_a_cycle_of_one_slider_is_told_beside_play_on_few_readings(seed: int) -> None:
    """A field over the workspace, or a chance wave along the travel, fits most of any cycle of a hundred readings."""
    random, file, rows = np.random.default_rng(seed), machine(frame="fitted"), 100
    time = np.cumsum(random.uniform(2.0, 3.0, rows))
    walk = np.cumsum(random.uniform(-15.0, 15.0, (rows, 3)), axis=0)
    table = make_table(60.0 * walk / np.abs(walk).max(), time_s=time)
    view, length = build_view(file, table), time[-1] / random.uniform(8.0, 20.0)
    off = -4.0 * SIGMA * view.direction.numpy()
    off[:, 0] += 15.0 * SIGMA * np.sin(2.0 * np.pi * time / length)
    moved = np.einsum("nij,nj->ni", view.jacobian.numpy(), off)
    read = view.p.numpy() + moved + random.normal(0.0, SIGMA, (rows, 3))
    found = diagnose(Model(file), build_problem(file, replace(table, measured=read)))
    first = found.depends_on[0]
    assert (found.verdict, found.suggested) == ("unknown", (("backlash",),))
    assert (first.residual, first.on, first.period_mm) == ("slider 1", "time", pytest.approx(length, rel=0.01))
