"""Circles and helices that are read on the way: sliders turn between rows, where no difference of rows shows it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from conftest import BENCH as TEXT

from ptt.correct.compensate import compensate
from ptt.correct.exports.c.effects import SMOOTH_WAY, parts_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.search import smooth_way
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.found import Found
from ptt.effects.registry import library, make_effect
from ptt.effects.reversal import Backlash
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.entries import write_model
from ptt.model.model import Model, Term
from ptt.run.problem import Problem, build_problem
from ptt.run.smooth import smoothly
from ptt.run.table import make_table
from ptt.run.viewing import build_view

BENCH = parse_machine(TEXT, "bench.toml")
MECHANISM = build_mechanism(BENCH.machine)
GAP = np.array([0.06, 0.03, 0.05])  # mm
PIECES = 300  # of a way from row to row


def way(rows: int, laps: float, rise: float = 0.0, pieces: int = PIECES) -> np.ndarray:
    """Points of a helix, or of circles, `pieces` to a row, (1 + (rows - 1) pieces, 3) mm."""
    part = np.linspace(0.0, 1.0, 1 + (rows - 1) * pieces)
    turn = 2.0 * np.pi * laps * part
    return np.column_stack([45.0 * np.cos(turn), 45.0 * np.sin(turn), rise * (part - 0.5)])


def read(points: np.ndarray, pieces: int, smooth: bool) -> Problem:
    """Readings of nuts with play that are led through points; or from row to row, each slider evenly."""
    random, height = np.random.default_rng(3), MECHANISM.inverse(torch.as_tensor(points)).numpy()
    rows = height[::pieces]
    led = height if smooth else rows
    nut, reached = led[0] + 0.5 * GAP, []
    for place in led:
        nut = np.clip(nut, place - 0.5 * GAP, place + 0.5 * GAP)
        reached.append(nut)
    there = np.array(reached)[:: pieces if smooth else 1]
    measured = MECHANISM.forward(torch.as_tensor(there)).numpy() + random.normal(0.0, 0.003, there.shape)
    return build_problem(BENCH, make_table(points[::pieces], measured=measured))


def test_a_run_that_is_seen_smoothly_is_as_fast_as_its_own_file_has_it() -> None:
    """Ten rows to a lap turn by more than is a corner elsewhere: what is found and what is added mean one speed."""
    points = np.column_stack([1.2, 0.8, 1.0]) * way(100, 10.0, 40.0, 1)
    table = make_table(points, feed_mm_s=np.repeat([10.0, 20.0], 50), measured=points)
    seen = smoothly(build_problem(BENCH, table))
    assert seen is not None
    own = build_view(seen.file, table)
    torch.testing.assert_close(seen.view.velocity, own.velocity)
    torch.testing.assert_close(seen.view.paces, own.paces)
    assert (seen.view.velocity - build_view(BENCH, table).velocity).abs().max() > 0.1


def test_speeds_by_feeds_of_a_machine_that_stood_are_those_of_its_own_file_too() -> None:
    """By the clock it waited at every row; a lag that follows the feeds is tried nevertheless."""
    points = np.column_stack([1.2, 0.8, 1.0]) * way(100, 10.0, 40.0, 1)
    table = make_table(points, feed_mm_s=np.repeat([10.0, 20.0], 50), time_s=30.0 * np.arange(100.0), measured=points)
    given = build_problem(BENCH, table)
    seen = smoothly(given)
    assert seen is not None and not seen.view.velocity.any()
    assert given.view.fed is not None and seen.view.fed is not None
    torch.testing.assert_close(seen.view.fed, build_problem(seen.file, table).view.fed)
    assert (seen.view.fed - given.view.fed).abs().max() > 0.1


def test_turns_on_a_smooth_way_lie_where_the_way_has_them() -> None:
    points = way(130, 6.0, 40.0)
    file = replace(BENCH, machine=BENCH.machine.model_copy(update={"moves": "smooth"}))
    view = build_view(file, make_table(points[::PIECES]))
    height = MECHANISM.inverse(torch.as_tensor(points)).numpy()
    pieces = np.stack([height[first : first + PIECES + 1] for first in range(0, len(height) - 1, PIECES)])
    step = np.sign(np.diff(pieces, axis=1))
    against = step != step[:, -1:]
    last = step.shape[1] - 1 - np.argmax(against[:, ::-1], axis=1)
    turn = np.where(against.any(axis=1), np.take_along_axis(pieces, last[:, None] + 1, axis=1)[:, 0], pieces[:, -1])
    clear = np.abs(turn - pieces[:, -1]) > 0.05
    assert clear.sum() > 20
    np.testing.assert_allclose(view.turning_point[1:].numpy()[clear], turn[clear], rtol=0.0, atol=0.02)
    np.testing.assert_array_equal(view.direction[1:].numpy()[clear], step[:, -1][clear])


@pytest.mark.parametrize(("rise", "smooth"), [
    (0.0, True), pytest.param(50.0, True, marks=pytest.mark.long),
    pytest.param(0.0, False, marks=pytest.mark.long), (50.0, False),
])  # fmt: skip
def test_play_on_circles_is_named_whichever_way_the_sliders_went(rise: float, smooth: bool) -> None:
    problem = read(way(160, 8.0, rise), PIECES, smooth)
    assert smoothly(problem) is not None
    found = diagnose(Model(BENCH), problem)
    assert (found.verdict, found.suggested) == ("missing", (("backlash",),))
    gaps = [value for value in found.candidates[0].parameters if value.name.startswith("gap")]
    np.testing.assert_allclose([value.value for value in gaps], GAP, atol=0.004)
    assert ('`moves = "smooth"`' in found.words) is smooth
    assert found.model.file.machine.moves == ("smooth" if smooth else "sliders")


def test_names_that_suffice_are_not_asked_again_where_turns_fit_no_better(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise AssertionError("asked again")

    monkeypatch.setattr(smooth_way, "find", refuse)
    assert diagnose(Model(BENCH), read(way(160, 8.0), PIECES, smooth=False)).suggested == (("backlash",),)
    with pytest.raises(AssertionError, match="asked again"):
        diagnose(Model(BENCH), read(way(160, 8.0), PIECES, smooth=True))


@pytest.mark.parametrize("names", [True, False])
def test_an_unknown_is_asked_again_where_names_then_say_all(monkeypatch: pytest.MonkeyPatch, names: bool) -> None:
    asked = list[Model]()

    def find_again(model: Model, problem: Problem, *others: object) -> Found:
        asked.append(model)
        return find(model, problem, library(), lambda what: None)

    monkeypatch.setattr(smooth_way, "find", find_again)
    monkeypatch.setattr(smooth_way, "holds_unknown", lambda *of: True)
    monkeypatch.setattr(smooth_way, "_turns_say_more", lambda *of: False)
    monkeypatch.setattr(smooth_way, "named_effects_suffice", lambda *of: names)
    diagnose(Model(BENCH), read(way(160, 8.0), PIECES, smooth=False))
    assert [model.file.machine.moves for model in asked] == ["smooth"] * names


def test_a_gross_error_asks_again_only_where_joints_came_to_it_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[Model]()
    monkeypatch.setattr(smooth_way, "find", lambda model, *others: asked.append(model))
    monkeypatch.setattr(smooth_way, "holds_unknown", lambda *of: False)
    monkeypatch.setattr(smooth_way, "is_denser", lambda *of: False)
    nothing = SimpleNamespace(
        sample=None, system=SimpleNamespace(atoms={}), state=SimpleNamespace(keys=(), memory=None)
    )
    here = read(way(160, 8.0), PIECES, smooth=False)
    there = smoothly(here)
    assert there is not None
    came = (here.view.direction != there.view.direction) | (here.view.turning_point != there.view.turning_point)
    otherwise = came.any(dim=1).numpy()
    assert 0 < otherwise.sum() < len(otherwise)
    for row in np.flatnonzero(otherwise)[:1].tolist() + np.flatnonzero(~otherwise)[:1].tolist():
        asked.clear()
        found = SimpleNamespace(**vars(nothing), gross=np.arange(len(otherwise)) == row)
        smooth_way.on_smooth_way(found, Model(BENCH), here, library(), lambda what: None, 3)
        assert [model.file.machine.moves for model in asked] == ["smooth"] * int(otherwise[row])


@pytest.mark.parametrize("smooth", [True, False])
def test_play_that_is_added_says_in_the_file_how_the_sliders_went(smooth: bool) -> None:
    named = parse_machine(TEXT.replace("[machine]", "# ours\n[machine]"))
    problem = replace(read(way(160, 8.0), PIECES, smooth), file=named)
    ladder = climb(Model(named), problem, [make_effect(library(), "backlash")])
    written = format_machine(write_model(ladder.model))
    assert ('moves = "smooth"' in written) is smooth and "# ours" in written
    assert parse_machine(written).machine.moves == ("smooth" if smooth else "sliders")
    assert any("smooth path" in note for note in ladder.notes) is smooth
    assert ladder.steps[-1].heldout_rms_um["total"] < 7.0


def test_commands_know_the_turns_of_their_way_and_firmware_does_not() -> None:
    file = replace(BENCH, machine=BENCH.machine.model_copy(update={"moves": "smooth"}))
    model = Model(file, (Term(Backlash(), torch.tensor([*GAP, 1.0])),))
    points = way(130, 6.0, 40.0, 1)
    sent = compensate(model, make_table(points))
    reached = predict([(term.effect, term.theta) for term in model.terms], build_view(file, make_table(None, sent.q)))
    assert np.mean(np.abs(reached.p.numpy() - points).max(axis=1) < 1e-6) > 0.98
    assert parts_of(model).cannot == {"backlash": SMOOTH_WAY}
