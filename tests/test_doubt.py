"""What hidden rows cannot show: how far the tool may be from where an explanation has it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from ptt.challenge.cases import draw, plan
from ptt.challenge.remeasure import remeasure
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.held_out import held_out_rms, lowers_held_out_error
from ptt.diagnosis.evidence.held_out_trial import HeldOutMemo
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.find import find
from ptt.diagnosis.telling.doubt import tool_doubt
from ptt.diagnosis.telling.exchange import Exchange, exchanged_doubt
from ptt.diagnosis.telling.steps import _lowering_error
from ptt.door.diagnosing import format_diagnosis
from ptt.effects import library
from ptt.effects.sudden import ALWAYS
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.rig import simulate
from ptt.run.problem import build_problem
from ptt.show.card.result import card_of_diagnosis


def test_towers_that_one_run_tells_leave_no_doubt_where_the_tool_is(monkeypatch):
    drawn, truth = draw(plan("single", 1, 950001)[0])  # what all towers have in common is a rigid motion: of no account
    file = drawn.rig.machine
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = find(Model(file), problem, library(), lambda what: None)
    # A tracker's scale, which no reading asks for and towers would in part make good for, may be there.
    assert tool_doubt(found.scorer, found.state) < 0.2 * truth.noise.total
    monkeypatch.setattr("ptt.diagnosis.telling.doubt.absent_effects", lambda scorer, state: ())
    assert tool_doubt(found.scorer, found.state) < 0.1 * truth.noise.total


def test_a_slip_that_may_be_a_knock_is_a_doubt_of_what_commands_of_it_reach(monkeypatch):
    drawn, _ = draw(plan("multi", 1, 950020)[0])
    tracker = drawn.rig.machine.tracker.model_copy(update={"sigma_mm": 0.0038})  # half of what one reading scatters by
    file, seen = replace(drawn.rig.machine, tracker=tracker), {}
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    monkeypatch.setattr("ptt.diagnosis.diagnose.find", lambda *of: seen.setdefault("found", find(*of)))
    result = diagnose(Model(file), problem)
    assert result.suggested == (("homing-slip", "setup-jump"),)
    found, last = seen["found"], result.candidates[0]
    plain, doubt = held_out_rms(found.scorer, found.state.keys), tool_doubt(found.scorer, found.state)
    assert last.heldout_after == pytest.approx(1e3 * plain) and last.tool_doubt == pytest.approx(1e3 * doubt)
    assert last.to_dict()["heldout_rms_um"]["after"] == pytest.approx(1e3 * plain)
    words = f"the readings leave the tool position uncertain by up to {1e3 * doubt:.1f} um"
    assert doubt > plain and words in last.words and words in format_diagnosis(result)
    assert words[1:].replace("um", "\N{MICRO SIGN}m") in card_of_diagnosis(result, problem).words.replace("\xa0", " ")
    assert remeasure(result.model, drawn).to_dict()["after"]["total"] < 1.5e3 * np.hypot(plain, doubt)


def test_beside_an_unknown_commands_are_of_the_values_that_the_held_out_error_is_of():
    drawn, _ = draw(plan("unknown", 1, 950001, kinds="all")[0])  # a slider that sinks under another, told as a block
    file = drawn.rig.machine
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    result = diagnose(Model(file), problem)
    assert (result.verdict, result.suggested) == ("unknown", (("platform-twist",),))
    own, (term,) = [one.value for one in result.candidates[0].parameters], result.model.terms
    assert not np.allclose(own, term.theta.numpy(), rtol=0.1)
    tool = remeasure(result.model, drawn).to_dict()
    assert all(one.tool_doubt is None for one in result.candidates[1:])
    assert tool["after"]["total"] < 1.2 * result.candidates[0].heldout_after < 0.7 * tool["before"]["total"]
    # Nobody turns anything for columns that no machine explains: that is said first, and no cure.
    card, off = (card_of_diagnosis(each, problem) for each in (result, result.with_unexplained("columns disagree.")))
    assert card.findings[0].cure and not off.findings[0].cure
    assert off.words == f"Columns disagree. {card.words}"


@pytest.mark.parametrize(
    ("after", "doubt", "is_lower"),
    [((1.0, 1.0, 1.0, 1e6), 0.0, True), ((1.0, 1.0, 1e6, 1e6), 0.0, False), ((1.0, 1.0, 1.0, 1.0), 0.2, False)],
    ids=["one end of the travel", "two places", "what no reading shows"],
)
def test_a_curve_that_strays_at_one_end_of_the_travel_takes_no_other_name_along(after, doubt, is_lower):
    rows, before = np.full(4, 100), np.full(4, 4.0)
    scorer = SimpleNamespace(
        score=lambda keys, memory: SimpleNamespace(keys=keys),
        held_out_memo=HeldOutMemo(squares={(): (before, rows), ("map", "play"): (np.array(after), rows)}),
    )
    assert lowers_held_out_error(scorer, ("map", "play"), doubt) is is_lower


@pytest.mark.parametrize(
    ("after", "kept"),
    [((4.0, 4.0, 4.0, 1e6), True), ((8.0, 8.0, 8.0, 8.0), True), ((1.0, 1.0, 30.0, 1e6), False)],
    ids=["one end of the travel", "a little", "by half"],
)
def test_a_name_that_raises_what_the_one_before_it_lowers_is_not_told_beside_an_unknown(after, kept):
    rows, first = np.full(4, 100), ("map",)
    squares = {(): np.full(4, 100.0), first: np.full(4, 4.0), ("map", "play"): np.array(after)}
    scorer = SimpleNamespace(
        score=lambda keys, memory: SimpleNamespace(keys=keys),
        held_out_memo=HeldOutMemo(squares={keys: (each, rows) for keys, each in squares.items()}),
    )
    assert _lowering_error(scorer, ["map", "play"], 0.0) == (["map", "play"] if kept else ["map"])


def numbers(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


@pytest.mark.parametrize("frame", ["trusted", "fitted"])
def test_a_slip_that_may_have_been_the_knock_is_a_doubt_of_all_poses(frame):
    """However few rows saw it: it is a zero that is off once the run is over, less what a fitted frame takes."""
    drawn, _ = draw(plan("multi", 1, 950020)[0])
    tracker = drawn.rig.machine.tracker.model_copy(update={"frame": frame})
    file = replace(drawn.rig.machine, tracker=tracker)
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    late = float(problem.view.time.max()) - 1.0
    slip, none = (
        Term(library()["homing-slip"](), torch.tensor([size, 0.0, 0.0, late], dtype=torch.float64))
        for size in (0.05, 0.0)
    )
    knock = Term(library()["setup-jump"](), torch.tensor([0.1, 0.0, 0.0, 0.0, 0.0, 0.0, late], dtype=torch.float64))
    found = SimpleNamespace(fitted=SimpleNamespace(model=SimpleNamespace(terms=(slip, knock))))
    doubt = exchanged_doubt(found, [Exchange(1.0, (none, knock))], problem)
    offset = library()["homing-offset"]()
    moved = [
        predict([(offset, torch.tensor([size, 0.0, 0.0], dtype=torch.float64))], problem.view).p.numpy()
        for size in (0.05, 0.0)
    ]
    whole = np.sqrt(0.5 * np.square(moved[0] - moved[1])[problem.used].sum(axis=1).mean())
    assert doubt == pytest.approx(whole) if frame == "trusted" else 0.0 < doubt < 0.7 * whole
    assert exchanged_doubt(found, [], problem) == 0.0


def test_what_slipped_late_is_all_along_once_the_run_is_over():
    """Few rows saw it, and all poses are off by what these leave open."""
    drawn, _ = draw(plan("multi", 1, 950020)[0])
    file = drawn.rig.machine
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = find(Model(file), problem, library(), lambda what: None)
    system = found.system
    slip = next(system.atoms[key] for key in found.state.keys if system.atoms[key].name == "homing-slip")
    during, after = system.sums_of(slip.columns, WHITE).gram, system.gram_after(slip.columns)
    whole = system.at.columns(slip.effect, ALWAYS)[system.rows]
    np.testing.assert_allclose(after, np.tensordot(whole, whole, axes=((0, 1), (0, 1))), rtol=1e-9)
    assert (after.diagonal() > 1.2 * during.diagonal()).all()
    assert system.gram_after(system.frame) == pytest.approx(system.sums_of(system.frame, WHITE).gram)
