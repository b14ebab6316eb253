"""Forecast of a plan: which effects its rows can test, and expected standard errors of their parameters."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from ptt.effects import Effect, Library
from ptt.effects.metrology import TrackerFrame
from ptt.effects.usual import usual_values
from ptt.fitting.chunks import stretches, view_chunks
from ptt.fitting.result import MOST_UNSEEN, UNMEASURED
from ptt.fitting.stated import SEEN_INFORMATION
from ptt.machine import MachineFile
from ptt.model.chain import Chain, linearise, trace
from ptt.model.chain import signature as signature_of
from ptt.model.model import Model, parameter_names
from ptt.plan.expected import Expected
from ptt.progress import Progress
from ptt.record import Record
from ptt.run.frames import rigid_columns
from ptt.run.problem import MOUNT_USUAL, SHIFT_USUAL, TURN_USUAL
from ptt.run.table import Table
from ptt.run.view import View
from ptt.run.viewing import build_view

DWELL, FEED = 10.0, 20.0  # s for a reading, and between two runs; mm/s between poses
FRAME_USUAL = torch.tensor([SHIFT_USUAL] * 3 + [TURN_USUAL] * 3, dtype=torch.float64)
FREE = 1e-6  # prior information on each parameter fitted beside an effect, per usual size squared


@dataclass(frozen=True)
class EffectForecast(Record):
    """What a plan can determine of one effect, with everything else fitted beside it.

    Attributes:
        effect: its key.
        seen: number of combinations of its parameters that the rows determine.
        size: number of its parameters.
        needs: what the rows lack to test it, '' where they can.
        in_model: whether the model has it already.
        parameters: expected standard error of each.
    """

    keys: ClassVar[str] = "effect, in_model, testable, needs, seen, of: size, parameters"

    effect: str
    seen: int
    size: int
    needs: str
    parameters: tuple[Expected, ...]
    in_model: bool = False

    @property
    def testable(self) -> bool:
        """Whether the rows can test the effect."""
        return not self.needs


def forecast(
    model: Model, view: View, rows: np.ndarray, known: Library, sigma: float, progress: Progress | None = None
) -> tuple[EffectForecast, ...]:
    """Expected standard errors of the effects of a model, and of every one that could be added, one at a time.

    Args:
        model: as it is now; its other effects are fitted beside each one.
        view: n rows as they are planned.
        rows: rows that will be read as poses, (n,) bool.
        known: effects by name.
        sigma: noise of one coordinate, mm.
        progress: told what is done, how much of how much.

    Returns:
        The effects of the model first, then one for each other effect that fits the machine.
    """
    kind = model.file.machine.kind
    cases = [_Case(model.without(term.effect.key), term.effect, view) for term in model.terms]
    for name, cls in known.items():
        framed = cls is TrackerFrame and model.file.tracker.frame != "trusted"
        if kind in cls.mechanisms and name not in model.keys and not framed:
            cases.append(_Case(model, cls(), view))
    for done, part in enumerate(view_chunks(view)):
        if progress is not None:
            progress("what the rows will tell", done, len(stretches(view.rows)))
        assert part.number is not None
        read = rows[part.number.numpy().astype(int)]
        shared = _chain(model, part), _read_beside(model, part, read, sigma)
        for case in cases:
            if not case.lack:
                alone = case.model is not model
                own = (_chain(case.model, part), _read_beside(case.model, part, read, sigma)) if alone else shared
                case.add(*own, read, sigma)
    return tuple(replace(_forecast(case), in_model=number < len(model.terms)) for number, case in enumerate(cases))


class _Case:
    """One effect beside a model without it, and the information of the rows so far on both.

    That is R of the QR decomposition of all fitted columns, the effect's last. Rows are added chunk by chunk (TSQR:
    Demmel et al. 2012), without the loss of digits of normal equations.
    """

    def __init__(self, model: Model, effect: Effect, view: View) -> None:
        kind = model.file.machine.kind
        self.model, self.effect, self.lack = model, effect, effect.needs(view)
        sizes = (p.on(kind) for p in effect.parameters if p.role == "linear" for _ in range(p.size(view.joints)))
        self.sizes = tuple(sizes)
        self.names = parameter_names(effect, kind, view.joints)[: len(self.sizes)]
        self.usual = np.array([p.usual for p in self.sizes])
        self.shape = {} if self.lack else effect.usual_trial(view)
        self.root = np.zeros((0, 0))
        self.beside = 0  # columns of what is fitted beside it

    def add(self, chain: Chain, nuisance: np.ndarray, rows: np.ndarray, sigma: float) -> None:
        """Add rows.

        Args:
            chain: model at n rows.
            nuisance: columns fitted beside the effect at the rows that are read, (r, m) in usual sizes.
            rows: those that are read as poses, (n,) bool.
            sigma: noise of one coordinate, mm.
        """
        shifts = signature_of(chain, self.effect, self.shape).numpy() / sigma
        columns = np.asarray(shifts)[rows].reshape(-1, len(self.usual))
        both = np.concatenate([nuisance, columns * self.usual], axis=1)
        if not self.root.size:
            self.beside = nuisance.shape[1]
            prior = _prior_beside(self.model, self.beside)
            self.root = np.concatenate([prior, np.zeros((len(prior), len(self.usual)))], axis=1)
        self.root = np.asarray(np.linalg.qr(np.concatenate([self.root, both]), mode="r"))

    def information(self) -> np.ndarray:
        """Information on the effect's parameters with everything else fitted beside them, (p, p)."""
        left = self.root[self.beside :, self.beside :]
        return np.asarray(left.T @ left)


