"""What an export leaves: over the workspace, by how much the model says that commands miss."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from ptt.correct.commands import Commands
from ptt.correct.compensate import compensate
from ptt.correct.exports.format import CannotHold, ErrorLeft, Options
from ptt.correct.terms import left_to_controller, split_terms
from ptt.errors import PosesError
from ptt.machine_schema import ThreePttSpec
from ptt.mechanisms import build_mechanism
from ptt.model.chain import EffectTerms, predict
from ptt.model.model import Model
from ptt.plan.space import build_space, draw_poses
from ptt.progress import Progress, unwatched
from ptt.run.table import Table, make_table, take_rows
from ptt.run.viewing import build_view

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

POSES = 600  # a root mean square of a smooth field is then known to a few percent
EVEN = 1e-6  # deg
COMPENSATED = "left to the controller, which compensates it already"


@dataclass(frozen=True, eq=False)
class WorkspaceSample:
    """Places all over the workspace that the model can be sent to, each joint arriving from one side or the other.

    Attributes:
        compensator: what is exported.
        table: the places as targets in the base frame, with payload, temperature and speed.
        targets: (n, 3) mm, the same.
        nominal: (n, k) mm or rad, joint values by the drawing.
        direction: (n, k), +1 or -1, how each joint arrives; drawn by lot, so that it says nothing about the place.
        static: (n, k) mm or rad, the whole model's commands without the reversal part: what a format is fitted to.
        commands: the whole model's commands.
    """

    compensator: "Compensator"
    table: Table
    targets: np.ndarray
    nominal: np.ndarray
    direction: np.ndarray
    static: np.ndarray
    commands: Commands


def sample_workspace(compensator: "Compensator", options: Options, poses: int = POSES) -> WorkspaceSample:
    """Spread targets over a machine's workspace and work out the whole model's commands there.

    Args:
        compensator: the model, and a network where there is one.
        options: where a run is given, its payloads, temperatures and speeds are taken row by row; else no payload,
            the reference temperature and standstill.
        poses: how many to try.

    Returns:
        Those that can be sent.

    Raises:
        PosesError: none of them can.
    """
    compensator = compensator.in_base()
    file = compensator.model.file
    mechanism = build_mechanism(file.machine)
    random = np.random.default_rng(0)
    q = draw_poses(build_space(file), poses, random)
    place = mechanism.forward(q).numpy()
    arm = file.machine.kind == "serial"
    direction = random.choice((-1.0, 1.0), q.shape)
    table = make_table(
        place, command=q.numpy() if arm else None, direction=direction, **_context(options.table, len(place))
    )
    table = table.replace(joint_prefix="q" if arm else "b", source="workspace")
    first = solve(compensator, table, q.numpy())
    kept = np.flatnonzero(first.sent)
    if not len(kept):
        raise PosesError(
            f"{file.source}: no place of the workspace can be sent; `ptt predict` says why for each target"
        )
    table = take_rows(table, kept)
    commands = first if len(kept) == len(q) else solve(compensator, table, q.numpy()[kept])
    static = commands.q - commands.reversal
    return WorkspaceSample(compensator, table, place[kept], q.numpy()[kept], direction[kept], static, commands)


def left_of_drawing(
    sample: WorkspaceSample, options: Options, sliders: Callable[[WorkspaceSample], np.ndarray]
) -> float:
    """What a format leaves of a machine that is just as drawn: a drawing that leans or is uneven has no place in some.

    Args:
        sample: of the machine, a 3-PTT.
        options: as of `sample_workspace`.
        sliders: what the format sends, fitted to a sample, for its places, (n, 3) mm.

    Returns:
        Root mean square over the workspace, um; 0 of upright towers at even azimuths, which any delta is.
    """
    compensator = sample.compensator
    spec = compensator.model.file.machine
    assert isinstance(spec, ThreePttSpec)
    apart = np.diff(np.sort(np.mod(spec.slider_azimuth_deg, 360.0)))
    if not np.any(spec.slider_lean_deg) and np.abs(apart - 120.0).max() < EVEN:
        return 0.0
    bare = sample_workspace(replace(compensator, model=replace(compensator.model, terms=()), network=None), options)
    return error_left(bare, sliders(bare)).format


def error_left(sample: WorkspaceSample, q: np.ndarray) -> ErrorLeft:
    """By how much the tool misses where a controller sends certain commands, judged by the model itself.

    The tool goes where drive, geometry and structure of the model say, reversal along the travel included unless the
    controller compensates it; what the network knows of is part of the target. A miss that is not known because the
    fit left parameters uncertain (their covariance carried to the tool, and what the network leaves of held-out rows)
    is added to all three figures: root of the mean of miss^2 + sigma^2. A model without a covariance adds nothing, so
    its own figure is then only what its solution leaves, which is near zero.

    Args:
        sample: the places.
        q: (n, k) mm or rad, what is sent there; NaN rows are left out.

    Returns:
        The figures.
    """
    sigma = np.nan_to_num(sample.commands.sigma)
    return ErrorLeft(*(_rms_um(sample, each, sigma) for each in (sample.nominal, q, sample.commands.q)))


def holdings(sample: WorkspaceSample, cannot: dict[str, str]) -> tuple[tuple[str, ...], tuple[CannotHold, ...]]:
    """Divide the effects of a model into those that a format holds and those that it cannot hold.

    Args:
        sample: for the model.
        cannot: key -> why, of effects that the format has no place for; others than the model's are passed over.

    Returns:
        Keys, and the others with the reason; what the controller compensates already is among the latter.
    """
    model = sample.compensator.model
    why = cannot | dict.fromkeys(left_to_controller(model), COMPENSATED)
    steady, reversing, _ = split_terms(model)
    keys = [effect.key for effect, _ in (*steady, *reversing)] + left_to_controller(model)
    holds = tuple(key for key in keys if key not in why)
    return holds, tuple(CannotHold(key, why[key]) for key in keys if key in why)


def _rms_um(sample: WorkspaceSample, q: np.ndarray, sigma: np.ndarray) -> float:
    rows = np.isfinite(q).all(axis=1)
    if not rows.any():
        return float("nan")
    miss = _tool(sample, np.where(rows[:, None], q, sample.nominal)) - _asked(sample)
    return 1e3 * float(np.sqrt(np.mean((miss[rows] ** 2).sum(axis=1) + sigma[rows] ** 2)))


def _tool(sample: WorkspaceSample, q: np.ndarray) -> np.ndarray:
    """Where the model puts the tool, (n, 3) mm; the network left aside."""
    model = sample.compensator.model
    steady, reversing, _ = split_terms(model)
    terms: EffectTerms = [*steady, *reversing]
    return np.asarray(predict(terms, build_view(model.file, sample.table.replace(command=q))).p.numpy())


def _asked(sample: WorkspaceSample) -> np.ndarray:
    """What physics is asked for so that network and physics together reach the targets, (n, 3) mm."""
    correction, _ = sample.compensator.network_parts(sample.nominal)
    return sample.targets if correction is None else correction(sample.targets)


def without(compensator: "Compensator", keys: Iterable[str]) -> "Compensator":
    """The same without some effects of its model, by their keys."""
    return replace(compensator, model=reduce(Model.without, keys, compensator.model))


def solve(compensator: "Compensator", table: Table, posture: np.ndarray, progress: Progress = unwatched) -> Commands:
    """Commands of targets by physics and network; nothing is looked for beside those that cannot be sent.

    Args:
        compensator: with or without a network.
        table: n targets.
        posture: (n, k) nominal joint commands, for a network over joints.
        progress: told what is done, how much of how much.

    Returns:
        The commands.
    """
    correction, inside = compensator.network_parts(posture)
    return compensate(
        compensator.model,
        table,
        correction=correction,
        inside=inside,
        network=compensator.error,
        nearest=False,
        progress=progress,
    )


def _context(run: Table | None, rows: int) -> dict[str, np.ndarray]:
    """Payload, temperature and speed of a run's poses, over and over."""
    if run is None:
        return {}
    poses = take_rows(run, run.role == "pose")
    found = {key: getattr(poses, key) for key in ("payload_kg", "temp_c", "feed_mm_s")}
    return {key: np.resize(value, rows) for key, value in found.items() if value is not None and len(value)}
