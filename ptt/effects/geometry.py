"""Effects of the geometry: joints, rails and links are not where the drawing has them (3-PTT)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, cast

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.drive import covered_range, renew_curves
from ptt.effects.shapes import SHAPES, smooth_shapes, straight_shapes
from ptt.mechanisms.statics import link_forces
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.view import View

LEGS = 3
SLOTS = 15  # of ThreePtt: centre x, y, z and link length of each leg, then tool x, y, z
UPWARD = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)


def machine(view: View) -> ThreePtt:
    """The 3-PTT that a view is seen through."""
    return cast(ThreePtt, view.mechanism)


def horizontal_axes(view: View) -> tuple[Tensor, Tensor]:
    """Radial and tangential unit vectors of the legs, each (3, 3)."""
    tangential = machine(view).outer_axis
    return torch.linalg.cross(tangential, UPWARD.expand_as(tangential)), tangential


def centre_basis(*columns: Tensor) -> Tensor:
    """Geometry basis of parameters that each move the joint centre of their own leg.

    Args:
        columns: one (n, 3, 3) or (n, 3, 3, c) tensor per parameter: per row and leg, the centre's shift per unit.

    Returns:
        (n, 15, P).
    """
    blocks = []
    for column in columns:
        values = column.unsqueeze(-1) if column.dim() == 3 else column  # shape: (n, leg, xyz, c)
        rows, count = values.shape[0], values.shape[-1]
        block = values.new_zeros(rows, SLOTS, LEGS, count)
        for leg in range(LEGS):
            block[:, 4 * leg : 4 * leg + 3, leg] = values[:, leg]
        blocks.append(block.reshape(rows, SLOTS, LEGS * count))
    return torch.cat(blocks, dim=-1)


def length_basis(*columns: Tensor) -> Tensor:
    """Geometry basis of parameters that each change the link length of their own leg.

    Args:
        columns: one (n, 3) tensor per parameter: per row and leg, the length's change per unit.

    Returns:
        (n, 15, P).
    """
    blocks = []
    for column in columns:
        block = column.new_zeros(column.shape[0], SLOTS, LEGS)
        for leg in range(LEGS):
            block[:, 4 * leg + 3, leg] = column[:, leg]
        blocks.append(block)
    return torch.cat(blocks, dim=-1)


@dataclass(frozen=True)
class ThreePttEffect(Effect):
    """Base of the geometry effects of the 3-PTT."""

    stage: ClassVar[Stage] = "geometry"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt",)


@dataclass(frozen=True)
class TowerPosition(ThreePttEffect):
    """The joint of leg i stands off radially and tangentially; base and platform joint enter alike."""

    name: ClassVar[str] = "tower-position"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("radial", "mm", 0.2, "joint too far out", True),
        Parameter("tangential", "mm", 0.2, "joint shifted along increasing azimuth", True),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit shifts of each leg's centre."""
        return centre_basis(*(axis.expand(view.rows, LEGS, 3) for axis in horizontal_axes(view)))


@dataclass(frozen=True)
class TowerTilt(ThreePttEffect):
    """Rail i leans, pivot at the slider height of home; beyond 2 mrad its cosine is left out (under 0.3 um)."""

    name: ClassVar[str] = "tower-tilt"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("radial", "rad", 1e-3, "upper end leans outward", True),
        Parameter("tangential", "rad", 1e-3, "upper end leans along increasing azimuth", True),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Shift of each leg's centre by its height above home."""
        height = (view.q - view.home)[..., None]
        return centre_basis(*(height * axis for axis in horizontal_axes(view)))


