"""Effects of the drives with hysteresis: backlash (play operator) and wind-up (Dahl friction)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.layout import family, per_joint
from ptt.effects.memory import gradual_reversal, gradual_slope, keep_reversals, play, play_slope
from ptt.effects.phrases import SMALL, Phrase
from ptt.effects.refinement import between_trials
from ptt.mechanisms.serial import Serial
from ptt.run.direction import STANDSTILL
from ptt.run.view import View

LONGEST = 64.0  # mm, six times what real friction takes; longer than the travel between reversals it is but a step
WINDUP_LENGTHS = tuple(2.0 ** (half / 2.0) for half in range(-10, 11))  # mm, 0.03 to 32: neighbours are nearly alike

GAPS = (0.02, 0.06, 0.2, 0.6)  # mm, from ground to worn screws; a gap in between differs from one of them by few rows
WAITS, AT_ONCE = ({"waits": torch.tensor([waits], dtype=torch.float64)} for waits in (1.0, 0.0))
LATE = 0.02  # share of the gap, mean over rows, that play and its sign alone have to differ by to be worth a trial
SEEN = 0.02  # mean difference of normalised friction and direction from which readings show the change-over

SET = ("raise the reversal compensation of {who} by {what}", "lower the reversal compensation of {who} by {what}")


@dataclass(frozen=True)
class Backlash(Effect):
    """Play between nut and screw: the slider stays half the gap behind, on the side it comes from.

    After a reversal it waits until the gap is taken up (play operator). With `waits` = 0, and where the gap is negative
    (a controller that compensates more than there is), the shift follows the sign of the motion at once.
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
        """The limit of a small gap, and gaps that some rows of these data do not take up."""
        scale = 1.0 if family(view) == "three-ptt" else 0.01
        gaps = [torch.tensor([gap * scale], dtype=torch.float64) for gap in GAPS]
        late = [gap for gap in gaps if float(self._late(view, gap).abs().mean()) > LATE]
        return (WAITS, *({**WAITS, "about": gap} for gap in late))

    def meant_by(self, view: View, shape: Mapping[str, Tensor], amounts: Tensor) -> Sequence[Mapping[str, Tensor]]:
        """Play with the gap that was found, and the sign alone: both have the limit of a small gap in common."""
        if "about" in shape or float((amounts * self._late(view, amounts)).abs().max()) < STANDSTILL:
            return ()
        return {**WAITS, "about": amounts}, AT_ONCE

    def _late(self, view: View, gap: Tensor) -> Tensor:
        """Difference between play with a gap and its limit for a small one, per unit of gap, (n, k)."""
        return self._per_gap(view, gap) + 0.5 * view.direction

    def _per_gap(self, view: View, gap: Tensor) -> Tensor:
        """Shift of play with a gap, per unit of gap, (n, k); of a negative gap the sign alone."""
        gap, once = gap.expand(view.joints), -0.5 * view.direction
        return torch.where(gap > 0.0, play(view, gap.clamp(min=0.0)) / torch.where(gap > 0.0, gap, 1.0), once)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Play with the gap `about` per unit of gap; without it its limit for a small gap, -1/2 times the direction."""
        return per_joint(self._per_gap(view, shape["about"]) if "about" in shape else -0.5 * view.direction)

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """The play operator; where the gap is negative or nothing waits, -gap/2 times the direction."""
        gap, waits = gap_of(theta)
        once = -0.5 * gap * view.direction
        return torch.where(gap > 0.0, play(view, gap.clamp(min=0.0)), once) if waits else once

    def slope(self, theta: Tensor, view: View) -> Tensor:
        """Derivative by each joint's gap, between -1/2 and 1/2; zero by `waits`, which is given."""
        gap, waits = gap_of(theta)
        once = -0.5 * view.direction
        by_gap = per_joint(torch.where(gap > 0.0, play_slope(view, gap.clamp(min=0.0)), once) if waits else once)
        return torch.cat([by_gap, torch.zeros_like(by_gap[..., :1])], dim=-1)

    def cause(self, theta: Tensor, view: View) -> str:
        """With the remark that a positive gap is not waited for, where that is so."""
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
        return self.cause_measured(theta, view, torch.ones_like(theta, dtype=torch.bool))

    def cause_measured(self, theta: Tensor, view: View, measured: Tensor) -> str:
        """With the travel that it takes, of the joints that wind up notably and whose travel readings tell."""
        unit = "rad" if isinstance(view.mechanism, Serial) else "mm"
        heights, lengths = theta.view(2, -1)
        size = heights.abs()
        told = (size >= SMALL * size.max()) & measured.view(2, -1)[1]
        if not told.any():
            return "wind-up, over travel that this run does not tell"
        low, high = (f"{float(each):.2g}" for each in torch.aminmax(lengths[told]))
        return f"wind-up, over {low if low == high else f'{low} to {high}'} {unit} of travel"

    def needs(self, view: View) -> str | None:
        """Readings soon after reversals and long after them."""
        wanting = super().needs(view)
        if wanting or self._lengths(view):
            return wanting
        return "readings at different travel since reversal (some within a few mm of it)"

    def _lengths(self, view: View) -> list[Tensor]:
        """Travel constants, (k,) each and alike for all joints, at which some readings are not yet turned over."""
        if not view.kept:
            scale = 1.0 if family(view) == "three-ptt" else 0.01
            alike = view.q.new_ones(view.joints) * scale
            keep_reversals(view, [length * alike for length in WINDUP_LENGTHS])
        return [length for length, turned in view.kept.values() if float((turned - view.direction).abs().mean()) > SEEN]

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """Geometrically spaced travel constants, the one nearest to the usual first."""
        usual, lengths = self.parameters[-1].on(family(view)).usual, self._lengths(view)
        first = min(lengths, key=lambda length: abs(math.log(float(length[0]) / usual)), default=None)
        return tuple({"length": length} for length in sorted(lengths, key=lambda length: length is not first))

    def usual_trial(self, view: View) -> Mapping[str, Tensor]:
        """The one nearest to the usual."""
        return self.search(view)[0]

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Constants between the trials on either side; the fit itself goes on from there."""
        return between_trials(self.search(view), shape, "length")

    def largest(self, shape: Mapping[str, Tensor]) -> Mapping[str, float | Tensor]:
        """Height at most half the length: the error changes at first by 2 h / l of the travel, and 1 is a standstill.

        Beyond that the slider would go back while its drive goes on.
        """
        return {"height": 0.5 * shape["length"]}

    def slope_by(self, stem: str, linear: Tensor, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """By each joint's own length, in closed form: autograd would need a pass for every joint."""
        return per_joint(-linear * gradual_slope(view, shape[stem]))

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Normalised friction of each axis, reversed."""
        return per_joint(-gradual_reversal(view, shape["length"]))
