"""Effects of the rails: where they stand, how they lean and wander (3-PTT)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Parameter
from ptt.effects.card import Card
from ptt.effects.curves import covered_range, curve_extremes
from ptt.effects.geometry import (
    CLOSURE,
    ThreePttEffect,
    across_axes,
    centre_basis,
    centre_slots,
    foot_axes,
    machine,
    upright,
)
from ptt.effects.layout import shape_of
from ptt.effects.phrases import Phrase, ValuePhrase
from ptt.effects.shapes import SHAPES, smooth_shapes, straight_shapes
from ptt.mechanisms.three_ptt import LEGS
from ptt.run.view import View


@dataclass(frozen=True)
class TowerPosition(ThreePttEffect):
    """The joint of leg i stands off radially and tangentially; base and platform joint enter alike."""

    name: ClassVar[str] = "tower-position"
    of_drawing: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("radial", "mm", 0.2, "joint too far out; of a flat rail, across it", True),
        Parameter("tangential", "mm", 0.2, "joint shifted along increasing azimuth", True),
    )
    noun: ClassVar[str] = "tower"
    called: ClassVar[str] = "tower position"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "radial",
            "stand{s} {what} too far outward",
            "stand{s} {what} too far inward",
            mend=("move {who} inward by {what}", "move {who} outward by {what}"),
        ),
        Phrase(
            "tangential",
            "stand{s} {what} too far counter-clockwise (seen from above)",
            "stand{s} {what} too far clockwise (seen from above)",
            mend=("move {who} clockwise by {what}", "move {who} counter-clockwise by {what}"),
        ),
    )
    card: ClassVar[Card] = Card(
        cause="A rail, its slider joint or its platform joint stands off from the drawing; the two joints count alike.",
        equation=(
            "dc_i = a_i u_i + b_i t_i (u_i outward, t_i along increasing azimuth; where rail e_i is "
            "flatter than 45 deg, n_i = t_i x e_i: outward is a homing offset there); J_i dp = s_i . dc_i/w_i"
        ),
        source=f"{CLOSURE}; calibration of parallel robots: Vischer and Clavel, Robotica 16, 1998",
        size="100 to 500 um",
        fingerprint="J e of leg i follows the horizontal reach of its link over its drop, q_i/w_i.",
        confused_with=(
            ("tracker-frame", "common sideways is tracker x, y; common tangential a turn about z: base reflectors"),
            ("link-length", "common radius and common length are 0.998 alike: poses wide in x and y, a measured link"),
            (
                "homing-offset",
                "on a rail that leans a shift across it is one outward beside a homing offset",
            ),
            ("platform joint position", "only the difference of the two counts: a coordinate measuring machine"),
        ),
        remedy="Shim or dowel the rail foot, or enter the true radius and azimuth of each leg in the controller.",
        telling="x",
        shade="y",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit shifts of each leg's centre."""
        return centre_basis(*(axis.expand(view.rows, LEGS, 3) for axis in foot_axes(view)))

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """How far each tower stands off and where to."""
        return upright(super().say(theta, std, view), view)


@dataclass(frozen=True)
class TowerTilt(ThreePttEffect):
    """Rail i leans, pivot at the slider height of home.

    To second order the slider also comes nearer to home, by half the lean squared times its distance, which looks like
    a short lead: 17 um at 16 mrad and 135 mm. The third order, left out, is under 0.1 um there.
    """

    name: ClassVar[str] = "tower-tilt"
    of_drawing: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("radial", "rad", 1e-3, "upper end leans outward", True),
        Parameter("tangential", "rad", 1e-3, "upper end leans along increasing azimuth", True),
    )
    noun: ClassVar[str] = "tower"
    called: ClassVar[str] = "tower tilt"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "radial",
            "lean{s} outward by {what}",
            "lean{s} inward by {what}",
            mend=("shim the head of {who} inward by {what}", "shim the head of {who} outward by {what}"),
        ),
        Phrase(
            "tangential",
            "lean{s} counter-clockwise (seen from above) by {what}",
            "lean{s} clockwise (seen from above) by {what}",
            mend=("shim the head of {who} clockwise by {what}", "shim the head of {who} counter-clockwise by {what}"),
        ),
    )
    card: ClassVar[Card] = Card(
        cause="A rail leans: its foot and head are not one above the other.",
        equation=(
            "dc_i = (q_i - q0_i) (w_i x e_i + w_i x (w_i x e_i)/2), w_i = a_i t_i - b_i n_i, pivot at q0, angles in "
            "rad, e_i along the rail, n_i = t_i x e_i (upright: a_i u_i + b_i t_i - (a_i^2 + b_i^2) e_i/2)"
        ),
        source=f"rotation of the rail to second order; {CLOSURE}",
        size="0.1 to 2 mrad",
        fingerprint="A tower-position error that grows linearly with the slider's height and changes sign at q0.",
        confused_with=(
            ("tracker-frame", "common lean with matching zeros is a turned tracker: base reflectors"),
            ("lead-scale", "not weighted by q_i/w_i: poses wide in x and y"),
            ("column-bend", "follows payload: repeat under another payload"),
        ),
        remedy="Shim the rail against a square or a level; else enter the lean in the machine file (slider_lean_deg).",
        telling="b",
        shade="x",
    )

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """How far each rail leans and which way."""
        return upright(super().say(theta, std, view), view)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Shift of each leg's centre by a unit turn of its rail about home."""
        along, distance = machine(view).rail, (view.q - view.home)[..., None]
        return centre_basis(*(distance * torch.linalg.cross(turn, along) for turn in _unit_turns(view)))

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """Shift of each leg's centre by the turn of its rail, to second order."""
        turn = _turn(theta, view)
        once = torch.linalg.cross(turn, machine(view).rail)
        lean = once + 0.5 * torch.linalg.cross(turn, once)
        return centre_slots((view.q - view.home)[..., None] * lean)

    def slope(self, theta: Tensor, view: View) -> Tensor:
        """Derivative of the second-order shift by both leans."""
        turn, along, distance = _turn(theta, view), machine(view).rail, (view.q - view.home)[..., None]
        leaning = torch.linalg.cross(turn, along)
        columns = []
        for unit in _unit_turns(view):
            once = torch.linalg.cross(unit, along)
            twice = torch.linalg.cross(unit, leaning) + torch.linalg.cross(turn, once)
            columns.append(distance * (once + 0.5 * twice))
        return centre_basis(*columns)


