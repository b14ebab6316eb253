"""Remaining error of an export over the workspace, predicted by the model."""

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
EVEN = 1e-6  # deg, rounding of even azimuths
CONTEXT = ("payload_kg", "temp_c", "feed_mm_s")
COMPENSATED = "left to the controller, which compensates it already"


@dataclass(frozen=True, eq=False)
class WorkspaceSample:
    """Reachable positions all over the workspace, each joint arriving from a random side.

    Attributes:
        compensator: what is exported.
        table: the places as targets in the base frame, with payload, temperature and speed.
        targets: (n, 3) mm, those of `table`.
        nominal: (n, k) mm or rad, joint values by the drawing.
        direction: (n, k), +1 or -1, direction in which each joint arrives; random, hence independent of the position.
        static: (n, k) mm or rad, the whole model's commands without the reversal part; formats are fitted to these.
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
    """Draw targets in a machine's workspace and compute the whole model's commands there.

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
    first = solve(compensator, table)
    kept = np.flatnonzero(first.sent)
    if not len(kept):
        raise PosesError(
            f"{file.source}: no place of the workspace can be sent; `ptt predict` says why for each target"
        )
    table = take_rows(table, kept)
    commands = first if len(kept) == len(q) else solve(compensator, table)
    static = commands.q - commands.reversal
    return WorkspaceSample(compensator, table, place[kept], q.numpy()[kept], direction[kept], static, commands)


def left_of_drawing(
    sample: WorkspaceSample, options: Options, sliders: Callable[[WorkspaceSample], np.ndarray]
) -> float:
    """Error of a format for a machine exactly as drawn: some formats cannot represent leaning or uneven towers.

    Args:
        sample: of the machine, a 3-PTT.
        options: as of `sample_workspace`.
        sliders: what the format sends, fitted to a sample, for its places, (n, 3) mm.

    Returns:
        Root mean square over the workspace, um; 0 for upright towers at even azimuths, which every format represents.
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
    """Error of the tool at given commands, predicted by the model itself.

    The tool position includes drives, geometry and structure of the model, and reversal unless the controller
    compensates it; the network's correction is part of the target. The uncertainty of the fitted parameters (their
    covariance propagated to the tool) and the network's held-out error are added to all three figures: root of the
    mean of miss^2 + sigma^2. For a model without a covariance the figure of the whole model is therefore near zero.

    Args:
        sample: the places.
        q: (n, k) mm or rad, commands; NaN rows are left out.

    Returns:
        The figures.
    """
    sigma = np.nan_to_num(sample.commands.sigma)
    return ErrorLeft(*(_rms_um(sample, each, sigma) for each in (sample.nominal, q, sample.commands.q)))


def holdings(sample: WorkspaceSample, cannot: dict[str, str]) -> tuple[tuple[str, ...], tuple[CannotHold, ...]]:
    """Partition the effects of a model into those that a format holds and those that it cannot hold.

    Args:
        sample: for the model.
        cannot: key -> why, of effects that the format cannot hold; keys that the model does not have are ignored.

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
    """Tool positions by the model without network, (n, 3) mm."""
    model = sample.compensator.model
    steady, reversing, _ = split_terms(model)
    terms: EffectTerms = [*steady, *reversing]
    return np.asarray(predict(terms, build_view(model.file, sample.table.replace(command=q))).p.numpy())


def _asked(sample: WorkspaceSample) -> np.ndarray:
    """Positions that the physics has to reach so that physics and network together reach the targets, (n, 3) mm."""
    correction, _ = sample.compensator.network_parts()
    return sample.targets if correction is None else correction(sample.targets, sample.nominal)


def without(compensator: "Compensator", keys: Iterable[str]) -> "Compensator":
    """A compensator without some effects of its model, by their keys."""
    return replace(compensator, model=reduce(Model.without, keys, compensator.model))


def solve(compensator: "Compensator", table: Table, progress: Progress = unwatched) -> Commands:
    """Commands of targets by physics and network, without a search for the nearest reachable point of unreachable ones.

    Args:
        compensator: with or without a network.
        table: n targets, of an arm with nominal joint commands.
        progress: told what is done, how much of how much.

    Returns:
        The commands.
    """
    correction, inside = compensator.network_parts()
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
    """Payload, temperature and speed of a run's poses, repeated cyclically.

    Poses that lack one which others have do not count.
    """
    if run is None:
        return {}
    found = {key: value for key in CONTEXT if (value := getattr(run, key)) is not None and not np.isnan(value).all()}
    known = (run.role == "pose") & np.all([np.isfinite(value) for value in found.values()], axis=0)
    return {key: np.resize(value[known], rows) for key, value in found.items() if known.any()}
