"""What plain effects do beside curves, and play so wide that short moves do not take it up."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from told_models import term

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search import instead
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.search.moves import LEAST_NATS
from ptt.diagnosis.search.turn import still_missed
from ptt.diagnosis.telling import steps
from ptt.diagnosis.unknown import blocks
from ptt.effects import library
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, load_machine
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view


def bench(sigma: float) -> MachineFile:
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    return replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": sigma}))


def bowed(poses: np.ndarray, file: MachineFile, random: np.random.Generator) -> Term:
    effect, q = library()["guide-straightness"](), build_view(file, make_table(poses)).q
    ends = {"from": q.min(), "to": q.max(), "straight": 0.0}
    values = [
        np.full(p.size(3), ends[p.stem]) if p.stem in ends else 0.04 * random.normal(size=p.size(3))
        for p in effect.parameters
    ]
    return Term(effect, torch.tensor(np.concatenate(values)))


def read(file: MachineFile, poses: np.ndarray, terms: list[Term], random: np.random.Generator) -> Problem:
    at = predict([(each.effect, each.theta) for each in terms], build_view(file, make_table(poses))).p.numpy()
    sigma = file.tracker.sigma_mm
    return build_problem(file, make_table(poses, measured=at + random.normal(0.0, sigma, at.shape)))


def rails(size: float) -> tuple[MachineFile, Problem]:
    """Rails that are bowed, lean and stand off by a multiple of 0.4 mm."""
    file, random = bench(0.004), np.random.default_rng(1)
    poses = random.uniform(-50.0, 50.0, (110, 3))
    off = term("tower-position", [0.32 * size, -0.1 * size, 0.4 * size, 0.0, 0.0, 0.0])
    lean = term("tower-tilt", [1.5e-3 * size, 1.1e-3 * size, 2.5e-3 * size, 0.0, 0.0, 0.0])
    return file, read(file, poses, [bowed(poses, file, random), off, lean], random)


def explained(file: MachineFile, problem: Problem) -> Found:
    return find(Model(file), problem, library(), lambda what: None)


def test_a_curve_does_not_keep_out_what_only_an_exact_score_tells():
    found = explained(*rails(1.0))
    curve = found.scorer.score(("guide-straightness",), WHITE)
    assert all(gain.nats < 0.0 for gain in found.scorer.screen(curve))
    more = instead._beside(found.scorer, curve, "guide-straightness")
    names = {found.system.atoms[key].name for key in more.keys}
    assert "tower-position" in names and more.total > curve.total + LEAST_NATS


def test_a_row_that_a_law_that_bends_reaches_after_all_is_no_gross_error():
    file, random = bench(0.005), np.random.default_rng(3)
    poses = random.uniform(-50.0, 50.0, (80, 3))
    problem = read(file, poses, [term("backlash", [0.05, 0.02, 0.08, 1.0])], random)
    problem.measured[20] += 0.5
    gross = np.zeros(80, dtype=bool)
    gross[[7, 20, 33]] = True
    fitted = fit(Model(file) + term("backlash", [0.01, 0.01, 0.01, 1.0]), problem.masked(gross), robust=False)
    left = still_missed(fitted, problem, fitted.noise, gross)
    assert np.flatnonzero(left).tolist() == [20]


def test_sets_of_which_a_curve_stands_aside_do_not_say_whether_the_whole_predicts(monkeypatch):
    found = explained(*rails(4.0))
    assert set(found.state.keys) == {"guide-straightness", "tower-position", "tower-tilt"}
    real = steps.cross_validate

    def hide(scorer, keys, key):
        trial = real(scorer, keys, key)
        unfaithful = replace(
            trial, with_it=trial.with_it + 3.0 * trial.count, without=trial.without + 4.0 * trial.count
        )
        return trial if "guide-straightness" in keys else unfaithful

    monkeypatch.setattr(steps, "cross_validate", hide)
    assert not hide(found.scorer, ["tower-tilt"], "tower-tilt").faithful
    assert steps.name_steps(found.scorer, found.state).faithful


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.long)])
def test_a_wide_play_of_one_slider_is_found_beside_a_wind_up(seed):
    """Along lines of short moves a play of 0.6 mm is taken up over several rows, as a wind-up would be."""
    file, random = bench(0.006), np.random.default_rng(seed)
    poses, share = [], np.linspace(0.0, 1.0, 8)[:, None]
    for number in range(24):
        begin, end = random.uniform(-20.0, 20.0, (2, 3))
        line = begin + share * (end - begin)
        poses += [line, line[::-1]] if number % 2 else [line]
    hidden = [term("backlash", [0.0, 0.0, 0.6, 1.0]), term("windup", [0.01, 0.06, 0.016, 1.7, 1.7, 1.7])]
    found = diagnose(Model(file), read(file, np.concatenate(poses), hidden, random))
    assert found.verdict == "missing" and {names[0] for names in found.suggested} == {"backlash", "windup"}


def erring_azimuth() -> tuple[MachineFile, Problem]:
    """A tracker's azimuth errs four times a turn: mostly along y."""
    file, random = bench(0.004), np.random.default_rng(2)
    poses = random.uniform(-50.0, 50.0, (220, 3))
    x, y, _ = (poses - [180.0, -60.0, 40.0]).T
    turned = np.hypot(x, y) * np.sin(4.0 * np.arctan2(y, x) + 0.5)
    errors = turned[:, None] * np.column_stack([-y, x, np.zeros(len(x))]) / np.hypot(x, y)[:, None]
    errors *= 0.042 / np.sqrt(np.square(errors).sum(axis=1).mean())
    measured = poses + errors + random.normal(0.0, 0.004, poses.shape)
    return file, build_problem(file, make_table(poses, measured=measured))


