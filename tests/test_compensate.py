"""Corrected commands: the model's tool lands on its targets, and nobody compensates twice."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from ptt.chain import predict
from ptt.commands.main import app
from ptt.compensate import compensate, missing_context
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.errors import TableError, WorkspaceError
from ptt.machine import ControllerSpec, EffectEntry, ParameterEntry, load_machine, save_machine
from ptt.mechanisms import build_mechanism
from ptt.model import Model, Term, read_model
from ptt.table import Table, make_table, read_table
from ptt.view import build_view

DATA = Path(__file__).resolve().parents[1] / "data"
FILE = load_machine(DATA / "machine.toml")
TARGETS = read_table(DATA / "targets.csv", purpose="targets")
GAP = [0.04, 0.05, 0.03]


def with_effects(file=FILE, **parameters) -> Model:
    entries = tuple(
        EffectEntry(
            name=name.replace("_", "-"),
            parameters={key: ParameterEntry(value=value) for key, value in values.items()},
        )
        for name, values in parameters.items()
    )
    return read_model(replace(file, effect=entries))


def landing(model: Model, targets: Table, q: np.ndarray) -> np.ndarray:
    """Where the model's tool goes for commands q, (n, 3) mm."""
    view = build_view(model.file, replace(targets, command=q))
    return predict([(term.effect, term.theta) for term in model.terms], view).p.numpy()


STEADY = with_effects(
    homing_offset={"offset_mm": [0.3, -0.2, 0.1]},
    lead_scale={"scale": [6e-5, -4e-5, 3e-5]},
    link_length={"length_mm": [0.05, -0.08, 0.02]},
)
PLAY = with_effects(homing_offset={"offset_mm": [0.3, -0.2, 0.1]}, backlash={"gap_mm": GAP})


def test_the_bare_drawing_gets_its_own_inverse():
    commands = compensate(read_model(FILE), TARGETS)
    nominal = build_mechanism(FILE.machine).inverse(torch.tensor(TARGETS.target)).numpy()
    np.testing.assert_allclose(commands.q, nominal, atol=1e-9)
    assert commands.shift.max() < 1e-9 and not commands.reversal.any() and (commands.status == "ok").all()


@pytest.mark.parametrize("model", [STEADY, PLAY], ids=["steady", "play"])
def test_the_models_tool_lands_on_its_targets(model):
    commands = compensate(model, TARGETS)
    assert np.abs(landing(model, TARGETS, commands.q) - TARGETS.target).max() < 1e-6
    assert commands.missed.max() < 1e-6 and commands.shift.max() > 0.1


@settings(max_examples=15, deadline=None)
@given(
    offset=st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
    gap=st.lists(st.floats(0.0, 0.2), min_size=3, max_size=3),
    step=st.integers(1, 7),
)
def test_play_and_homing_are_inverted_exactly_on_any_path(offset, gap, step):
    model = with_effects(homing_offset={"offset_mm": offset}, backlash={"gap_mm": gap})
    path = TARGETS.target[::step]
    targets = make_table(np.concatenate([path, path[-2::-1]]))
    commands = compensate(model, targets)
    assert np.abs(landing(model, targets, commands.q) - targets.target).max() < 1e-6


def test_reversal_is_half_the_gap_ahead_of_the_travel():
    commands = compensate(PLAY, TARGETS)
    moving = np.abs(np.diff(commands.q - commands.reversal, axis=0, prepend=np.nan)) > 1e-3
    moving[0] = False
    step = np.sign(np.diff(commands.q - commands.reversal, axis=0, prepend=0.0))
    expected = step * np.array(GAP) / 2
    np.testing.assert_allclose(commands.reversal[moving], expected[moving], atol=1e-6)
    assert "in these commands: backlash" in commands.reversal_note


@pytest.mark.parametrize("reversal", [None, "software"])
def test_what_the_controller_compensates_is_never_added_twice(reversal):
    file = replace(PLAY.file, controller=ControllerSpec(compensates=("backlash",)))
    commands = compensate(read_model(file), TARGETS, reversal=reversal)
    assert not commands.reversal.any() and "left to the controller: backlash" in commands.reversal_note


