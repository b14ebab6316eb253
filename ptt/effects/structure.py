"""Effects of the structure: what carries the mechanism gives way or grows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.mechanisms.sensitivity import sensitivity
from ptt.view import View


@dataclass(frozen=True)
class ColumnBend(Effect):
    """The column bends under the payload: payload x (u + v (mean q - q0)), u and v horizontal."""

    name: ClassVar[str] = "column-bend"
    stage: ClassVar[Stage] = "structure"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("sway", "mm/kg", 2e-3, "sideways yield at home, x and y", count=2),
        Parameter("slope", "1/kg", 2e-5, "sideways yield per mm of height, x and y", count=2),
    )
    requires: ClassVar[tuple[str, ...]] = ("payload",)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Payload, and payload times height, each in x and y."""
        height = (view.q - view.home).mean(dim=1)
        horizontal = torch.eye(3, 2, dtype=view.q.dtype)
        steady = view.payload[:, None, None] * horizontal
        return torch.cat([steady, height[:, None, None] * steady], dim=-1)


@dataclass(frozen=True)
class FrameGrowth(Effect):
    """Frame and links grow with temperature: the base radius and the links (serial: every a and d) by a dT."""

    name: ClassVar[str] = "frame-growth"
    stage: ClassVar[Stage] = "structure"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("radius", "1/K", 1.2e-5, "expansion of the base radius (serial: of every a)"),
        Parameter("link", "1/K", 1.2e-5, "expansion of the links (serial: of every d)"),
    )
    requires: ClassVar[tuple[str, ...]] = ("temperature",)
    follows_clock: ClassVar[bool] = True

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Tool shift per unit strain of radius and links, times warmth: the limit of a small strain."""
        _, _, by_slot = sensitivity(view.mechanism, view.q, view.mounted(torch.zeros_like(view.growth[:1])))
        return view.warmth[:, None, None] * (by_slot @ view.growth.T)

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """The grown machine's position less the drawn one's: near the edge strains of 1e-4 are no longer small."""
        strain = view.warmth[:, None] * theta  # shape: (n, 2)
        still = torch.zeros_like(view.growth[:1])
        grown = view.mechanism.forward(view.q, view.mounted(strain @ view.growth))
        return grown - view.mechanism.forward(view.q, view.mounted(still))
