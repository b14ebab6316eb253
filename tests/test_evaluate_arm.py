"""Runs of an arm before and after: what was sent and wanted, and how the reflector beside its tool point is turned."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.correct.training.compensator import Compensator
from ptt.door import model as door
from ptt.door.evaluating import measured
from ptt.effects import library
from ptt.errors import TableError
from ptt.judge.evaluate import evaluate_pair
from ptt.machine import MachineFile, load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model, Term
from ptt.run.table import Table, make_table, take_rows

ARM = load_machine(Path(__file__).resolve().parents[1] / "data" / "arm" / "machine.toml")
FILE = replace(ARM, tracker=ARM.tracker.model_copy(update={"frame": "trusted", "tool": "fitted", "sigma_mm": 0.01}))
ROBOT = build_mechanism(FILE.machine)
ZEROS = 2e-3 * np.array([0.5, -1.0, 0.7, 1.0, -0.8, 0.6])  # rad by which the joints stand off
SEAT, NOISE = np.array([25.0, -20.0, 30.0]), 0.01  # mm


def sent(q: np.ndarray, wanted: np.ndarray | None) -> Table:
    """Poses of the real arm, read at a reflector beside its tool point; (n, 3) mm that were wanted, or None."""
    place, turn = (each.numpy() for each in ROBOT.pose(torch.as_tensor(q + ZEROS)))
    reading = place + turn @ SEAT + np.random.default_rng(len(q)).normal(0.0, NOISE, place.shape)
    return make_table(wanted, q, measured=reading, joint_prefix="q")


@pytest.fixture(scope="module")
def runs() -> tuple[Table, Table]:
    """A run of joint commands alone, and one of corrected commands that has its targets, as `ptt predict` writes."""
    low, high = ROBOT.limits().numpy()
    q = np.random.default_rng(8).uniform(0.5 * low, 0.5 * high, (80, 6))
    wanted = ROBOT.forward(torch.as_tensor(q)).numpy()
    return sent(q, None), sent(q - ZEROS, wanted)


def solved() -> MachineFile:
    zero = Term(library()["homing-offset"](), torch.as_tensor(ZEROS))
    return write_model(Model(FILE) + zero, ["0" * 64])


def test_commands_alone_before_have_the_targets_that_the_run_after_states(runs: tuple[Table, Table]) -> None:
    before, after = runs
    found = evaluate_pair(before, after, FILE)
    assert found.to_dict()["protocol"]["rows"] == before.rows
    far = after.replace(target=after.target + 7.0)
    with pytest.raises(TableError, match="no pose in common"):
        evaluate_pair(before, far, FILE)


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("digits", [2, 3])
def test_rounded_commands_before_have_them_too(runs: tuple[Table, Table], digits: int, named: bool) -> None:
    """Commands in hundredths of a degree are found by their names or their order, in thousandths by the place, too."""
    before, after = runs
    name = np.array([f"P{row}" for row in range(before.rows)]) if named else before.name
    rounded = before.replace(command=np.radians(np.round(np.degrees(before.command), digits)), name=name)
    assert evaluate_pair(rounded, after.replace(name=name), FILE).to_dict()["protocol"]["rows"] == before.rows
    if digits == 3:
        part = take_rows(after.replace(name=name), np.arange(40)[::-1])
        assert evaluate_pair(rounded, part, FILE).to_dict()["protocol"]["rows"] == 40


def test_the_tool_is_turned_as_the_model_has_it(runs: tuple[Table, Table]) -> None:
    """Commands that put the tool point where it belongs turn the tool a little: 45 mm aside that is no error of it."""
    left = {}
    for name, file in (("drawing", FILE), ("model", solved())):
        axes = evaluate_pair(*runs, file).to_dict()["axes"]
        left[name] = float(np.linalg.norm([axis["after_um"] for axis in axes.values()]))
    assert left["model"] < 1e3 * NOISE * np.sqrt(3.0) and left["drawing"] > 2.0 * left["model"]


class OwnZero(library()["homing-offset"]):  # type: ignore[misc]
    name = "own-cause"


def test_an_effect_of_ones_own_turns_the_tool_where_its_file_is_given(runs: tuple[Table, Table]) -> None:
    known = {**library(), "own-cause": OwnZero}
    file = solved()
    own = replace(file, effect=tuple(each.model_copy(update={"name": "own-cause"}) for each in file.effect))
    model = door.Model(Compensator(read_model(own, known), None, {}), known)
    found = measured(*runs, model).result.to_dict()["axes"]
    assert found == evaluate_pair(*runs, file).to_dict()["axes"] != evaluate_pair(*runs, FILE).to_dict()["axes"]


def test_effects_of_ones_own_turn_no_tool_without_their_file(runs: tuple[Table, Table]) -> None:
    """Nor are they asked for: their file need not be there to compare two runs."""
    file = solved()
    own = replace(file, effect=tuple(each.model_copy(update={"name": "own-cause"}) for each in file.effect))
    assert evaluate_pair(*runs, own).to_dict()["axes"] == evaluate_pair(*runs, FILE).to_dict()["axes"]
