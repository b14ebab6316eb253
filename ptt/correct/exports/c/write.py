"""Write a model as C99 source, with a test of its own."""

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch

from ptt.correct.exports.c.effects import kernel
from ptt.correct.exports.c.numbers import number, table
from ptt.correct.exports.c.source import comment_of, source_of
from ptt.correct.exports.format import Options, Written, said_held
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import useless_note
from ptt.correct.exports.left import (
    WorkspaceSample,
    error_left,
    holdings,
    sample_workspace,
    solve,
    without,
)
from ptt.correct.exports.whole import write_all
from ptt.correct.terms import split_terms
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.run.direction import travel_direction
from ptt.run.table import Table, make_table, take_rows
from ptt.run.target_frame import target_frames
from ptt.run.viewing import build_view

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

CORNERS = 6  # positions of the workspace that the self-test's path connects
BETWEEN = 12  # rows from one to the next
WARM = 7.0  # K above the reference temperature, and
LOAD = 1.5  # kg on the tool, so that thermal and load effects are tested too
ROUNDS = 40  # of fixed-point iteration, whose rate is the slope of the network's correction
TOLERANCE = 1e-9  # mm or rad, of commands in the self-test; an arm's tool position is compared as well


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write ptt_model.h, ptt_model.c and ptt_selftest.c.

    Args:
        compensator: physics, and a network where there is one.
        out: folder; other files in it stay.
        options: where the model came from, and at which loads errors are judged.

    Returns:
        What came of it.
    """
    sample = sample_workspace(compensator, options)
    head = head_lines(compensator, options)
    source = source_of(compensator, head)
    cannot = source.parts.cannot
    holds, left_out = holdings(sample, cannot)
    held = without(sample.compensator, cannot)
    left = error_left(sample, sample.commands.q if not cannot else solve(held, sample.table).q)
    network = compensator.network is not None
    head += [f"holds {said_held(holds, [item.effect for item in left_out], left, network=network)}"]
    head += [f"cannot hold {item.effect}" for item in left_out]
    written = write_all(
        {
            out / "ptt_model.h": source.header,
            out / "ptt_model.c": source.body,
            out / "ptt_selftest.c": _selftest(compensator.model.file, held, sample, comment_of(head)),
        }
    )
    return Written(written, holds, left_out, left, (*_notes(compensator), *useless_note(sample, left, holds)), network)


def _selftest(file: MachineFile, held: "Compensator", sample: WorkspaceSample, head: str) -> str:
    """Self-test: a path through the workspace with reversals, its commands and the tool positions by the model.

    Args:
        file: the machine, with the frame that targets are stated in.
        held: what the code holds, in the base frame.
        sample: places of the workspace.
        head: comment at the top.

    Returns:
        Text of the program.
    """
    path = _path(held, sample)
    q = solve(held, path).q
    (frame,) = target_frames(file, make_table(path.target))
    arm = path.command is not None
    tables = table("nominal", path.command) if arm else table("target", frame.as_stated(path.target))
    tables += table("command", q) + table("direction", travel_direction(q)[0])
    sent = q[::BETWEEN]
    tables += table("sent", sent) + table("place", frame.as_stated(tool_place(held, sent, path)))
    values = {
        "ROWS": str(len(q)), "PLACES": str(len(sent)), "TABLES": tables, "UNIT": "rad" if arm else "mm",
        "CONTEXT": f"{number(LOAD)}, {number(file.machine.reference_temp_c + WARM)}, 0.0, 0.0",
        "TOLERANCE": number(TOLERANCE), "ARM": str(int(arm)),
        "CALL": "ptt_correct(nominal[i]" if arm else "ptt_command(target[i]",
        "PATHS": str(int(not arm)),
    }  # fmt: skip
    text = kernel("selftest.c.in")
    for name, value in values.items():
        text = text.replace(f"@{name}@", value)
    return head + text


def _path(held: "Compensator", sample: WorkspaceSample) -> Table:
    """Path with linear interpolation of joints between random positions; rows that cannot be sent are left out."""
    corners = sample.nominal[np.linspace(0, len(sample.nominal) - 1, CORNERS).round().astype(int)]
    part = np.arange(BETWEEN)[:, None] / BETWEEN
    joints = np.concatenate([begin + part * (end - begin) for begin, end in pairwise(corners)])
    file = held.model.file
    place = build_mechanism(file.machine).forward(torch.as_tensor(joints)).numpy()
    arm = file.machine.kind == "serial"
    context = {"payload_kg": LOAD, "temp_c": file.machine.reference_temp_c + WARM}
    path = make_table(place, command=joints if arm else None, joint_prefix="q" if arm else "b", **context)
    sent = solve(held, path).sent
    return take_rows(path, np.flatnonzero(sent))


def tool_place(held: "Compensator", q: np.ndarray, like: Table) -> np.ndarray:
    """Tool position p by the model without reversal, from p + step(p) = position by the physics.

    Args:
        held: the model.
        q: (n, k) mm or rad, commands.
        like: payload and temperature of its first row are taken.

    Returns:
        (n, 3) mm in the base frame.
    """
    model = held.model
    context = {key: float(getattr(like, key)[0]) for key in ("payload_kg", "temp_c") if getattr(like, key) is not None}
    steady, _, _ = split_terms(model, "none")
    there = predict(steady, build_view(model.file, make_table(None, q, joint_prefix=like.joint_prefix, **context))).p
    physics = place = there.numpy()
    posture = torch.as_tensor(q)
    for _ in range(ROUNDS if held.network is not None else 0):
        if held.space == "joints":
            posture = build_mechanism(model.file.machine).inverse(torch.as_tensor(place), None, torch.as_tensor(q))
        correction, _ = held.network_parts()
        assert correction is not None
        place = physics - (correction(place, posture.numpy()) - place)
    return np.asarray(place)


def _notes(compensator: "Compensator") -> tuple[str, ...]:
    inputs = compensator.network is not None and compensator.space == "joints"
    return (
        "cc -std=c99 -O2 ptt_model.c ptt_selftest.c -lm && ./a.out says whether a build gives the same numbers",
    ) + (
        ("the network is a function of joint values: ptt_correct takes the posture from the nominal ones",)
        if inputs
        else ()
    )