@dataclass(frozen=True)
class LinkLength(ThreePttEffect):
    """Link i is longer than drawn."""

    name: ClassVar[str] = "link-length"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("length", "mm", 0.1, "link too long", True),)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit length of each leg."""
        return length_basis(torch.ones_like(view.q))


@dataclass(frozen=True)
class GuideStraightness(ThreePttEffect):
    """Slider i wanders sideways along its rail, without the parts that tower position and tilt are.

    As with the screw's curve, the little level and slope that the visited heights leave is held near zero.
    """

    name: ClassVar[str] = "guide-straightness"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "radial", "mm", 0.02, "heights of bow, double bow, ... outward, each in its usual share", True, SHAPES
        ),
        Parameter("tangential", "mm", 0.02, "the same along increasing azimuth", True, SHAPES),
        Parameter("straight", "mm", 0.004, "slope and level, radial and tangential, of the curve", True, 4, held=True),
        Parameter("from", "mm", 1.0, "lower end of the range", True, role="given"),
        Parameter("to", "mm", 1.0, "upper end of the range", True, role="given"),
    )

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """The range that the data cover."""
        return (covered_range(view),)

    def renew(self, values: Mapping[str, Tensor], joints: int) -> Mapping[str, Tensor]:
        """Six shapes on nine knots, as files had them, in the present shapes."""
        return renew_curves(values, ("radial", "tangential"), joints)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Spline shapes of each rail, outward and along the azimuth."""
        place = (view.q - shape["from"]) / (shape["to"] - shape["from"])
        axes = horizontal_axes(view)
        curves = smooth_shapes(place)  # shape: (n, leg, c)
        lines = torch.cat([torch.einsum("nlc,lx->nlxc", straight_shapes(place), axis) for axis in axes], dim=-1)
        return centre_basis(*(torch.einsum("nlc,lx->nlxc", curves, axis) for axis in axes), lines)


@dataclass(frozen=True)
class JointOffset(ThreePttEffect):
    """Axes of a universal joint do not meet, so the effective length varies with the link's angle."""

    name: ClassVar[str] = "joint-offset"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("rail", "mm", 0.05, "times the cosine of the link's angle to the rail", True),
        Parameter("tangential", "mm", 0.05, "times the cosine of the link's sideways angle", True),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Cosines of each link's angles."""
        link = machine(view).link_vectors(view.p) / machine(view).link[:, None]
        _, tangential = horizontal_axes(view)
        sideways = (link * tangential).sum(dim=-1)
        along = (link * machine(view).rail).sum(dim=-1).abs()
        return length_basis(along, torch.sqrt(1.0 - sideways.square()))


@dataclass(frozen=True)
class JointClearance(ThreePttEffect):
    """Play in the joints of leg i: the pins rest on the side that the link force pushes to."""

    name: ClassVar[str] = "joint-clearance"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("clearance", "mm", 0.02, "play of the leg from pulled to pushed", True, lower=0.0),
    )

    def needs(self, view: View) -> str | None:
        """A link force that changes its sign in the data."""
        force = pull(view)
        both = ((force > 0).sum(dim=0) >= 3) & ((force < 0).sum(dim=0) >= 3)
        return None if bool(both.any()) else "poses on both sides of where a link force changes sign, and a load"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Half the play, longer when pulled and shorter when pushed."""
        return length_basis(0.5 * torch.sign(pull(view)))


@dataclass(frozen=True)
class LinkCompliance(ThreePttEffect):
    """Link i with its joints gives way along itself under its force: dL_i = c_i N_i, N_i the pull."""

    name: ClassVar[str] = "link-compliance"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("compliance", "mm/N", 5e-5, "stretch of link and joints per unit of pull", True),
    )

    def needs(self, view: View) -> str | None:
        """A link force that is not the same everywhere."""
        force = pull(view)
        varied = bool((force.amax(dim=0) - force.amin(dim=0) > 1e-6).any())
        return None if varied else "platform_mass_kg in the machine file, or a payload (column payload_kg)"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Pull in each link."""
        return length_basis(pull(view))


