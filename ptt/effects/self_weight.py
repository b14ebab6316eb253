"""Gravity sag of an arm's joints under the weight of its own links."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, cast

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.phrases import Phrase, ValuePhrase, said
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.serial import Serial
from ptt.run.view import View

STILL = 0.01  # least variation of a lever, whose largest value is 1, that tells sag from a joint offset
USUAL_SAG = 3e-4  # rad: industrial arms sag by 0.1 to 1 mrad
ASIDE = 0.2  # usual moment of a link across its line as a share of that along it: its centre of mass lies near the line
ON_AXIS = 1e-3  # mm: a link whose far end is nearer to its joint axis has no such line


@dataclass(frozen=True)
class SelfWeight(Effect):
    """Each joint yields under the weight of the links behind it: dq_j = c_j g_j(q).

    The gravity torque about joint j is linear in the mass and the first moments of every link l behind it:
    g_j = gamma . (z_j x sum over l of m_l r_l). The first moment of a link along its own joint axis is constant in the
    link before and is counted there (base parameters); two moments for each link are left, along its common normal x_l
    and across it, y_l. Their levers gamma . (z_j x x_l) and gamma . (z_j x y_l) are cosines and sines of the joint
    angles alone, free of lengths. Each amplitude is compliance times moment times g, an angle, so no mass needs to be
    known; those of a joint with a vertical axis are not determined and stay at zero.

    A link's centre of mass lies near the line from its joint to what it carries. Where poses vary little, the two
    moments and an offset of the joint look alike, and the smaller usual size across that line then tells them apart.
    """

    name: ClassVar[str] = "self-weight"
    stage: ClassVar[Stage] = "drive"
    mechanisms: ClassVar[tuple[str, ...]] = ("serial",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "along", "rad", USUAL_SAG, "sag of the joint by moments along each link's common normal", onward=True
        ),
        Parameter("across", "rad", USUAL_SAG, "sag of the joint by moments across it", onward=True, joined=True),
    )
    card: ClassVar[Card] = Card(
        cause="Gears and bearings of the joints yield under the weight of the arm's own links.",
        equation=(
            "dq_j = c_j g_j(q), g_j = gamma . (z_j x sum over the links l behind of (X_l x_l + Y_l y_l)): gamma the "
            "direction of gravity, z_j the joint's axis, x_l the link's common normal, y_l across it, X_l and Y_l the "
            "link's base moments times g"
        ),
        source=(
            "joint compliance under gravity: Tenhumberg and Baeuml, IEEE-RAS Humanoids 2021; base parameters of "
            "gravity: Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, ch. 9"
        ),
        size="0.1 to 1 mrad on industrial arms, 10 mrad on light ones",
        fingerprint="J e of a joint follows the lever of what hangs on it: large with the arm stretched out level.",
        confused_with=(
            (
                "dh-offsets",
                "an offset moves with the joint alone, sag with the pose against gravity: poses that vary both",
            ),
            ("axis-compliance", "is the same where the drawing states all masses; a payload moves only that one"),
            ("joint-error-map", "follows one joint's angle, whatever the others do: poses that vary all joints"),
        ),
        remedy="Command corrected joints, or stiffen and counterbalance the joint.",
        needs="poses that turn the arm against gravity",
        telling="b",
        shade="z",
    )
    called: ClassVar[str] = "self-weight"

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Largest sag of each joint over the run, and its direction."""
        shift = self.shift(theta, view)
        spread = (self.basis(view, {}).square() @ std.nan_to_num().square()).sqrt()
        phrase = Phrase("along", "sag{s} up to {what} toward +q", "sag{s} up to {what} toward -q")
        worst = shift.abs().argmax(dim=0).tolist()
        return tuple(
            said(phrase, float(shift[row, joint]), float(spread[row, joint]), "rad", USUAL_SAG, joint + 1)
            for joint, row in enumerate(worst)
        )

    def needs(self, view: View) -> str | None:
        """A joint whose lever of gravity varies from pose to pose."""
        along, across = levers(view)
        varied = max(float((lever.amax(dim=0) - lever.amin(dim=0)).max()) for lever in (along, across))
        return None if varied > STILL else "poses that turn the arm against gravity"

    def proportions(self, mechanism: Mechanism) -> Tensor:
        """Moments across a link's line are usually smaller; both are alike where the drawing has no such line."""
        line = link_lines(cast(Serial, mechanism)).abs()
        longer = line.amax(dim=-1, keepdim=True)
        share = torch.where(longer > ON_AXIS, line / longer, 1.0).clamp(min=ASIDE)  # shape: (k, 2)
        link = torch.triu_indices(len(line), len(line))[1]
        return share[link].T.reshape(-1)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Lever of gravity on each joint by either moment of each link behind it, (n, k, P)."""
        joint, link = torch.triu_indices(view.joints, view.joints)
        mine = torch.nn.functional.one_hot(joint, view.joints).T.to(view.q.dtype)  # shape: (k, pairs)
        return torch.cat([lever[:, None, joint, link] * mine for lever in levers(view)], dim=-1)


def link_lines(arm: Serial) -> Tensor:
    """Direction of each link's line: from its joint to what it carries, averaged over full turns of the joints behind.

    Args:
        arm: k joints.

    Returns:
        (k, 2) mm from the joint axis, along the link's common normal and across it; zero where it lies on the axis.
    """
    carried, found = arm.tool_mm, list[tuple[float, float]]()
    standard = arm.convention == "standard"
    for a, alpha, d in zip(reversed(arm.a_mm), reversed(arm.alpha_rad), reversed(arm.d_mm), strict=True):
        x, y, z = _through_x(carried, a, alpha) if standard else carried
        found.append((x, y))
        carried = (0.0, 0.0, z + d)
        carried = carried if standard else _through_x(carried, a, alpha)
    return torch.tensor(found[::-1], dtype=torch.float64)


def _through_x(point: tuple[float, float, float], a: float, alpha: float) -> tuple[float, float, float]:
    """Coordinates of a point after a screw about x as they are before it, mm."""
    x, y, z = point
    cos, sin = math.cos(alpha), math.sin(alpha)
    return x + a, cos * y - sin * z, sin * y + cos * z


def levers(view: View) -> tuple[Tensor, Tensor]:
    """Torque of gravity about joint j by a unit moment of link l along and across its common normal.

    Args:
        view: n rows of an arm with k joints.

    Returns:
        (n, k, k) along and (n, k, k) across, joint j by link l, dimensionless; zero where l is not behind j.
    """
    arm = cast(Serial, view.mechanism)
    chain = arm.walk(view.q)
    axis = torch.stack([link.before_z.z.expand(view.rows, 3) for link in chain], dim=1)  # shape: (n, k, 3)
    along = torch.stack([link.end.x.expand(view.rows, 3) for link in chain], dim=1)
    pull = torch.linalg.cross(view.gravity.expand_as(axis), axis)  # gamma . (z x v) = (gamma x z) . v
    behind = torch.ones(view.joints, view.joints, dtype=view.q.dtype).triu()
    across = torch.linalg.cross(axis, along)
    return (pull @ along.mT) * behind, (pull @ across.mT) * behind