def _unit_turns(view: View) -> tuple[Tensor, Tensor]:
    """Rotations that take the rails' upper ends outward and along increasing azimuth, (leg, xyz) each."""
    outward, tangential = across_axes(view)
    return tangential, -outward


def _turn(theta: Tensor, view: View) -> Tensor:
    """Rotation of each rail, (leg, xyz) rad."""
    outward, along = _unit_turns(view)
    return theta[:LEGS, None] * outward + theta[LEGS:, None] * along


@dataclass(frozen=True)
class GuideStraightness(ThreePttEffect):
    """Slider i wanders sideways along its rail, without the constant and linear parts (tower position and tilt).

    As in the screw's error map, the little level and slope that curves have over the visited heights is held near zero
    where tower position and tilt are in the model, and free where they are not.
    """

    name: ClassVar[str] = "guide-straightness"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "radial", "mm", 0.02, "heights of bow, double bow, ... outward, each in its usual share", True, SHAPES
        ),
        Parameter("tangential", "mm", 0.02, "the same along increasing azimuth", True, SHAPES),
        Parameter(
            "straight",
            "mm",
            0.004,
            "slope and level, radial and tangential, of the curve",
            True,
            4,
            held=True,
            lent=("tower-tilt", "tower-position") * 2,
        ),
        Parameter("from", "mm", 1.0, "lower end of the range", True, role="given"),
        Parameter("to", "mm", 1.0, "upper end of the range", True, role="given"),
    )
    noun: ClassVar[str] = "tower"
    called: ClassVar[str] = "guide straightness"
    card: ClassVar[Card] = Card(
        cause="The rail is bowed or its bolts pull it, so the slider wanders sideways as it travels.",
        equation=(
            "dc_i = n_i f_i(x) + t_i g_i(x), n_i = t_i x e_i (upright: u_i), f and g = sum_j a_j N_j(x) + b (2 x - 1) "
            "+ c with the shapes N_j of screw-error-map, x = (q_i - from_i)/(to_i - from_i) held to 0..1; b and c are "
            "held near zero where tower-position and tower-tilt, which level and slope are, are in the model"
        ),
        source=f"straightness of a linear motion: ISO 230-1; {CLOSURE}",
        size="5 to 30 um",
        fingerprint="Smooth curve in the slider's height, weighted by q_i/w_i, so it turns over across the workspace.",
        confused_with=(
            ("screw-error-map", "not weighted by q_i/w_i: poses wide in x and y, or a linear scale"),
            ("tower-tilt", "a straight line in height: heights over the whole travel, reflector on the slider"),
            ("any smooth rest", "stands in for whatever is missing: add payload and thermal effects first"),
        ),
        remedy="Realign the rail against a straight-edge, bolt in the maker's order; else map it.",
        telling="b",
        shade="x",
    )

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Maximum and minimum of each slider's wander in both directions, and where they are."""
        out = Phrase("radial", "wander{s} up to {what} outward", "wander{s} up to {what} inward")
        along = Phrase(
            "tangential",
            "wander{s} up to {what} counter-clockwise (seen from above)",
            "wander{s} up to {what} clockwise (seen from above)",
        )
        curves = ((out, ("radial",), slice(0, 2)), (along, ("tangential",), slice(2, 4)))
        return upright(curve_extremes(self, theta, std, curves), view)

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """The range that the data cover."""
        return (covered_range(view),)

    def differentiable_shift(self, theta: Tensor, view: View) -> Tensor:
        """Shift with each rail's two curves summed to one height each, before they are spread over the slots."""
        shape = shape_of(self, theta, view.joints)
        place = (view.q - shape["from"]) / (shape["to"] - shape["from"])
        curved, straight = torch.split(theta[: LEGS * (2 * SHAPES + 4)], [2 * LEGS * SHAPES, 4 * LEGS])
        curves, lines = smooth_shapes(place), straight_shapes(place)  # shape: (n, leg, c)
        bent = (curves * curved.view(2, 1, LEGS, SHAPES)).sum(dim=-1)  # shape: (axis, n, leg)
        level = (lines * straight.view(LEGS, 2, 2).transpose(0, 1)[:, None]).sum(dim=-1)
        return centre_slots(torch.einsum("anl,alx->nlx", bent + level, torch.stack(across_axes(view))))

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Bending modes of each rail outward and along the azimuth, then the straight parts of both."""
        place = (view.q - shape["from"]) / (shape["to"] - shape["from"])
        axes = across_axes(view)
        curves = smooth_shapes(place)  # shape: (n, leg, c)
        lines = torch.cat([torch.einsum("nlc,lx->nlxc", straight_shapes(place), axis) for axis in axes], dim=-1)
        return centre_basis(*(torch.einsum("nlc,lx->nlxc", curves, axis) for axis in axes), lines)
