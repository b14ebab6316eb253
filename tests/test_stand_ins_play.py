"""What looks like play or hides in it: short runs, play that dies away, wind-up, unknowns at two speeds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from stated_bench import NOISE, run_of, stated, up_and_down

from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling import naming
from ptt.effects import library
from ptt.effects.reversal import LONGEST
from ptt.judge.ladder.climb import climb
from ptt.mechanisms import build_mechanism
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model, Term
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.draw import draw_rig
from ptt.run.noise import Noise
from ptt.run.problem import build_problem


@pytest.mark.long
def test_a_windup_that_would_outlast_the_travel_is_held_where_it_still_is_one() -> None:
    """Fitted to what slips half way; a file of before may hold a longer one."""
    rows = 218
    slip = np.where(np.arange(rows) >= rows // 2, 0.14, 0.0)[:, None] * np.eye(3)[0]
    problem = run_of(stated(), up_and_down(rows), slip, 7)
    fitted = climb(Model(problem.file), problem, [library()["windup"]()]).model
    assert float(fitted.terms[0].theta[-1]) <= LONGEST
    longer = torch.cat([fitted.terms[0].theta[:-1], torch.tensor([3.0 * LONGEST], dtype=torch.float64)])
    file = write_model(replace(fitted, terms=(replace(fitted.terms[0], theta=longer),)))
    assert float(read_model(file).terms[0].theta[-1]) == pytest.approx(3.0 * LONGEST)


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.long)])
def test_play_is_told_on_short_runs_that_come_from_the_other_side(seed: int) -> None:
    """The first row of a run is taken to arrive as the second moves; three of 48 rows that did not are left aside."""
    random = np.random.default_rng(seed)
    rows, runs = 48, 3
    run, target = np.repeat(np.arange(runs), rows // runs), random.uniform(-60.0, 60.0, (rows, 3))
    file = stated()
    joints = build_mechanism(file.machine).inverse(torch.as_tensor(target)).numpy()
    side = np.sign(np.diff(joints, axis=0, prepend=joints[:1]))
    starts = np.flatnonzero(np.diff(run, prepend=-1))
    side[starts] = -side[starts + 1]
    slip = np.where(np.arange(rows) > 30, 0.3, 0.0)[:, None] * np.eye(3)[1]
    problem = run_of(
        file, target, slip - 0.2 * side, seed, run=run, run_label=("a", "b", "c"), time_s=9.0 * np.arange(rows)
    )
    found = diagnose(Model(file), problem)
    assert found.verdict == "missing"
    assert {names[0] for names in found.suggested} == {"backlash", "homing-slip"}


@pytest.mark.parametrize("left", [0.05, pytest.param(0.0, marks=pytest.mark.long)])
def test_a_play_that_dies_away_is_no_constant_play_beside_an_unknown(left: float) -> None:
    """A constant in its middle would be sent, and be wrong by half of it at either end."""
    random, rows = np.random.default_rng(5), 300
    file, target = stated(), random.uniform(-60.0, 60.0, (rows, 3))
    side = np.sign(np.diff(build_mechanism(file.machine).inverse(torch.as_tensor(target)).numpy(), axis=0, prepend=0.0))
    play = 0.08 * np.maximum(np.exp(-4.0 * np.linspace(0.0, 1.0, rows)), left)
    problem = run_of(file, target, -0.5 * play[:, None] * side, 5, time_s=10.0 * np.arange(rows))
    found = diagnose(Model(file), problem)
    assert found.verdict == "unknown" and found.suggested == ()
    assert {item.on for item in found.depends_on} == {"direction1", "direction2", "direction3"}
    assert all("lower after moving up" in item.words for item in found.depends_on)


@pytest.mark.long
@pytest.mark.parametrize("seed", [3])
def test_a_constant_play_beside_an_unknown_stays_a_play_at_two_speeds(seed: int) -> None:
    """A play that differs with the speed says the same and more: that it might is nothing against the name."""
    drawn = draw_rig(seed, bench(), "speed", rows=120)
    odd = "[[odd]]\nkind = 'periodic'\nleg = 2\nsize_um = 12.0\nperiod_mm = 3.1\n"
    hidden = parse_rig(f"{format_rig(drawn.rig)}\n{odd}")
    gap = hidden.drive.model_copy(update={"backlash_mm": (0.03, 0.0, 0.0)})
    table = table_of(simulate(replace(hidden, drive=gap), drawn.targets).frame)
    found = diagnose(Model(bench()), build_problem(bench(), table))
    assert found.verdict == "unknown"
    assert [names[0] for names in found.suggested] == ["backlash"]


def test_what_does_nothing_at_its_fitted_values_is_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tangent may ask for a wind-up over no travel; play of a quarter of the noise is seen on so many rows."""
    file, target = stated(), np.random.default_rng(4).uniform(-60.0, 60.0, (400, 3))
    problem = run_of(file, target, np.zeros((400, 3)), 4)
    values = {"windup": [1e-4, 0.0, 0.0, *[1e-3] * 3], "backlash": [0.25 * NOISE] * 3 + [1.0]}
    terms = tuple(Term(library()[name](), torch.tensor(each, dtype=torch.float64)) for name, each in values.items())
    monkeypatch.setattr(naming, "noise_after", lambda *_: Noise(NOISE**2 * np.eye(3), "machine file"))
    atoms = {f"{name}#1": SimpleNamespace(name=name) for name in values}
    found = SimpleNamespace(system=SimpleNamespace(atoms=atoms), state=None)
    assert naming._idle(found, tuple(atoms), terms, problem, problem) == ("windup#1",)
    few = problem.masked(np.arange(400) >= 40)  # a sample of a run whose other rows say as much
    assert naming._idle(found, tuple(atoms), terms, few, problem) == ("windup#1",)
    assert naming._idle(found, tuple(atoms), terms, few, few) == tuple(atoms)