def test_reversal_none_leaves_it_out():
    with_it, without = compensate(PLAY, TARGETS), compensate(PLAY, TARGETS, reversal="none")
    assert not without.reversal.any()
    np.testing.assert_allclose(with_it.q - with_it.reversal, without.q, atol=1e-9)


def test_a_tracker_effect_is_not_inverted():
    scale = make_effect(library(), "tracker-scale")
    term = Term(scale, torch.full((sum(p.size(3) for p in scale.parameters),), 1e-3, dtype=torch.float64))
    np.testing.assert_array_equal(compensate(STEADY + term, TARGETS).q, compensate(STEADY, TARGETS).q)


def test_a_correction_shifts_what_the_model_is_asked_for():
    def correct(wanted):
        return wanted + np.array([0.0, 0.0, 0.25])

    commands = compensate(STEADY, TARGETS, correction=correct, inside=lambda wanted: wanted[:, 0] > 0)
    np.testing.assert_allclose(landing(STEADY, TARGETS, commands.q), correct(TARGETS.target), atol=1e-6)
    np.testing.assert_array_equal(commands.in_domain, TARGETS.target[:, 0] > 0)


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_the_first_order_form_differs_by_the_third_order_of_the_correction(size):
    commands = compensate(with_effects(), TARGETS, correction=lambda p: p + size / np.sqrt(3.0))
    assert 0 < commands.first_order_gap.max() < 5e-5 * size**3 / 2**3  # 0.05 um at 2 mm
    np.testing.assert_allclose(commands.first_order, commands.q, atol=1e-4)


def test_unreachable_targets_are_named_by_line():
    far = TARGETS.target.copy()
    far[[3, 8]] = [900.0, 0.0, 0.0]
    with pytest.raises(WorkspaceError, match="lines 5, 10") as raised:
        compensate(STEADY, replace(TARGETS, target=far))
    assert raised.value.rows == (3, 8)


def test_a_row_without_target_is_named():
    blind = TARGETS.target.copy()
    blind[4] = np.nan
    with pytest.raises(TableError, match="row 6"):
        compensate(STEADY, replace(TARGETS, target=blind))


def test_what_the_targets_do_not_tell_is_said():
    model = read_model(FILE) + make_effect(library(), "screw-growth")
    assert "temp_c: 20 C is assumed" in missing_context(model, TARGETS)[0]
    assert missing_context(model, TARGETS.replace(temp_c=np.full(TARGETS.rows, 21.0))) == []


def test_predict_writes_the_documented_columns_without_loss(tmp_path):
    save_machine(PLAY.file, tmp_path / "m.toml")
    out = tmp_path / "s.csv"
    args = ["predict", str(DATA / "targets.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]
    result = CliRunner().invoke(app, args)
    assert result.exit_code == 0 and "exact inversion" in result.stdout and "J_a at p - dp/2" in result.stdout
    frame, given = (pd.read_csv(path, dtype=str) for path in (out, DATA / "targets.csv"))
    added = ["b1", "b2", "b3", "reversal1", "reversal2", "reversal3", "in_domain", "status", "shift_um"]
    assert list(frame) == [*given, *added]
    pd.testing.assert_frame_equal(frame[["name", "role"]], given[["name", "role"]])
    places = ["x_cmd", "y_cmd", "z_cmd"]
    np.testing.assert_array_equal(frame[places].astype(float), given[places].astype(float))
    commands = compensate(PLAY, TARGETS)
    np.testing.assert_array_equal(frame[["b1", "b2", "b3"]].astype(float), commands.q)
    np.testing.assert_array_equal(frame[["reversal1", "reversal2", "reversal3"]].astype(float), commands.reversal)
    read = read_table(out, purpose="sliders")
    np.testing.assert_array_equal(read.command, commands.q)
