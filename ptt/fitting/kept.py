"""The joint covariance of a fit, kept in the machine file."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.fitting.packed import pack, unpack
from ptt.fitting.result import FitResult
from ptt.fitting.unnamed import Unnamed, read_unnamed
from ptt.machine_schema import CovarianceSpec, MaskedSpec
from ptt.model.entries import write_model
from ptt.model.model import Model

# parts of a drawing that no error depends on
OUTSIDE_DIGEST: Any = {
    "name": True,
    "slider_travel_mm": True,
    "joint": {"__all__": {"limits_deg"}},
}


@dataclass(frozen=True)
class Kept:
    """The joint covariance of a model's parameters and the frame, as a factor: covariance = root @ root.T.

    Attributes:
        names: one for each row, (u,): parameters as 'backlash gap_mm 2', then mount and frame.
        root: square root of the covariance, (u, r), in the parameters' own units.
        heldout: root mean square error of held-out rows, mm; None where not known.
        helped: whether held-out rows were predicted better than by the drawing, beyond chance; None where not known.
        masked: what its run shows about effects that the model does not have (`ptt.fitting.masked`).
        unnamed: sizes of the drawing that it does not have; None where not computed.
        turns: travel of a wind-up of each joint that its run cannot tell from play, (k,) mm or rad; () for none.
    """

    names: tuple[str, ...]
    root: np.ndarray
    heldout: float | None = None
    helped: bool | None = None
    masked: MaskedSpec | None = None
    unnamed: Unnamed | None = None
    turns: tuple[float, ...] = ()

    @property
    def promised(self) -> float | None:
        """How sure a command should be, mm: zero where the drawing predicted held-out rows as well."""
        return 0.0 if self.helped is False else self.heldout

    def rows(self, names: Sequence[str]) -> np.ndarray:
        """Rows of the root by name, (len(names), r); zero for parameters that the fit held."""
        return self._by_name(self.root, names)

    def unnamed_beside(self, names: Sequence[str]) -> Unnamed | None:
        """`unnamed` for some parameters by name, zero for those that the fit held; None where not computed."""
        if self.unnamed is None:
            return None
        root = self.unnamed.root
        return Unnamed(self.unnamed.effects, np.concatenate([self._by_name(root, names), root[len(self.names) :]]))

    def _by_name(self, root: np.ndarray, names: Sequence[str]) -> np.ndarray:
        rows, blank = rows_by_name(self.names, names), np.zeros(root.shape[1])
        return np.array([blank if row < 0 else root[row] for row in rows]).reshape(-1, len(blank))


def rows_by_name(kept: Sequence[str], names: Sequence[str]) -> np.ndarray:
    """Row of each name among kept ones.

    Args:
        kept: names in the file.
        names: wanted names, (w,).

    Returns:
        (w,) int, -1 where a name is not kept.
    """
    place = {name: number for number, name in enumerate(kept)}
    return np.array([place.get(name, -1) for name in names], dtype=int)


def keep(fitted: FitResult, heldout: float | None = None, helped: bool | None = None) -> Kept:
    """The part of a fit that is kept: its covariance without repeated frames and mounts.

    Of several tracker frames only the first is kept, since no command corrects a frame.

    Args:
        fitted: the fit.
        heldout: error of rows that it had not seen, mm; None where not known.
        helped: whether these were predicted better than by the drawing; None where nobody knows.
    """
    lasting = fitted.layout.lasting
    names, first = tuple(lasting), list(lasting.values())
    covariance = fitted.covariance[np.ix_(first, first)]
    unnamed = None if fitted.unnamed is None else fitted.unnamed.among(first, fitted.model.joints)
    if fitted.doubt is not None:
        doubt = fitted.layout.scale[first][:, None] * fitted.doubt[first]
        covariance = covariance + doubt @ doubt.T
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    root = size[:, None] * vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    return Kept(names, root, heldout, helped, unnamed=unnamed, turns=fitted.turns)


def keep_covariance(
    fitted: FitResult, heldout: float | None = None, helped: bool | None = None
) -> CovarianceSpec | None:
    """`keep` as a section of a machine file; None where nothing was fitted."""
    if not len(fitted.unknowns):
        return None
    kept = keep(fitted, heldout, helped)
    unnamed = kept.unnamed.spec() if kept.unnamed is not None and kept.unnamed.effects else None
    values, drawing = _digest_of_values(fitted.model), _digest_of_drawing(fitted.model)
    return CovarianceSpec(
        of=kept.names, root=pack(kept.root), values=values, drawing=drawing, heldout_mm=heldout, helped=helped,
        unnamed=unnamed, turns=kept.turns,
    )  # fmt: skip


def kept_covariance(model: Model) -> Kept | None:
    """Read what a machine file keeps.

    Args:
        model: as read.

    Returns:
        The covariance; None where there is none, or where its parameters or drawing are no longer those of the model.
    """
    spec = model.file.covariance
    if spec is None or _no_longer_of(spec, model):
        return None
    count, flat = len(spec.of), unpack(spec.root)
    if flat is None or len(flat) != count**2 or len(set(spec.of)) != count:
        return None
    unnamed = None if spec.unnamed is None else read_unnamed(spec.unnamed, count, model.joints)
    turns = spec.turns if len(spec.turns) == model.joints else ()
    return Kept(spec.of, flat.reshape(count, count), spec.heldout_mm, spec.helped, spec.masked, unnamed, turns)


def why_not_kept(model: Model) -> str:
    """What is wrong with the covariance in a machine file.

    Args:
        model: as read.

    Returns:
        A line with the way out; '' where nothing is wrong, or there is none.
    """
    spec = model.file.covariance
    if spec is None or not model.terms:
        return ""
    mend = "`ptt fit` on the run makes it anew"
    if other := _no_longer_of(spec, model):
        what = f"belongs to {other} Nothing tells how sure the commands are"
        return f"{model.file.source} [covariance] {what}; {mend}"
    kept = kept_covariance(model)
    if kept is None:
        return f"{model.file.source} [covariance] is damaged: nothing tells how sure the commands are; {mend}"
    if spec.unnamed is not None and kept.unnamed is None:
        what = "cannot be read: sigma_um leaves out sizes of the drawing that are not named"
        return f"{model.file.source} [covariance.unnamed] {what}; {mend}"
    return ""


def _no_longer_of(spec: CovarianceSpec, model: Model) -> str:
    """In words, whether the covariance belongs to other values or another drawing; '' where it is the model's."""
    if spec.values != _digest_of_values(model):
        return "other values than the effects have: was one edited?"
    if spec.drawing != _digest_of_drawing(model):
        return "another drawing than [machine] has, and so do the values of the effects: was it edited?"
    return ""


def _digest_of_drawing(model: Model) -> str:
    """Digest of the machine's drawing, without parts that no error depends on.

    Keys with default values are left out, so that keys introduced later do not change it.
    """
    return _digest(model.file.machine.model_dump_json(exclude=OUTSIDE_DIGEST, exclude_defaults=True))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _digest_of_values(model: Model) -> str:
    """Digest of the parameter values that a covariance belongs to, so that an edited value is noticed."""
    written = [(e.name, e.label, {k: v.value for k, v in e.parameters.items()}) for e in write_model(model).effect]
    return _digest(repr(written))
