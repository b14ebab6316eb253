"""Which numbers a fit may change: parameters, reflector mounts and tracker frames, packed in their usual sizes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ptt.effects.layout import shape_of
from ptt.effects.parameter import Parameter
from ptt.effects.usual import usual_values
from ptt.model.model import Model, Term, parameter_names
from ptt.run.problem import MOUNT_USUAL, SHIFT_USUAL, TURN_USUAL, Problem
from ptt.run.view import View

FRAME_NAMES = ("tracker x", "tracker y", "tracker z", "tracker rotation about x", "tracker rotation about y",
               "tracker rotation about z")  # fmt: skip
MOUNT_NAMES = ("reflector mount x", "reflector mount y", "reflector mount z")
# to their geometric mean, of lengths that each joint has its own of: a far shorter one is play by another name
MOST_LENGTH_RATIO = 4.0
FRAME, MOUNT = -1, -2  # owners of the unknowns of frames and reflector mounts, which belong to no effect


@dataclass(frozen=True)
class Layout:
    """Order and scale of the unknowns: free effect parameters, term by term, then three a mount, then six a frame.

    Attributes:
        terms: the model's terms, their given parameters held.
        free: for each term, (P,) bool of what may change.
        scale: (u,) usual size of each unknown.
        lower: (u,) bound in units of scale.
        upper: (u,) bound in units of scale.
        held: (u,) bool, kept near zero with a prior of its scale, by definition of the effect and of those beside it.
        owner: (u,) int, index of the term; FRAME or MOUNT for those.
        group: (u,) int, group of unknowns with a common prior variance: those of one parameter (slopes and levels
            apart) and of parameters joined to it; -1 for frames and mounts.
        kinds: of each group: 'free', 'held' as above, 'searched', 'near' where each joint has its own value of what was
            searched as one value for all, or 'resting' where a searched value is about zero.
        names: one for each unknown.
        frames: number of frames.
        mounts: number of reflector mounts.
    """

    terms: tuple[Term, ...]
    free: tuple[np.ndarray, ...]
    scale: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    held: np.ndarray
    owner: np.ndarray
    group: np.ndarray
    kinds: tuple[str, ...]
    names: tuple[str, ...]
    frames: int
    mounts: int = 0

    @property
    def searched(self) -> np.ndarray:
        """(u,) bool, nonlinear shape parameters, which start where a search left them."""
        return np.array([kind in ("searched", "near", "resting") for kind in self.kinds] + [False])[self.group]

    def thetas(self, unknowns: np.ndarray) -> list[Tensor]:
        """Full flat parameters of every term at these unknowns."""
        values = unknowns * self.scale
        result, start = [], 0
        for term, free in zip(self.terms, self.free, strict=True):
            theta = term.theta.clone()
            count = int(free.sum())
            theta[torch.as_tensor(free)] = torch.as_tensor(values[start : start + count])
            result.append(theta)
            start += count
        return result

    def frame_parameters(self, unknowns: np.ndarray) -> Tensor:
        """Frame motions at these unknowns, (f, 6) mm and rad."""
        values = (unknowns * self.scale)[len(unknowns) - 6 * self.frames :]
        return torch.as_tensor(values.reshape(self.frames, 6))

    def see(self, problem: Problem, unknowns: np.ndarray) -> View:
        """The problem's rows with the reflectors where these unknowns put them."""
        if not self.mounts or problem.view.mount is None:
            return problem.view
        end = len(unknowns) - 6 * self.frames
        values = (unknowns * self.scale)[end - 3 * self.mounts : end].reshape(-1, 3)
        return replace(problem.view, mount=problem.view.mount + torch.as_tensor(values[problem.mount]))

    def start(self) -> np.ndarray:
        """Unknowns at the terms' present values, mounts and frames unmoved."""
        parts = [term.theta.numpy()[free] for term, free in zip(self.terms, self.free, strict=True)]
        values = np.concatenate([*parts, np.zeros(3 * self.mounts + 6 * self.frames)])
        return values / self.scale

    @property
    def lasting(self) -> dict[str, int]:
        """Name -> index of each unknown to keep: of several mounts and frames the first, without its run."""
        several = [*((name, self.frames) for name in FRAME_NAMES), *((name, self.mounts) for name in MOUNT_NAMES)]
        found: dict[str, int] = {}
        for place, name in enumerate(self.names):
            own = next((plain for plain, count in several if count > 1 and name.startswith(f"{plain} of run ")), name)
            found.setdefault(own, place)
        return found

    def columns(self) -> np.ndarray:
        """Which columns of the terms' joined Jacobian are free, (sum P,) bool."""
        return np.concatenate(self.free) if self.free else np.zeros(0, dtype=bool)


