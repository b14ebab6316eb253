"""A solved model as the prior of a recheck: its values, their covariance, and the date of their fit."""

from dataclasses import dataclass, field, replace

import numpy as np
import torch

from ptt.again.masked_effects import MaskedEffects, read_masked_effects
from ptt.errors import ModelError
from ptt.fitting.kept import Kept, kept_covariance
from ptt.fitting.layout import Layout, lay_out
from ptt.fitting.unnamed import Unnamed
from ptt.judge.history import HistoryEntry, read_entries
from ptt.model.model import Model, Term
from ptt.run.problem import Problem

ANYTHING = 1e2  # prior standard deviation of a value that the run cannot judge, in usual sizes: practically flat
LEAST_SHARE = 1e-6  # of the largest standard deviation, below which one counts as zero


@dataclass(frozen=True)
class Prior:
    """A solved model as the prior of a machine that has not changed.

    Attributes:
        model: the solved model, reduced to effects of the machine; no value is fixed by the user.
        layout: of the model's values, followed by the new run's mounts and frames.
        values: of the model, (w,) in usual sizes.
        root: factor of their covariance, root @ root.T, (w, r) in usual sizes.
        last: the last step of the model's history; None where it has none.
        left: held-out error of the model's own run beyond the noise of that run, rms, um.
        notes: what is not carried over, in words.
        blind: keys of effects that the new run cannot judge.
        cured: keys of effects that are supposed to be zero in the new run, whatever they were.
        masked_effects: effects that the model does not have and its own run could hardly tell from those that it has.
        unnamed: sizes of the drawing that the model does not have, with a factor (w + p, r) of the joint covariance of
            the model's w values and these p; None where the fit did not work it out.
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
    masked_effects: MaskedEffects = field(default_factory=MaskedEffects)
    unnamed: Unnamed | None = None

    @property
    def gone(self) -> np.ndarray:
        """Linear values of cured effects, (w,) bool."""
        layout, width = self.layout, self.width
        own = [index for index, term in enumerate(layout.terms) if term.effect.key in self.cured]
        return np.isin(layout.owner[:width], own) & ~layout.searched[:width]

    @property
    def start(self) -> np.ndarray:
        """Values in the new run if nothing else has changed, (w,) in usual sizes: zero where cured."""
        return np.where(self.gone, 0.0, self.values)

    @property
    def root_now(self) -> np.ndarray:
        """Factor of the covariance of `start`, (w, r): a cured value is exactly zero."""
        return np.where(self.gone[:, None], 0.0, self.root)

    @property
    def width(self) -> int:
        """Number of values w."""
        return len(self.values)

    @property
    def std(self) -> np.ndarray:
        """Standard errors of the values, (w,) in usual sizes."""
        return np.asarray(np.sqrt(np.square(self.root).sum(axis=1)))

    @property
    def since(self) -> str | None:
        """Date of the model, ISO 8601; None where it does not say."""
        return None if self.last is None else self.last.date


def build_prior(model: Model, problem: Problem) -> Prior:
    """Take a solved model as the prior for another run.

    Args:
        model: solved, as it holds for the new run (`ptt.model.of_run.for_runs`).
        problem: the new run.

    Returns:
        The prior.

    Raises:
        ModelError: the model has no fitted effect of the machine.
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
    masked_effects = read_masked_effects(kept, layout.names[:width], problem.view)
    unnamed = None if kept is None else kept.unnamed_beside(layout.names[:width])
    return Prior(
        own,
        layout,
        values,
        root,
        last,
        _left(last),
        said,
        frozenset(blind),
        masked_effects=masked_effects,
        unnamed=unnamed,
    )


def _is_blind(term: Term, problem: Problem) -> bool:
    """Whether an effect depends on the speed, and the run shows nothing of it."""
    return "speed" in term.effect.requires and term.effect.lacks(term.theta, problem.view) is not None


def _not_carried(model: Model) -> list[str]:
    gone = [term.effect.key for term in (*model.terms, *model.aside) if term.effect.of_run]
    return [f"{key} belongs to the set-up of another run and is not carried over" for key in gone]


def _uncertainty(
    kept: Kept | None, terms: tuple[Term, ...], layout: Layout, scale: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Factor of the covariance of all values, (w, r) in usual sizes; notes on what it lacks."""
    names = layout.names[: len(scale)]
    std = torch.cat([_stated(term) for term in terms]).numpy()[layout.columns()]
    if kept is not None:
        # Values that the last fit held because its run could not test them keep their stated standard errors.
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
    """Held-out error of the model's own run beyond the noise of that run, um."""
    if last is None:
        return 0.0
    excess = last.heldout_after_um["total"] ** 2 - float(last.noise_um["total"]) ** 2
    return float(np.sqrt(max(excess, 0.0))) if np.isfinite(excess) else 0.0  # nothing was held out
