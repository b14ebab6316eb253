"""Effects of the metrology: the machine is right, the tracker says otherwise. Never sent to the machine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage, finer
from ptt.effects.sudden import AFTER, Sudden
from ptt.view import View

SETTLING = (1e3, 0.5, 0.2, 0.07)  # shares of the run: a straight line, and slow to fast; refined between


@dataclass(frozen=True)
class MetrologyEffect(Effect):
    """Base of the metrology effects."""

    stage: ClassVar[Stage] = "metrology"


@dataclass(frozen=True)
class TrackerFrame(MetrologyEffect):
    """The readings are shifted and turned as a whole: t + w x p."""

    name: ClassVar[str] = "tracker-frame"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("shift", "mm", 0.5, "translation of the readings, x, y, z", count=3),
        Parameter("turn", "rad", 5e-4, "rotation of the readings about x, y, z", count=3),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Rigid motion, first order."""
        return rigid_basis(view.p)


@dataclass(frozen=True)
class TrackerScale(MetrologyEffect):
    """The tracker's length unit is off: s p, about the base origin."""

    name: ClassVar[str] = "tracker-scale"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("scale", "1", 2e-5, "share by which readings are long"),)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """The position itself."""
        return view.p[..., None]


@dataclass(frozen=True)
class TrackerDrift(MetrologyEffect):
    """The tracker's station wanders with time: a t, or a (1 - exp(-t / T)) while it settles."""

    name: ClassVar[str] = "tracker-drift"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("drift", "mm", 0.02, "how far it goes over the whole run, x, y, z", count=3),
        Parameter(
            "settling", "s", 3600.0, "time constant T; a thousand times the run is a straight line", role="given"
        ),
        Parameter("duration", "s", 3600.0, "length of the run that the drift is stated for", role="given"),
    )
    requires: ClassVar[tuple[str, ...]] = ("time",)
    follows_clock: ClassVar[bool] = True

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """A straight line and three speeds of settling."""
        whole = view.time.max()
        return tuple({"settling": (part * whole).reshape(1), "duration": whole.reshape(1)} for part in SETTLING)

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Constants between the trials on either side; a straight line is no end of that scale."""
        straight, *trials = self.search(view)
        return (shape,) if float(shape["settling"]) >= float(straight["settling"]) else finer(trials, shape, "settling")

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Share of the drift that is reached, in each coordinate."""
        reached = torch.expm1(-view.time / shape["settling"]) / torch.expm1(-shape["duration"] / shape["settling"])
        return reached[:, None, None] * torch.eye(3, dtype=view.p.dtype)


@dataclass(frozen=True)
class SetupJump(Sudden, MetrologyEffect):
    """The tripod was knocked: from some time on the readings are shifted and turned."""

    name: ClassVar[str] = "setup-jump"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("shift", "mm", 0.05, "translation of the readings after the knock, x, y, z", count=3),
        Parameter("turn", "rad", 5e-5, "rotation of the readings after the knock, about x, y, z", count=3),
        AFTER,
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Rigid motion after the knock."""
        return self.since(view, shape)[:, None, None] * rigid_basis(view.p)


def rigid_basis(p: Tensor) -> Tensor:
    """First-order rigid motion of points.

    Args:
        p: (n, 3) mm.

    Returns:
        (n, 3, 6): unit translations, then w x p for unit rotations.
    """
    eye = torch.eye(3, dtype=p.dtype).expand(len(p), 3, 3)
    turned = torch.linalg.cross(eye, p[:, None, :].expand(-1, 3, -1))  # shape: (n, axis, xyz)
    return torch.cat([eye, turned.transpose(1, 2)], dim=-1)
