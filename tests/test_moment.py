"""The row at which something happened at once, where the tracker stands anew for each run."""

import numpy as np

from ptt.challenge.cases import draw, plan
from ptt.challenge.truth import table_of
from ptt.diagnosis.moment import Along, best_row, joined
from ptt.diagnosis.verdict import diagnose
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.run.problem import build_problem


def seen(rows: slice, frame: np.ndarray, own: np.ndarray, left: np.ndarray) -> Along:
    both = np.concatenate([frame, own], axis=2)[rows]
    gram = np.einsum("ncp,ncq->npq", both, both)
    return Along(np.einsum("ncp,nc->np", both, left[rows]), np.ones(len(both), int), gram[:, :, -1:], gram.sum(axis=0))


def test_a_jump_is_found_beside_the_frames_of_three_runs_and_in_chunks_alike() -> None:
    random = np.random.default_rng(8)
    run, jump = np.repeat([0, 1, 2], 40), 28
    frame = np.where(run[:, None, None] == np.repeat([0, 1, 2], 3), np.tile(np.eye(3), 3), 0.0)
    own = 1.0 + 0.3 * random.normal(size=(120, 3, 1))  # a shift in its bulk, which a frame takes
    readings = 30.0 * own[:, :, 0] * (np.arange(120) > jump)[:, None] + random.normal(size=(120, 3))
    flat = frame.reshape(-1, 9)
    left = readings - (flat @ np.linalg.lstsq(flat, readings.ravel(), rcond=None)[0]).reshape(-1, 3)
    assert best_row(seen(slice(None), frame, own, left)) == jump
    parts = [seen(slice(first, first + 30), frame, own, left) for first in range(0, 120, 30)]
    assert best_row(joined(parts)) == jump


def test_a_slip_between_new_set_ups_is_one_slip() -> None:
    drawn, _ = draw(plan("single", 1, 950035)[0])  # three runs, each in a frame of its own
    frame = simulate(drawn.rig, drawn.targets).frame
    found = diagnose(Model(drawn.rig.machine), build_problem(drawn.rig.machine, table_of(frame, drawn.absent)))
    assert (found.verdict, found.suggested) == ("missing", (("homing-slip",),))
