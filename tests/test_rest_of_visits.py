"""Readings that were taken one after the other at a stop are one witness of what a machine does there."""

from types import SimpleNamespace

import numpy as np
from made_runs import machine

from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.search.rest import rest_left
from ptt.run.problem import build_problem
from ptt.run.table import make_table

POSES, READINGS = 100, 3


def test_a_stop_that_errs_by_itself_is_no_dependence_however_often_it_is_read() -> None:
    """Each of two visits to a pose lands 6 um aside at random, and its readings scatter by 1 um."""
    taken, each = list[bool](), list[bool]()
    for seed in range(8):
        random = np.random.default_rng(seed)
        poses = random.uniform(-60.0, 60.0, (POSES, 3))
        target = np.repeat(np.concatenate([poses, poses[random.permutation(POSES)]]), READINGS, axis=0)
        lands = np.repeat(random.normal(0.0, 0.006, (2 * POSES, 3)), READINGS, axis=0)
        residual = lands + random.normal(0.0, 0.001, lands.shape)
        table = make_table(target, measured=target + residual, time_s=2.0 * np.arange(len(target)))
        problem = build_problem(machine(), table)
        for found, memory in ((taken, Memory(None, 30.0)), (each, WHITE)):
            found.append(
                rest_left(residual, SimpleNamespace(memory=memory, effective_parameters=0.0), problem).significant
            )
    assert not any(taken) and sum(each) >= 6
    # What visits do together is told as before.
    drifts = residual + 0.02 * np.linspace(-1.0, 1.0, len(target))[:, None]
    assert (
        rest_left(drifts, SimpleNamespace(memory=Memory(None, 30.0), effective_parameters=0.0), problem)
        .depends_on[0]
        .on
        == "time"
    )
