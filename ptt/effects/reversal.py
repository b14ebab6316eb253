"""Effects of the drives that remember from where an axis came."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.constants import finer
from ptt.effects.layout import family, per_joint
from ptt.effects.memory import gradual_reversal, gradual_slope, keep_reversals, play, play_slope
from ptt.effects.phrases import SMALL, Phrase
from ptt.mechanisms.serial import Serial
from ptt.run.direction import STANDSTILL
from ptt.run.view import View

LONGEST = 64.0  # mm of travel, six times what friction takes: over more than lies between reversals it is but a step
WINDUP_LENGTHS = tuple(2.0 ** (half / 2.0) for half in range(-10, 11))  # mm, 0.03 to 32: neighbours look alike

GAPS = (0.02, 0.06, 0.2, 0.6)  # mm, from ground to worn screws: between them a row more or less takes the gap up
WAITS, AT_ONCE = ({"waits": torch.tensor([waits], dtype=torch.float64)} for waits in (1.0, 0.0))
LATE = 0.02  # of the gap, mean over the rows: rows that wait for it, from which they are worth a trial

SET = ("raise the reversal compensation of {who} by {what}", "lower the reversal compensation of {who} by {what}")


@dataclass(frozen=True)
class Backlash(Effect):
    """Play between nut and screw: the slider stays half the gap behind, on the side it comes from.

    After a reversal it waits until the gap is taken up. A preloaded drive, and a sign of the move that somebody wrote
    for play, turn over at once; so does a controller that compensates more than there is, whose gap is below zero.
    """

    name: ClassVar[str] = "backlash"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "gap",
            "mm",
            0.05,
            "lost motion on reversal; below zero: compensated too much",
            True,
            axis=True,
            usual_rad=5e-4,
        ),
        Parameter(
            "waits", "1", 1.0, "1: a reversal waits until the gap is taken up; 0: it turns over at once", lower=0.0,
            upper=1.0, role="given", default=1.0,
        ),
    )  # fmt: skip
    requires: ClassVar[tuple[str, ...]] = ("direction",)
    reverses: ClassVar[bool] = True
    called: ClassVar[str] = "backlash"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "gap",
            "lose{s} {what} on reversal",
            "compensate{s} {what} too much on reversal",
            mend=SET,
            arm_mend=SET,
        ),
    )
    card: ClassVar[Card] = Card(
        cause="Play between nut and screw, or a loose thrust bearing: after a reversal the slider waits for the gap.",
        equation=(
            "y = min(max(y_before, q - e_i/2), q + e_i/2), dq_i = y - q: -e_i/2 in the direction of travel once the "
            "gap is taken up, between the branches before; a run's first row is taken to arrive as its second moves; "
            "below zero (a controller that compensates more than there is), and where nothing waits for it (waits = 0, "
            "as rows within the gap tell): -e_i/2 in the direction of travel, at once"
        ),
        source="play operator: Visintin, Differential Models of Hysteresis, 1994; Chen Mingfang et al. 2023, eq. 19",
        size="rolled screw 50 to 200 um; preloaded C5 8 to 15 um",
        fingerprint="J e falls on two parallel branches, e apart, by the direction in which the slider arrived.",
        confused_with=(
            ("windup", "changes over gradually: readings within a few mm of a reversal, and far from it"),
            ("joint-clearance", "follows the link force, not the direction: a linear scale and the tracker at once"),
            ("following-error", "gone at standstill: dwell before reading"),
        ),
        remedy=(
            "Preload or replace the nut, tighten the thrust bearing; else reversal compensation in the controller. "
            "Below zero: lower the controller's reversal compensation by as much."
        ),
        needs="poses reached from both directions",
        shade="direction",
        arm_cause="Play between the teeth of a joint's gear or in its belt: after a reversal it waits for the gap.",
        arm_size="gears of industrial arms 0.1 to 0.3 mrad, plain planetary gears 0.5 to 2 mrad",
        arm_fingerprint="J e falls on two parallel branches, e apart, by the direction in which the joint arrived.",
        arm_remedy=(
            "Take up the gear's mesh or tension its belt; else reversal compensation in the controller. Below zero: "
            "lower the controller's reversal compensation by as much."
        ),
    )

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """The limit of a small gap, and gaps that moves as short as these take up only over several rows."""
        scale = 1.0 if family(view) == "three-ptt" else 0.01
        gaps = [torch.tensor([gap * scale], dtype=torch.float64) for gap in GAPS]
        late = [gap for gap in gaps if float(self._late(view, gap).abs().mean()) > LATE]
        return (WAITS, *({**WAITS, "about": gap} for gap in late))

    def meant_by(self, view: View, shape: Mapping[str, Tensor], amounts: Tensor) -> Sequence[Mapping[str, Tensor]]:
        """The limit of a small gap stands for play as wide as it is, and for what turns over at once."""
        if "about" in shape or float((amounts * self._late(view, amounts)).abs().max()) < STANDSTILL:
            return ()
        return {**WAITS, "about": amounts}, AT_ONCE

    def _late(self, view: View, gap: Tensor) -> Tensor:
        """What waiting for a gap does, per unit of it, (n, k)."""
        return self._at(view, gap) + 0.5 * view.direction

    def _at(self, view: View, gap: Tensor) -> Tensor:
        """What a gap does that is waited for, per unit of it, (n, k)."""
        gap, once = gap.expand(view.joints), -0.5 * view.direction
        return torch.where(gap > 0.0, play(view, gap.clamp(min=0.0)) / torch.where(gap > 0.0, gap, 1.0), once)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Half the gap against the direction of arrival, the limit of a small one; or as the gap `about` does."""
        return per_joint(self._at(view, shape["about"]) if "about" in shape else -0.5 * view.direction)

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """The play operator itself, which knows when the gap is not taken up yet; at once the sign alone."""
        gap, waits = gap_of(theta)
        once = -0.5 * gap * view.direction
        return torch.where(gap > 0.0, play(view, gap.clamp(min=0.0)), once) if waits else once

    def slope(self, theta: Tensor, view: View) -> Tensor:
        """Half the gap's change, on the side on which the play is taken up; none between the branches."""
        gap, waits = gap_of(theta)
        once = -0.5 * view.direction
        by_gap = per_joint(torch.where(gap > 0.0, play_slope(view, gap.clamp(min=0.0)), once) if waits else once)
        return torch.cat([by_gap, torch.zeros_like(by_gap[..., :1])], dim=-1)

    def cause(self, theta: Tensor, view: View) -> str:
        """Whether it turns over at once, which a gap above zero does not."""
        gap, waits = gap_of(theta)
        at_once = not waits and bool((gap > 0.0).any())
        return super().cause(theta, view) + (" that turns over at once" if at_once else "")


