"""Recheck of a machine that winds up: play that is new is no more of it, and one value is named alone."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from test_recheck import look, run_of, solve

from ptt.again.artefacts import drop_artefacts
from ptt.again.explanation import find_explanation
from ptt.again.prior import build_prior
from ptt.effects import library
from ptt.model.of_run import for_runs

WOUND = {
    "drive": {"backlash_mm": (0.0, 0.0, 0.0), "windup_um": (9.6, 2.1, 5.9), "windup_length_mm": (1.1, 1.1, 1.1),
              "homing_mm": (-0.27, 0.0, 0.0)},
    "geometry": {"link_mm": (0.0, 0.0, 0.0)},
}  # fmt: skip


@pytest.fixture(scope="module")
def wound(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """The model of a machine whose drives wind up, one of whose sliders was homed wrongly."""
    return solve(run_of(1, 120, **WOUND), ("windup", "homing-offset"), tmp_path_factory.mktemp("wound"))


def test_play_that_is_new_is_no_greater_windup_and_no_change_stays_beside_it_in_vain(wound: SimpleNamespace) -> None:
    """Of the grown windup and the new play neither is worth 25 nats more: the readings decide."""
    problem = run_of(3, 300, drive={**WOUND["drive"], "backlash_mm": (0.0, 0.04, 0.0)}, geometry=WOUND["geometry"])
    found = look(wound, problem)
    assert found.verdict == "new" and not found.changed and found.suggested[0][0] == "backlash"
    model, _ = for_runs(wound.model, problem)
    explained = find_explanation(build_prior(model, problem), problem, library(), str)
    vain = explained.scorer.score([*explained.state.keys, "changed: windup height_mm 2"], explained.state.memory)
    assert found.new is not None
    sure = drop_artefacts(replace(explained, state=vain), found.new, problem, library(), str)
    assert sure.state.keys == explained.state.keys and sure.prior.model.keys == explained.prior.model.keys


def test_one_value_is_named_alone_where_its_whole_effect_would_do_as_well(wound: SimpleNamespace) -> None:
    moved = {**WOUND["drive"], "homing_mm": (-0.40, 0.0, 0.0)}
    found = look(wound, run_of(5, drive=moved, geometry=WOUND["geometry"]))
    (change,) = found.changed
    assert (change.moved.name, change.repaired) == ("offset_mm 1", False)
    assert change.moved.now - change.moved.before == pytest.approx(-0.13, abs=4.0 * change.moved.std)
    assert "homing-offset as a whole" in change.indistinguishable_from


def test_the_evidence_for_a_change_is_enough_whatever_hidden_readings_say(wound, monkeypatch) -> None:
    """What was uncertain then predicts hidden readings as well as a change does, only not as probably."""
    monkeypatch.setattr("ptt.diagnosis.telling.steps.held_out_rms", lambda scorer, keys: 1.0)
    moved = {**WOUND["drive"], "homing_mm": (-0.40, 0.0, 0.0)}
    found = look(wound, run_of(5, drive=moved, geometry=WOUND["geometry"]))
    assert found.verdict == "changed" and [item.moved.name for item in found.changed] == ["offset_mm 1"]