@dataclass(frozen=True)
class PlatformTwist(ThreePttEffect):
    """Skew joint axes turn the platform a little: (s_i - (s_i.e_i) e_i) . w = -s_i . (e_i x d_i).

    Near the edge of the workspace the turn w is many times the skew d, so terms in w w count beside those in d: the
    shift meets s_i . (e_i x R (e_i + d_i)) = 0 to second order, with the link s_i where the turn has moved it.
    """

    name: ClassVar[str] = "platform-twist"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("radial", "rad", 1e-3, "radial error of the platform joint's axis against the slider's", True),
        Parameter("upward", "rad", 1e-3, "upward error of the platform joint's axis against the slider's", True),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Platform joints and reflector carried by the rotation that unit skews cause."""
        link = machine(view).link_vectors(view.p)  # shape: (n, leg, xyz)
        radial, axis = horizontal_axes(view)
        skews = torch.stack([radial, UPWARD.expand(LEGS, 3)], dim=1)  # shape: (leg, 2, xyz)
        drive = -torch.einsum("nlx,lcx->nlc", link, torch.linalg.cross(axis[:, None].expand_as(skews), skews))
        drive = torch.diag_embed(drive.transpose(1, 2)).permute(0, 2, 1, 3).reshape(-1, 3, 6)
        return _carried(view, torch.linalg.solve(_across(link, axis), drive), radial)

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """The same for skews of any small size, to second order."""
        link = machine(view).link_vectors(view.p)
        radial, axis = horizontal_axes(view)
        skewed = axis + theta[:LEGS, None] * radial + theta[LEGS:, None] * UPWARD
        arm, rows = view.platform_radius * radial, _across(link, axis)
        turn, swung, moved = link.new_zeros(len(link), 3), torch.zeros_like(link), torch.zeros_like(link)
        for _ in range(2):
            crossed = torch.linalg.cross(axis.expand_as(link), skewed + _turned(turn, skewed))
            turn = turn - torch.linalg.solve(rows, ((link + moved) * crossed).sum(dim=-1))
            swung = _turned(turn, arm)
            centre = -torch.linalg.solve(link, (link * swung).sum(dim=-1))  # keeps the links as long as they are
            moved = centre[:, None] + swung
        centres = torch.nn.functional.pad(-swung, (0, 1)).flatten(1)  # the links' lengths stay
        return torch.cat([centres, _turned(turn, view.reflector[None])[:, 0]], dim=1)


def _across(link: Tensor, axis: Tensor) -> Tensor:
    """Part of each link across its joint's axis, (n, leg, xyz)."""
    return link - (link * axis).sum(dim=-1, keepdim=True) * axis


def _turned(turn: Tensor, arms: Tensor) -> Tensor:
    """By how much small turns (n, xyz) move the ends of arms (m, xyz), to second order, (n, m, xyz)."""
    about = turn[:, None].expand(-1, len(arms), -1)
    once = torch.linalg.cross(about, arms.expand_as(about))
    return once + 0.5 * torch.linalg.cross(about, once)


def _carried(view: View, turn: Tensor, radial: Tensor) -> Tensor:
    """Geometry shifts that platform rotations (n, xyz, P) cause: joints B_i by -w x B_i, the reflector by w x r."""
    turns = turn.transpose(1, 2)  # shape: (n, P, xyz)
    basis = turn.new_zeros(view.rows, SLOTS, turns.shape[1])
    for leg in range(LEGS):
        joint = view.platform_radius * radial[leg]
        basis[:, 4 * leg : 4 * leg + 3] = -torch.linalg.cross(turns, joint.expand_as(turns)).transpose(1, 2)
    basis[:, 12:] = torch.linalg.cross(turns, view.reflector.expand_as(turns)).transpose(1, 2)
    return basis


def pull(view: View) -> Tensor:
    """Pull in each link that holds platform and payload.

    Args:
        view: n rows.

    Returns:
        (n, 3) N, positive where the link is pulled; zero without any weight.
    """
    return -link_forces(machine(view), view.p, view.payload, view.platform_mass)
