"""Effects of the structure: column and frame bend under load or grow with temperature."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.late import BEGAN, LATE, START, Growth, late_warmth, warmth_of
from ptt.effects.phrases import Phrase
from ptt.mechanisms.derivatives import by_parameters
from ptt.mechanisms.sensitivity import sensitivity
from ptt.run.view import View

# Largest expansion in units of the usual one, that of steel: zinc has 2.5, and a sensor in the room warms less than
# the frame. The lower limits below: carbon fibre shrinks by up to a tenth of it, and the effective radius R - r of a
# machine shrinks where its platform grows more than its base.
LARGEST_EXPANSION = 4.0


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
    called: ClassVar[str] = "column bend"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "sway",
            "bends toward +{axis} by {what} of payload",
            "bends toward -{axis} by {what} of payload",
            "the column",
        ),
        Phrase(
            "slope",
            "bends more toward +{axis} with height, by {what} of payload",
            "bends more toward -{axis} with height, by {what} of payload",
            "the column",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="Column or frame bends sideways under the payload, more the higher the sliders carry it.",
        equation="dp = m (u + v (mean(q) - q0)), u and v horizontal, m the payload, q0 the mean height at p = 0",
        source="linear elasticity, first order in height",
        size="1 to 5 um/kg",
        fingerprint="A sideways shift proportional to payload, the same everywhere in x and y, changing with height.",
        confused_with=(
            ("axis-compliance", "varies over x and y and sags in z: one payload at poses spread wide"),
            ("tower-tilt", "does not follow payload: repeat under another payload"),
            ("setup-jump", "a tripod that moved while the payload was changed: revisit an unloaded datum"),
        ),
        remedy="Brace the column; keep payloads alike, or correct by payload.",
        needs="payload_kg with at least two loads",
        residual="x",
        telling="payload",
        shade="z",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Payload, and payload times height, each in x and y."""
        height = (view.q - view.home).mean(dim=1)
        horizontal = torch.eye(3, 2, dtype=view.q.dtype)
        steady = view.payload[:, None, None] * horizontal
        return torch.cat([steady, height[:, None, None] * steady], dim=-1)


@dataclass(frozen=True)
class FrameGrowth(Growth):
    """Frame and links grow with temperature: the base radius and the links (serial: every a and d) by a dT."""

    name: ClassVar[str] = "frame-growth"
    stage: ClassVar[Stage] = "structure"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "radius",
            "1/K",
            1.2e-5,
            "expansion of the base radius (serial: of every a)",
            within=(-1.0, LARGEST_EXPANSION),
        ),
        Parameter(
            "link", "1/K", 1.2e-5, "expansion of the links (serial: of every d)", within=(-0.1, LARGEST_EXPANSION)
        ),
        START,
        LATE,
    )
    called: ClassVar[str] = "frame growth"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "radius",
            "grows {what} with warmth",
            "shrinks {what} with warmth",
            "the base radius",
            arm=("grow {what} with warmth", "shrink {what} with warmth"),
            arm_who="the lengths along x",
        ),
        Phrase(
            "link",
            "grow {what} with warmth",
            "shrink {what} with warmth",
            "the links",
            arm_who="the lengths along z",
        ),
        BEGAN,
    )
    card: ClassVar[Card] = Card(
        cause="Frame and links grow as they warm; each with its own material.",
        equation=(
            "dp = f(q; R (1 + a_R dT), L (1 + a_L dT)) - f(q; R, L), R the base radius, L the links (serial: every a, "
            "every d), f the forward kinematics, dT = temp_c - reference_temp_c, or that of a body that is late "
            "(as of screw-growth)"
        ),
        source="linear thermal expansion (steel 11 to 12, aluminium 23 um/m/K); method of ISO 230-3",
        size="5 to 7 um at 2 K",
        fingerprint="A drift, mostly in z, shaped like a link or radius error, in step with temperature.",
        confused_with=(
            ("tracker-drift", "moves fixed reflectors too: read base reflectors through the run"),
            ("screw-growth", "a line in height for each slider: poses over the whole travel, warm and cold"),
            ("radius against link", "nearly one pattern in a small volume: poses wide in x and y"),
        ),
        remedy="Hold the room steady, warm up, shield from sun and draught; correct by a frame temperature sensor.",
        needs="temp_c with a change of temperature",
        residual="z",
        telling="temperature",
        shade="radius",
        arm_cause="The links grow as they warm.",
        arm_size="12 to 23 um/m/K, steel to aluminium",
        arm_fingerprint="The tool moves away from the base, more the further it reaches, in step with temperature.",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Tool shift per unit strain of radius and links, times warmth: the limit of a small strain."""
        warmth = late_warmth(view, shape["start"], shape["late"])
        return warmth[:, None, None] * self._per_strain(view, torch.zeros_like(view.growth[:1]))

    def slope(self, theta: Tensor, view: View) -> Tensor:
        """Derivative at the strain that there is: by both expansions, and by what the body's warmth depends on."""
        warmth = warmth_of(self, theta, view)
        by_strain = self._per_strain(view, (warmth[:, None] * theta[:2]) @ view.growth)
        by_shape = by_parameters(lambda shape: late_warmth(view, shape[:-1], shape[-1:]), theta[2:])
        return torch.cat([warmth[:, None, None] * by_strain, (by_strain @ theta[:2, None]) * by_shape[:, None]], dim=-1)

    def _per_strain(self, view: View, grown: Tensor) -> Tensor:
        """Tool shift per unit strain of radius and links, (n, 3, 2) mm, at geometry shifts (n, G)."""
        _, _, by_slot = sensitivity(view.mechanism, view.q, view.mounted(grown))
        return by_slot @ view.growth.T

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """Position of the grown machine less that of the drawn one: near a singularity 1e-4 is no small strain."""
        strain = warmth_of(self, theta, view)[:, None] * theta[:2]  # shape: (n, 2)
        still = torch.zeros_like(view.growth[:1])
        grown = view.mechanism.forward(view.q, view.mounted(strain @ view.growth))
        return grown - view.mechanism.forward(view.q, view.mounted(still))
