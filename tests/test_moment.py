"""The row at which something happened at once, where the tracker stands anew for each run."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.explanation import MOST_UNNAMED
from ptt.diagnosis.unknown.moment import MomentSums, best_row, joined
from ptt.effects import HomingSlip
from ptt.effects.sudden import EDGE
from ptt.fitting.moment import last_before
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view


def seen(rows: slice, frame: np.ndarray, own: np.ndarray, left: np.ndarray) -> MomentSums:
    both = np.concatenate([frame, own], axis=2)[rows]
    gram = np.einsum("ncp,ncq->npq", both, both)
    side, read = np.einsum("ncp,nc->np", both, left[rows]), left[rows].any(axis=1)
    return MomentSums(side, np.ones(len(both), int), gram[:, :, -1:], gram.sum(axis=0), read)


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


def test_a_jump_a_thousand_times_the_noise_is_dated_to_the_row_in_every_part_of_a_segment() -> None:
    """What rows see of it grows evenly within a segment; taken for the same all along it, the date was rows off."""
    random = np.random.default_rng(8)
    own, lengths = 1.0 + 0.1 * random.normal(size=(300, 3, 1)), np.full(30, 10)
    frame = np.tile(np.eye(3), (300, 1, 1))
    flat = frame.reshape(-1, 3)
    for jump in range(100, 120):
        readings = 1000.0 * own[:, :, 0] * (np.arange(300) > jump)[:, None] + random.normal(size=(300, 3))
        left = readings - (flat @ np.linalg.lstsq(flat, readings.ravel(), rcond=None)[0]).reshape(-1, 3)
        rows = seen(slice(None), frame, own, left)
        segments = rows.gram.reshape(30, 10, *rows.gram.shape[1:]).sum(axis=1)
        assert best_row(replace(rows, lengths=lengths, gram=segments)) == jump


@pytest.mark.parametrize("jump", [EDGE - 1, 20, 40 - EDGE - 1])
def test_chunks_and_the_whole_date_a_jump_alike_up_to_its_ends(jump: int) -> None:
    own, left = np.ones((40, 3, 1)), 10.0 * np.ones((40, 3)) * (np.arange(40) > jump)[:, None]
    gained = np.square(left).sum(axis=1) - np.square(left - 10.0).sum(axis=1)
    assert best_row(seen(slice(None), np.zeros((40, 3, 0)), own, left + 1e-9)) == jump
    assert last_before(np.arange(40.0), gained) == jump


def test_readings_are_counted_before_a_moment_not_rows_that_are_passed() -> None:
    random = np.random.default_rng(8)
    read, own = np.arange(80) % 2 == 1, np.where(np.arange(80) % 2, 1.0, 0.0)[:, None, None] * np.ones((1, 3, 1))
    left = np.where(read[:, None], random.normal(size=(80, 3)), 0.0)
    left[[1, 3]] -= 1000.0  # two gross errors at once
    assert best_row(seen(slice(None), np.zeros((80, 3, 0)), own, left)) >= np.flatnonzero(read)[EDGE - 1]
    view = build_view(bench(), make_table(random.uniform(-50.0, 50.0, (80, 3)), measured=np.where(left, left, np.nan)))
    moments = torch.cat([shape["after"] for shape in HomingSlip().search(view)])
    assert [int((np.flatnonzero(read) <= end).sum()) for end in (moments.min().item(), moments.max().item())] == [
        EDGE,
        40 - EDGE,
    ]


def test_a_slip_between_new_set_ups_is_one_slip() -> None:
    drawn, _ = draw(plan("single", 1, 950035)[0])  # three runs, each in a frame of its own
    frame = simulate(drawn.rig, drawn.targets).frame
    found = diagnose(Model(drawn.rig.machine), build_problem(drawn.rig.machine, table_of(frame, drawn.absent)))
    assert (found.verdict, found.suggested) == ("missing", (("homing-slip",),))


def test_a_slip_that_a_law_lets_in_has_its_value_like_any_other() -> None:
    drawn, _ = draw(plan("multi", 1, 1040015)[0])
    frame = simulate(drawn.rig, drawn.targets).frame
    found = diagnose(Model(drawn.rig.machine), build_problem(drawn.rig.machine, table_of(frame, drawn.absent)))
    named = [step[0] for step in found.suggested]
    assert set(named) == {"setup-jump", "homing-slip", "homing-offset"} == set(found.model.keys)
    assert [one.effect for one in found.candidates[: len(named)]] == named


@pytest.mark.long
def test_a_moment_needs_sound_readings_on_both_sides() -> None:
    """Of the first readings two are gross: a slip before which two others are left would explain whatever they say."""
    case = plan("single", 1, 2700013, kinds="all", noise=None, bench=None, rows=None, visible=True)[0]
    drawn, _ = draw(case)
    frame = simulate(drawn.rig, drawn.targets).frame
    found = diagnose(Model(drawn.rig.machine), build_problem(drawn.rig.machine, table_of(frame, drawn.absent)))
    assert (found.verdict, found.suggested) == ("missing", (("joint-clearance",),))


@pytest.mark.long
def test_what_is_found_beside_an_unknown_and_not_named_is_no_statement() -> None:
    """A table that settles for hours: compliance of links takes a part of it, which hidden readings do not bear out."""
    case = plan("unknown", 1, 2700037, kinds="all", noise=None, bench=None, rows=None, visible=True)[0]
    drawn, _ = draw(case)
    frame = simulate(drawn.rig, drawn.targets).frame
    found = diagnose(Model(drawn.rig.machine), build_problem(drawn.rig.machine, table_of(frame, drawn.absent)))
    named = {step[0] for step in found.suggested}
    others = [one.probability for one in found.candidates if one.effect not in named]
    assert found.verdict == "unknown" and max(others) <= MOST_UNNAMED


def test_a_knock_nearly_along_a_joints_way_and_its_slip_are_no_levels_of_that_joint() -> None:
    """Two moments of one joint say in three numbers what a slip and a knock say in nine, and nearly as well."""
    drawn, _ = draw(plan("multi", 1, 3775450)[0])
    run = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame))
    found = diagnose(Model(drawn.rig.machine), run)
    assert (found.verdict, {names[0] for names in found.suggested}) == ("missing", set(drawn.truth))
