"""What other set-ups of the tracker leave of a model, beside a verdict."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import ptt
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.other_setups import by_base, by_mount
from ptt.door.diagnosing import format_diagnosis
from ptt.effects import library
from ptt.fleet.again import recheck_or_diagnose
from ptt.fleet.overview import overview
from ptt.fleet.run import run_all
from ptt.fleet.store import add_machine, add_run, create_store
from ptt.machine import load_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.written import table_to_frame
from ptt.show.report.about_verdict import in_short
from ptt.show.report.words import words_of

KUKA = Path(__file__).resolve().parents[1] / "data" / "machines" / "kuka_iiwa.toml"
ARM = load_machine(KUKA)
TRUSTED = KUKA.read_text().replace('frame = "fitted"\ntool = "fitted"', 'frame = "trusted"\nsigma_mm = 0.02')


def read(tool: tuple[float, float, float], zeros: float, trusted: str) -> tuple[Model, Problem]:
    """An arm of the modified convention, whose last joint turns behind all its links; how far off its tool sits."""
    machine = ARM.machine.model_copy(update={"convention": "modified"})
    tracker = ARM.tracker.model_copy(update={"frame": "trusted", "tool": trusted, "sigma_mm": 0.02})
    file, random = replace(ARM, machine=machine, tracker=tracker), np.random.default_rng(1)
    off = machine.model_copy(update={"tool_mm": tuple(np.add(machine.tool_mm, tool))})
    q = random.uniform(-1.5, 1.5, (60, 7))
    there = build_mechanism(off).forward(torch.as_tensor(q + zeros)).numpy()
    measured = there + random.normal(0.0, 0.02, there.shape)
    return Model(file), build_problem(file, make_table(None, q, measured=measured))


@pytest.mark.parametrize(
    ("tool", "zeros", "trusted", "told"),
    [
        ((0.15, -0.05, 0.0), 0.0, "trusted", True),
        ((0.15, -0.05, 0.0), 0.0, "fitted", False),
        ((0.0, 0.0, 0.0), 0.0, "trusted", False),
        ((0.0, 0.0, 0.0), 5e-4, "trusted", False),
    ],
)
def test_a_trusted_reflector_is_asked_for_where_its_place_would_explain_the_error(
    tool: tuple[float, float, float], zeros: float, trusted: str, told: bool
) -> None:
    model, problem = read(tool, zeros, trusted)
    words = by_mount(model, problem)
    assert ("the error of the model as given is 3" in words and 'tool = "fitted"' in words) is told
    assert (words == "") is not told
    assert by_base(model, problem) == ""


def test_a_free_reflector_is_said_before_an_effect_is_added(tmp_path: Path) -> None:
    """The diagnosis begins with it and offers no command; the ladder notes it."""
    model, problem = read((0.6, -0.5, 0.0), 0.0, "trusted")
    found = diagnose(model, problem)
    assert found.first.startswith('With tool = "trusted"') and found.words.startswith(found.first)
    assert "next: ptt add" not in format_diagnosis(found) and found.first in in_short(found) and found.to_add == []
    named = in_short(replace(found, verdict="missing", suggested=(("backlash",),)))
    assert "As the machine file stands, backlash would take the error" in named and "Add backlash" not in named
    (tmp_path / "machine.toml").write_text(TRUSTED)
    rows, notes = table_to_frame(problem.table.replace(joint_prefix="q")), list[str]()
    ptt.add(ptt.load(tmp_path / "machine.toml"), rows, "homing-offset", note=notes.append)
    assert found.first in notes


def test_a_free_reflector_is_said_beside_joint_zeros_that_are_most_of_the_error() -> None:
    model, problem = read((0.6, -0.5, 0.0), 2e-3, "trusted")
    assert by_mount(model, problem) == ""
    found = diagnose(model, problem)
    assert "homing-offset" in {name for step in found.suggested for name in step} and found.to_add == []
    assert "the error of the model with the named effects is" in found.first
    assert "named effects" not in words_of("zh")(found.first)


def test_a_store_adds_nothing_before_the_reflector_is_settled(tmp_path: Path) -> None:
    """Neither from a first run nor from a later one; a later run's alarm names no effect as added."""
    store = create_store(tmp_path / "plant")
    (tmp_path / "arm.toml").write_text(TRUSTED)
    add_machine(store, "arm", tmp_path / "arm.toml")
    _, problem = read((0.6, -0.5, 0.0), 2e-4, "trusted")
    for day in ("2026-03-01", "2026-04-01"):
        table = problem.table.replace(joint_prefix="q", measured=problem.table.measured + 1e-4 * int(day[6]))
        path = tmp_path / f"arm-{day}.csv"
        table_to_frame(table).to_csv(path, index=False)
        add_run(store, "arm", path, table, None, ordered=False, units_said=False)
    run_all(store)
    (arm,) = overview(store).machines
    first, later = arm.past
    assert first.verdict == "unknown" and later.verdict == "new"
    assert all(run.words.startswith('With tool = "trusted"') and run.added == () for run in arm.past)
    (told,) = store.ask("SELECT result->'suggested' AS named FROM rechecks")
    assert json.loads(told["named"]), "joint zeros are off, too, and would be added"
    (solved,) = store.ask("SELECT toml FROM models WHERE made = 'solved'")  # the drawing, from the first run
    assert parse_machine(solved["toml"], "solved").effect == ()


def test_a_later_run_whose_columns_disagree_adds_nothing_either(monkeypatch: pytest.MonkeyPatch) -> None:
    model, problem = read((0.0, 0.0, 0.0), 5e-4, "fitted")
    monkeypatch.setattr("ptt.fleet.again.diagnose_run", lambda *of, **more: diagnose(*of))
    plain = recheck_or_diagnose(model, problem, library(), lambda what: None)
    assert plain.added and plain.verdict == "new"
    found = diagnose(model, problem)
    unknown = replace(found, verdict="unknown")
    monkeypatch.setattr("ptt.fleet.again.diagnose_run", lambda *of, **more: unknown)
    told = recheck_or_diagnose(model, problem, library(), lambda what: None, "columns disagree")
    assert told.added == [] and told.words.startswith("Columns disagree")