def test_an_unknown_is_told_with_the_part_of_effects_that_are_not_named(monkeypatch):
    """Without fields of one axis a block is found beside towers that are not named, which is a third of the error."""
    monkeypatch.setattr(blocks, "tool_axes", lambda tool: [])
    file, problem = erring_azimuth()
    found = diagnose(Model(file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ()) and "tower-position" in found.perhaps
    first = found.depends_on[0]
    assert first.residual == "y" and first.size is not None and first.size.rms is not None
    assert 1e3 * first.size.rms > 0.9 * found.rms_um["after"]["y"]


def growing(found: Term, seed: int) -> Problem:
    """A run of 200 poses on the bench, in whose course an effect grows from nothing."""
    file, random = bench(0.004), np.random.default_rng(seed)
    table = make_table(random.uniform(-50.0, 50.0, (200, 3)), time_s=12.0 * np.arange(200))
    view = build_view(file, table)
    whole = predict([(found.effect, found.theta)], view).p.numpy()
    share = (np.arange(200) / 199.0)[:, None]
    read = table.target + share * (whole - table.target)
    return build_problem(file, table.replace(measured=read + random.normal(0.0, 0.004, read.shape)))


def test_a_rail_that_bows_steadily_is_told_with_the_rail_and_the_time():
    problem = growing(term("tower-tilt", [0.0, 0.0, 0.0, 0.0, 0.0, 1e-2]), 1)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert first.acts_on == "rail 3 sideways" and first.on == "time" and first.share > 0.9


def test_what_a_screw_errs_each_turn_more_and_more_is_told_beside_its_mean():
    problem = growing(term("once-per-rev", [0.06, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0]), 1)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", (("once-per-rev",),))
    first = found.depends_on[0]
    assert first.acts_on == "slider 1" and first.together == ("time", "b1") and first.share > 0.8


def test_what_errs_along_one_axis_needs_no_towers_beside_it():
    file, problem = erring_azimuth()
    found = diagnose(Model(file), problem)
    assert (found.verdict, found.suggested, found.perhaps) == ("unknown", (), ())
    first = found.depends_on[0]
    assert (first.residual, first.acts_on) == ("y", "y") and first.share > 0.9