def gap_of(theta: Tensor) -> tuple[Tensor, bool]:
    """The gaps of a backlash, (k,) mm or rad, and whether they are waited for."""
    return theta[:-1], bool(theta[-1] > 0.5)


@dataclass(frozen=True)
class Windup(Effect):
    """Friction winds the drive up: the error changes over gradually after a reversal, -h_i F(travel / l_i)."""

    name: ClassVar[str] = "windup"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "height", "mm", 0.005, "half the change on full reversal", True, lower=0.0, axis=True, usual_rad=1e-4
        ),
        Parameter(
            "length",
            "mm",
            2.0,
            "travel over which it changes",
            True,
            lower=1e-3,
            most=LONGEST,
            role="searched",
            axis=True,
            usual_rad=2e-2,
        ),
    )
    requires: ClassVar[tuple[str, ...]] = ("direction",)
    reverses: ClassVar[bool] = True
    called: ClassVar[str] = "wind-up"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "height",
            "change{s} over gradually by {what} after a reversal",
            "run{s} ahead gradually by {what} after a reversal",
            times=2.0,
        ),
    )
    card: ClassVar[Card] = Card(
        cause="Friction in guide and nut twists screw and coupling until it is overcome, at each reversal.",
        equation="dq_i = -h_i F, dF/dx = (sign(dx) - F)/l_i along the travel x; fully turned before a run's first row",
        source="Dahl, A Solid Friction Model, The Aerospace Corporation, 1968",
        size="1 to 10 um over 1 to 10 mm of travel",
        fingerprint="Two branches by direction that grow into each other over the first millimetres after a reversal.",
        confused_with=(
            ("backlash", "opens at once when the gap is taken up: short against long travel after a reversal"),
            ("axis-compliance", "follows payload, not direction: repeat under another payload"),
        ),
        remedy="Lubricate, relieve the preload, stiffen the coupling; overtravel and return from one side always.",
        needs="poses from both directions, some within a few mm of the reversal",
        telling="travel",
        arm_cause="Friction in seals and gear twists gear and coupling until it is overcome, at each reversal.",
        arm_size="0.05 to 0.5 mrad over 5 to 50 mrad of travel",
        arm_fingerprint="Two branches by direction that grow into each other over the first degrees after a reversal.",
        arm_remedy="Lubricate, stiffen gear and coupling; overtravel and return from one side always.",
        shade="direction",
    )

    def cause(self, theta: Tensor, view: View) -> str:
        """With the travel that it takes."""
        unit = "rad" if isinstance(view.mechanism, Serial) else "mm"
        heights, lengths = theta.view(2, -1)
        size = heights.abs()
        low, high = (f"{float(each):.2g}" for each in torch.aminmax(lengths[size >= SMALL * size.max()]))
        return f"wind-up, over {low if low == high else f'{low} to {high}'} {unit} of travel"

    def needs(self, view: View) -> str | None:
        """Readings soon and long after reversals."""
        wanting = super().needs(view)
        if wanting or self._lengths(view):
            return wanting
        return "readings at different travel since reversal (some within a few mm of it)"

    def _lengths(self, view: View) -> list[Tensor]:
        """Travel constants that the data can see, (k,) alike each: some readings change over, some are done."""
        if not view.kept:
            scale = 1.0 if family(view) == "three-ptt" else 0.01
            alike = view.q.new_ones(view.joints) * scale
            keep_reversals(view, [length * alike for length in WINDUP_LENGTHS])
        return [length for length, turned in view.kept.values() if float((turned - view.direction).abs().mean()) > 0.02]

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """A geometric ladder of travel constants, the one next to the usual first."""
        usual, lengths = self.parameters[-1].on(family(view)).usual, self._lengths(view)
        first = min(lengths, key=lambda length: abs(math.log(float(length[0]) / usual)), default=None)
        return tuple({"length": length} for length in sorted(lengths, key=lambda length: length is not first))

    def usual_trial(self, view: View) -> Mapping[str, Tensor]:
        """The one next to the usual."""
        return self.search(view)[0]

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Constants between the trials on either side; the fit itself goes on from there."""
        return finer(self.search(view), shape, "length")

    def largest(self, shape: Mapping[str, Tensor]) -> Mapping[str, float | Tensor]:
        """Half the travel: a slider cannot go back while its drive goes on, and one that stands still has play.

        The error changes by 2 h / l of the travel at first.
        """
        return {"height": 0.5 * shape["length"]}

    def slope_by(self, stem: str, linear: Tensor, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """By the lengths, each joint by its own, for which autograd would need a pass a joint."""
        return per_joint(-linear * gradual_slope(view, shape[stem]))

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Normalised friction of each axis, against the travel."""
        return per_joint(-gradual_reversal(view, shape["length"]))