def _forecast(case: _Case) -> EffectForecast:
    """Expected standard errors of one effect."""
    names, sizes, usual = case.names, case.sizes, case.usual
    if case.lack:
        blank = tuple(Expected(text, p.unit, None, p.usual) for text, p in zip(names, sizes, strict=True))
        return EffectForecast(case.effect.key, 0, len(sizes), case.lack, blank)
    # Held values have a prior near zero: the rows need not determine them.
    held = np.array([p.held for p in sizes], dtype=float)
    information = case.information() + np.diag(held)
    strength, ways = np.linalg.eigh(information)
    unseen = ways[:, strength < SEEN_INFORMATION]
    seen = len(usual) - unseen.shape[1] - int(held.sum())
    variance = np.diag(np.linalg.inv(information + unseen @ unseen.T))
    hidden = np.square(unseen).sum(axis=1)
    values = tuple(
        Expected(name, p.unit, float(p.usual * np.sqrt(wide)), p.usual)
        if share <= MOST_UNSEEN
        else Expected(name, p.unit, None, p.usual, bool(share < UNMEASURED))
        for name, p, wide, share in zip(names, sizes, variance, hidden, strict=True)
    )
    kept = tuple(value for value, own in zip(values, held, strict=True) if not own)
    return EffectForecast(case.effect.key, seen, len(kept), "", kept)


def see_plan(model: Model, table: Table) -> tuple[View, Table]:
    """View of planned rows, read at standstill, with estimated times.

    Args:
        model: of the machine.
        table: the plan.

    Returns:
        The view, and the table with a clock.
    """
    place = table.target if model.file.machine.kind == "three-ptt" else np.zeros((table.rows, 3))
    place = np.where(np.isfinite(place), place, 0.0)
    way = np.linalg.norm(np.diff(place, axis=0, prepend=place[:1]), axis=1)
    timed = table.replace(time_s=np.cumsum(way / FEED + DWELL))
    return build_view(model.file, timed).standing(), timed  # planned readings are taken at standstill


def columns_of(model: Model, effect: Effect, view: View, sigma: float) -> np.ndarray:
    """Reading shift per unit of each linear parameter, in units of noise, (n, 3, P)."""
    return np.asarray(signature_of(_chain(model, view), effect, effect.usual_trial(view)).numpy()) / sigma


def _chain(model: Model, view: View) -> Chain:
    return trace([(term.effect, term.theta) for term in model.terms if len(term.theta)], view)


def beside(model: Model, view: View, rows: np.ndarray, sigma: float) -> np.ndarray:
    """Design rows of what is fitted beside an effect: the model's own parameters, mount and frame, with priors.

    Args:
        model: as it is now.
        view: n rows.
        rows: those that are read as poses, (n,) bool.
        sigma: noise of one coordinate, mm.

    Returns:
        (r, P) in usual sizes and units of noise: readings first, then base reflectors and priors.
    """
    read = _read_beside(model, view, rows, sigma)
    return np.concatenate([read, _prior_beside(model, read.shape[1])])


def _read_beside(model: Model, view: View, rows: np.ndarray, sigma: float) -> np.ndarray:
    """Design rows of the readings, (3 x rows, P)."""
    terms = [(term.effect, term.theta) for term in model.terms if len(term.theta)]
    at = linearise(terms, view)
    kind = model.file.machine.kind
    usual = torch.cat([torch.zeros(0), *(usual_values(effect, view) for effect, _ in terms)])
    parts: list[Tensor] = [at.jacobian * usual]
    if kind == "serial" and model.file.tracker.tool != "trusted":
        parts.append(at.by_mount * MOUNT_USUAL)
    if model.file.tracker.frame != "trusted":
        parts.append(rigid_columns(at.prediction.reading) * FRAME_USUAL)
    columns = torch.cat(parts, dim=-1).numpy()[rows] / sigma
    return np.asarray(columns.reshape(3 * len(columns), columns.shape[-1]))  # P = 0 for a trusted frame without effects


def _prior_beside(model: Model, width: int) -> np.ndarray:
    """Design rows of base reflectors and of the prior, (r, P)."""
    free = np.sqrt(FREE) * np.eye(width)
    if model.file.tracker.frame != "measured":
        return np.asarray(free)
    return np.concatenate([_base_rows(model.file, width), free])


def _base_rows(file: MachineFile, width: int) -> np.ndarray:
    points = file.tracker.base_point
    rigid = rigid_columns(torch.tensor([point.xyz_mm for point in points], dtype=torch.float64)) * FRAME_USUAL
    weight = np.array([1.0 / point.sigma_mm for point in points])
    rows = np.zeros((3 * len(points), width))
    rows[:, -6:] = (rigid.numpy() * weight[:, None, None]).reshape(-1, 6)
    return rows
