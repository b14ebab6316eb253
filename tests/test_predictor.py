"""The prepared predictor: the numbers of `ptt predict`, however the rows come."""

import shutil

import numpy as np
import pytest
import torch

from ptt.correct.compensate import compensate
from ptt.correct.predictor import Predictor
from ptt.correct.training.compensator import Compensator
from ptt.effects.drive import FollowingError
from ptt.effects.reversal import Backlash
from ptt.effects.structure import ColumnBend
from ptt.effects.towers import TowerTilt
from ptt.errors import InputError, PttError
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model, Term
from ptt.run.table import make_table

COMPILED = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")


def _compensator(file: MachineFile) -> Compensator:
    model = Model(file)
    for effect, values in (
        (TowerTilt(), [2e-3, -1e-3, 1e-3, 3e-3, -2e-3, 1e-3]),
        (Backlash(), [0.04, 0.05, 0.06, 1.0]),
        (ColumnBend(), [2e-3, 1e-3, 1e-5, 2e-5]),
    ):
        model = model + Term(effect, torch.tensor(values, dtype=torch.float64))
    return Compensator(model, None, {})


def _targets(file: MachineFile) -> np.ndarray:
    time = np.linspace(0.0, 9.0, 90)[:, None]
    heights = 280.0 + 40.0 * np.sin(time * np.array([1.0, 1.3, 0.7]) + np.array([0.0, 1.0, 2.0]))
    return build_mechanism(file.machine).forward(torch.tensor(heights)).numpy()


@COMPILED
def test_rows_one_by_one_in_blocks_and_at_once_are_those_of_predict(bench: MachineFile) -> None:
    compensator, targets = _compensator(bench), _targets(bench)
    expected = compensate(compensator.model, make_table(targets, payload_kg=2.0)).q
    predict = Predictor(compensator)
    predict.load(payload_kg=2.0)
    np.testing.assert_allclose(predict(targets), expected, rtol=0.0, atol=1e-9)
    predict.start()
    blocks = np.concatenate([predict(block) for block in np.split(targets, [1, 20, 55])[1:]])
    np.testing.assert_allclose(blocks[1:], expected[2:], rtol=0.0, atol=1e-9)
    predict.start()
    single = np.stack([predict(row) for row in targets])
    np.testing.assert_allclose(single[2:], expected[2:], rtol=0.0, atol=1e-9)
    assert predict.code == 0
    assert np.isnan(predict((900.0, 0.0, 0.0))).all() and predict.code == 2


@COMPILED
def test_effects_that_need_the_rows_ahead_are_refused(bench: MachineFile) -> None:
    lag = Term(FollowingError(), torch.tensor([0.02, 0.02, 0.02, 0.0], dtype=torch.float64))
    with pytest.raises(InputError, match=r"following-error.*ptt predict"):
        Predictor(Compensator(Model(bench) + lag, None, {}))


@COMPILED
def test_targets_of_another_shape_are_refused(bench: MachineFile) -> None:
    predictor = Predictor(_compensator(bench))
    for target in (np.zeros((4, 2)), np.zeros((4, 4)), np.zeros(2), (0.0, 0.0, 0.0, 0.0), np.zeros((1, 2, 3))):
        with pytest.raises(InputError, match="mm"):
            predictor(target)  # type: ignore[arg-type]


def test_without_a_compiler_the_way_out_is_named(bench: MachineFile, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(PttError, match="no C compiler"):
        Predictor(_compensator(bench))