def lay_out(model: Model, problem: Problem, terms: Sequence[Term]) -> Layout:
    """Lay out the unknowns of a model.

    Args:
        model: for the mechanism family.
        problem: for the number of frames and mounts.
        terms: the terms, with values.

    Returns:
        The layout.
    """
    fitted = {term.effect.name for term in terms if not all(p.stem in term.fixed for p in term.effect.parameters)}
    unknowns: list[_Unknown] = []
    kinds: list[str] = []
    free = []
    for index, term in enumerate(terms):
        own, flags = _of_term(term, index, model.file.machine.kind, problem.view, fitted, kinds)
        unknowns += own
        free.append(flags)
    runs = problem.table.run_label
    for mount in range(problem.mounts):
        run = f" of run {runs[mount]}" if problem.mounts > 1 else ""
        unknowns += [_Unknown(name + run, MOUNT_USUAL, MOUNT) for name in MOUNT_NAMES]
    for frame in range(problem.frames):
        run = f" of run {runs[frame]}" if problem.frames > 1 else ""
        unknowns += [
            _Unknown(name + run, usual, FRAME)
            for name, usual in zip(FRAME_NAMES, (SHIFT_USUAL,) * 3 + (TURN_USUAL,) * 3, strict=True)
        ]
    names, scale, owner, group, lower, upper, held = zip(*unknowns, strict=True) if unknowns else ((),) * 7
    return Layout(
        tuple(terms), tuple(free), np.array(scale), np.array(lower), np.array(upper), np.array(held, dtype=bool),
        np.array(owner, dtype=int), np.array(group, dtype=int), tuple(kinds), names, problem.frames, problem.mounts,
    )  # fmt: skip


class _Unknown(NamedTuple):
    """One number that a fit may change; a mount's or a frame's has no bounds and no group."""

    name: str
    scale: float
    owner: int
    group: int = -1
    lower: float = -np.inf
    upper: float = np.inf
    held: bool = False


def _of_term(
    term: Term, index: int, kind: str, view: View, fitted: set[str], kinds: list[str]
) -> tuple[list[_Unknown], np.ndarray]:
    """Unknowns of one term, and which of its values they are, (P,) bool; its groups are appended to `kinds`."""
    unknowns, flags = list[_Unknown](), list[bool]()
    joints, usual = view.joints, iter(usual_values(term.effect, view).tolist())
    local, held = iter(parameter_names(term.effect, kind, joints)), _held_stems(term, joints)
    for parameter in (p.on(kind) for p in term.effect.parameters):
        size = parameter.size(joints)
        names, sizes = list(islice(local, size)), list(islice(usual, size))
        present = term.theta[len(flags) : len(flags) + size].numpy()
        count = min(size, len(view.beginnings)) if parameter.at_beginnings else size
        flags += [parameter.stem not in held and number < count for number in range(size)]
        if parameter.stem in held:
            continue
        names, sizes, parts = names[:count], sizes[:count], _kinds(parameter, count, fitted)
        groups = list(dict.fromkeys(parts))
        first = len(kinds) - parameter.joined
        low, high = bounds_of(parameter, present)
        unknowns += [
            _Unknown(
                f"{term.effect.key} {name}", own, index, first + groups.index(part), low / own, high / own,
                part[0] == "held",
            )
            for name, own, part in zip(names, sizes, parts, strict=True)
        ]  # fmt: skip
        kinds += [own for own, _ in groups[len(kinds) - first :]]
    return unknowns, np.array(flags, dtype=bool)


def _held_stems(term: Term, joints: int) -> set[str]:
    """Parameters that no fit changes: given and fixed ones, and a shape that a search left at its default throughout.

    In that shape the effect is without what it describes (growth that is late), which a fit does not bring in.
    """
    parameters, shape = term.effect.parameters, shape_of(term.effect, term.theta, joints)
    plain = {each.stem: each.default for each in parameters if each.role == "searched" and each.default is not None}
    without = all(bool((shape[stem] == default).all()) for stem, default in plain.items())
    given = {each.stem for each in parameters if each.role == "given"}
    return given | term.fixed | (set(plain) if without else set())


def bounds_of(parameter: Parameter, present: np.ndarray) -> tuple[float, float]:
    """Bounds of the values of one parameter in a fit.

    Args:
        parameter: as on its mechanism family.
        present: its present values, which lie within, in its unit; empty where there are none.

    Returns:
        The least and the largest, in its unit.
    """
    low, high = parameter.lower, min(parameter.upper, parameter.most)
    if not parameter.apart or not len(present):
        return low, high
    mean = float(np.exp(np.log(np.maximum(present, low)).mean()))
    return max(low, min(mean / MOST_LENGTH_RATIO, present.min())), min(
        high, max(mean * MOST_LENGTH_RATIO, present.max())
    )


def _kinds(parameter: Parameter, size: int, fitted: set[str]) -> list[tuple[str, str]]:
    """Kind of each value, and the effect that it is lent to or ''; values equal in both share a prior variance."""
    found = "near" if parameter.apart else "resting" if parameter.held else "searched"
    kind = found if parameter.role == "searched" else "held" if parameter.held else "free"
    if not parameter.lent:
        return [(kind, "")] * size
    # Slope and level are separate groups: where a frame takes the level, a large slope must not make it uncertain.
    owners = parameter.lent * (size // len(parameter.lent))
    return [("held", "") if name in fitted else ("free", name) for name in owners]
