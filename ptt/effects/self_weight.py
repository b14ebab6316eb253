"""The joints of an arm sag under the weight of its own links."""

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

STILL = 0.01  # of a joint's largest lever that has to vary before its sag can be told from an offset
USUAL_SAG = 3e-4  # rad: industrial arms sag by 0.1 to 1 mrad
ASIDE = 0.2  # of what a link holds along its own line, that it usually holds across it: its centre of mass lies near it
ON_AXIS = 1e-3  # mm from its joint's axis within which a link has no line across that axis


@dataclass(frozen=True)
class SelfWeight(Effect):
    """Each joint gives way under the weight of the links behind it: dq_j = c_j g_j(q).

    The torque of gravity about joint j is linear in the mass and the first moments of every link l that it carries:
    g_j = gamma . (z_j x sum over l of m_l r_l). What a link holds along its own joint axis stands still in the link
    before, so it counts there; two moments a link are left, along its common normal x_l and across it, y_l. Their
    shapes, gamma . (z_j x x_l) and gamma . (z_j x y_l), are cosines and sines of the angles alone, free of lengths:
    mass that sits on a later link's far side only changes the moments. Each amplitude is compliance times moment times
    g, an angle; no mass needs to be known, and the amplitudes of a joint with a vertical axis stay where they are.

    Mass lies near the line from a link's joint to what it carries. Where poses vary little the two moments and an
    offset of the joint look alike, and the smaller share that is usual across that line then keeps them apart.
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
        """How far each joint sags at the most over the run, and which way."""
        shift = self.shift(theta, view)
        spread = (self.basis(view, {}).square() @ std.nan_to_num().square()).sqrt()
        phrase = Phrase("along", "sag{s} up to {what} toward +", "sag{s} up to {what} toward -")
        worst = shift.abs().argmax(dim=0).tolist()
        return tuple(
            said(phrase, float(shift[row, joint]), float(spread[row, joint]), "rad", USUAL_SAG, joint + 1)
            for joint, row in enumerate(worst)
        )

    def needs(self, view: View) -> str | None:
        """A joint whose load by its own links changes from pose to pose."""
        along, across = levers(view)
        varied = max(float((lever.amax(dim=0) - lever.amin(dim=0)).max()) for lever in (along, across))
        return None if varied > STILL else "poses that turn the arm against gravity"

    def proportions(self, mechanism: Mechanism) -> Tensor:
        """A moment across the line of its link is usually the smaller one; without a line in the drawing neither is."""
        line = lines(cast(Serial, mechanism)).abs()
        longer = line.amax(dim=-1, keepdim=True)
        share = torch.where(longer > ON_AXIS, line / longer, 1.0).clamp(min=ASIDE)  # shape: (k, 2)
        link = torch.triu_indices(len(line), len(line))[1]
        return share[link].T.reshape(-1)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Lever of gravity on each joint by the moments of each link that it carries."""
        joint, link = torch.triu_indices(view.joints, view.joints)
        mine = torch.nn.functional.one_hot(joint, view.joints).T.to(view.q.dtype)  # shape: (k, pairs)
        return torch.cat([lever[:, None, joint, link] * mine for lever in levers(view)], dim=-1)


def lines(arm: Serial) -> Tensor:
    """Where each link carries what comes behind it: its mean place over full turns of the joints behind.

    Args:
        arm: k joints.

    Returns:
        (k, 2) mm from the joint's axis along the link's common normal and across it; zero where all of it is on the
        axis.
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
    """A point behind a screw about x as it is before it, mm."""
    x, y, z = point
    cos, sin = math.cos(alpha), math.sin(alpha)
    return x + a, cos * y - sin * z, sin * y + cos * z


def levers(view: View) -> tuple[Tensor, Tensor]:
    """Torque of gravity about joint j by a unit moment of link l along and across its common normal.

    Args:
        view: n rows of an arm with k joints.

    Returns:
        (n, k, k) along and (n, k, k) across, without unit; zero where joint j does not carry link l.
    """
    arm = cast(Serial, view.mechanism)
    chain = arm.walk(view.q)
    axis = torch.stack([link.before_z.z.expand(view.rows, 3) for link in chain], dim=1)  # shape: (n, k, 3)
    along = torch.stack([link.end.x.expand(view.rows, 3) for link in chain], dim=1)
    pull = torch.linalg.cross(view.gravity.expand_as(axis), axis)  # gamma . (z x v) = (gamma x z) . v
    behind = torch.ones(view.joints, view.joints, dtype=view.q.dtype).triu()
    across = torch.linalg.cross(axis, along)
    return (pull @ along.mT) * behind, (pull @ across.mT) * behind
