"""What a solved model says of the machine as it was: values, what their run left uncertain, and when that was."""

from dataclasses import dataclass, field, replace

import numpy as np
import torch

from ptt.again.then import Rooms, rooms_of
from ptt.errors import ModelError
from ptt.fitting.kept import Kept, kept_covariance
from ptt.fitting.layout import Layout, lay_out
from ptt.fitting.unnamed import Unnamed
from ptt.judge.history import HistoryEntry, read_entries
from ptt.model.model import Model, Term
from ptt.run.problem import Problem

ANYTHING = 1e2  # usual sizes: what a run cannot judge may be anything
LEAST_SHARE = 1e-6  # of the largest uncertainty below which one is none


@dataclass(frozen=True)
class Before:
    """A solved model as the prior of a machine that has not changed.

    Attributes:
        model: with the effects of the machine alone; every linear value free to be looked at.
        layout: of its values, then of the new run's mounts and frames.
        values: (w,) of the effects, in usual sizes.
        root: (w, r) factor of their covariance, in usual sizes.
        last: the last step of its history; None where it has none.
        left: what it left unexplained of rows it had not seen, beyond the noise then, um.
        notes: what is not carried over, in words.
        blind: keys of effects that the run cannot judge.
        cured: keys of effects that are taken to be gone now, whatever they were.
        rooms: effects that it does not have, and what its run says of them.
        unnamed: sizes of the drawing among these, and how far they leave its values and themselves open, (w + p, r);
            None where nobody asked.
    """

    model: Model
    layout: Layout
    values: np.ndarray
    root: np.ndarray
    last: HistoryEntry | None
    left: float
    notes: tuple[str, ...]
    blind: frozenset[str] = frozenset()
    cured: frozenset[str] = frozenset()
    rooms: Rooms = field(default_factory=Rooms)
    unnamed: Unnamed | None = None

    @property
    def gone(self) -> np.ndarray:
        """(w,) bool, values of the effects that are gone now."""
        layout, width = self.layout, self.width
        own = [index for index, term in enumerate(layout.terms) if term.effect.key in self.cured]
        return np.isin(layout.owner[:width], own) & ~layout.searched[:width]

    @property
    def start(self) -> np.ndarray:
        """(w,) the values that they have now if nothing else has changed."""
        return np.where(self.gone, 0.0, self.values)

    @property
    def loose(self) -> np.ndarray:
        """(w, r) the same of the root: what is gone is zero, for sure."""
        return np.where(self.gone[:, None], 0.0, self.root)

    @property
    def width(self) -> int:
        """Number of values w."""
        return len(self.values)

    @property
    def std(self) -> np.ndarray:
        """(w,) what their run left uncertain, in usual sizes."""
        return np.asarray(np.sqrt(np.square(self.root).sum(axis=1)))

    @property
    def since(self) -> str | None:
        """Date of the model, ISO 8601; None where it does not say."""
        return None if self.last is None else self.last.date


def look_back(model: Model, problem: Problem) -> Before:
    """Take a solved model as the prior for another run.

    Args:
        model: as it holds for the run.
        problem: the run.

    Returns:
        The prior.

    Raises:
        ModelError: nothing was fitted in it.
    """
    carried = tuple(replace(t, fixed=frozenset()) for t in model.terms if not t.effect.of_run and len(t.theta))
    if not carried:
        raise ModelError(
            "the model has no fitted effects, so nothing says how the machine was",
            where=model.file.source,
            fix="solve the machine first: `ptt diagnose`, then `ptt add ... --out solved.toml`",
        )
    own = replace(model, terms=carried)
    layout = lay_out(own, problem, carried)
    width = int((layout.owner >= 0).sum())
    values, scale = layout.start()[:width], layout.scale[:width]
    kept = kept_covariance(model)
    root, notes = _uncertainty(kept, carried, layout, scale)
    blind = {term.effect.key: index for index, term in enumerate(carried) if _is_blind(term, problem)}
    free = np.isin(layout.owner[:width], list(blind.values()))
    root = np.hstack([root, ANYTHING * np.eye(width)[:, free]])
    notes += [f"{key} cannot be judged: this run was read at standstill or at one speed" for key in blind]
    entries = read_entries(model.file)
    last = entries[-1] if entries else None
    said = (*_not_carried(model), *notes)
    rooms = rooms_of(kept, layout.names[:width], problem.view)
    unnamed = None if kept is None else kept.unnamed_beside(layout.names[:width])
    return Before(own, layout, values, root, last, _left(last), said, frozenset(blind), rooms=rooms, unnamed=unnamed)


def _is_blind(term: Term, problem: Problem) -> bool:
    """Whether an effect follows the speed, and the run has one speed or none."""
    return "speed" in term.effect.requires and "speed" not in problem.view.varies


def _not_carried(model: Model) -> list[str]:
    gone = [term.effect.key for term in (*model.terms, *model.aside) if term.effect.of_run]
    return [f"{key} belongs to the set-up of another run and is not carried over" for key in gone]


def _uncertainty(
    kept: Kept | None, terms: tuple[Term, ...], layout: Layout, scale: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Factor of the covariance of all values in usual sizes, (w, r); what it had to be put together from."""
    names = layout.names[: len(scale)]
    std = torch.cat([_stated(term) for term in terms]).numpy()[layout.columns()]
    if kept is not None:
        # What the last fit held, because its run could not test it, is as uncertain as it was before.
        told = kept.rows(names)
        held = np.linalg.norm(told, axis=1) < LEAST_SHARE * std
        rows = np.hstack([told, np.diag(np.where(held, std, 0.0))]) / scale[:, None]
        ways, size, _ = np.linalg.svd(rows, full_matrices=False)
        some = size > LEAST_SHARE * size.max(initial=0.0)
        return ways[:, some] * size[some], []
    note = "the model keeps no covariance of its present values: their stated errors are taken as independent"
    return np.diag(np.where(np.isfinite(std), std / scale, 1.0)), [note]


def _stated(term: Term) -> torch.Tensor:
    return torch.full_like(term.theta, torch.nan) if term.std is None else term.std


def _left(last: HistoryEntry | None) -> float:
    """What was left of held-out rows beyond the noise of that run, um."""
    if last is None:
        return 0.0
    excess = last.heldout_after_um["total"] ** 2 - float(last.noise_um["total"]) ** 2
    return float(np.sqrt(max(excess, 0.0))) if np.isfinite(excess) else 0.0  # nothing was held out
