"""Effects of serial arms: links and joint axes are not where the drawing has them, joints turn unevenly or sag."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, cast

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage, per_joint
from ptt.effects.phrases import Phrase, Said, said
from ptt.mechanisms.serial import LINK_SLOTS, Serial
from ptt.run.view import View

BETA = 4  # place of the Hayati angle among a link's slots
ROWS_A_JOINT = 100  # rows, for each joint, that a map of it takes at the least
STILL = 0.01  # of a joint's largest lever that has to vary before its sag can be told from an offset
PLACES = 721  # of a joint's range at which its curve is looked at for its highest: half a degree of a turn
USUAL_SAG = 3e-4  # rad: industrial arms sag by 0.1 to 1 mrad
SLOW, FAST = 32, 32  # harmonics of a turn: those of usual size, and smaller ones above them


@dataclass(frozen=True)
class DhOffsets(Effect):
    """Denavit-Hartenberg parameters are off, link by link; axes that the drawing has parallel lean by beta too.

    Every link has all five parameters. What they do twice (the offset along parallel axes, the first and last link
    against a fitted frame and tool) the fit leaves where it is; beta acts between parallel axes only, because
    elsewhere twist and joint angle of the neighbours do the same.
    """

    name: ClassVar[str] = "dh-offsets"
    stage: ClassVar[Stage] = "geometry"
    mechanisms: ClassVar[tuple[str, ...]] = ("serial",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("da", "mm", 0.5, "link too long along its common normal", True),
        Parameter("dalpha", "rad", 1e-3, "twist between the joint axes too large", True),
        Parameter("dd", "mm", 0.5, "offset along the joint axis too large", True),
        Parameter("dtheta", "rad", 2e-3, "joint angle larger than the encoder says", True),
        Parameter("dbeta", "rad", 1e-3, "lean of parallel joint axes across their common normal (Hayati)", True),
    )
    arm_noun: ClassVar[str] = "link"
    called: ClassVar[str] = "link geometry"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("da", "{is_} {what} too long", "{is_} {what} too short"),
        Phrase("dalpha", "{is_} twisted {what} too far", "{is_} twisted {what} too little"),
        Phrase("dd", "{has} {what} too much offset along its axis", "{has} {what} too little offset along its axis"),
        Phrase(
            "dtheta", "stand{s} {what} further toward + than q says", "stand{s} {what} further toward - than q says"
        ),
        Phrase("dbeta", "lean{s} {what} toward + about y", "lean{s} {what} toward - about y"),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit of each link's slots, parameter by parameter."""
        arm, width = cast(Serial, view.mechanism), len(LINK_SLOTS)
        slots, joints = len(arm.slots), view.joints
        units = torch.eye(slots, width * joints, dtype=view.q.dtype).unflatten(1, (joints, width)).clone()
        parallel = torch.tensor(arm.parallel_axes())
        units[:, :, BETA] *= parallel
        return units.transpose(1, 2).flatten(1).expand(view.rows, slots, width * joints)


@dataclass(frozen=True)
class JointErrorMap(Effect):
    """Each joint turns unevenly, alike at every turn: sum over m of a_m cos(m q) + b_m sin(m q).

    Encoder rings, their eccentricity and strain-wave gears all repeat with the turn of the joint. There are many
    harmonics, so each is held near zero at its usual size; what the visited range does not tell stays there.
    """

    name: ClassVar[str] = "joint-error-map"
    stage: ClassVar[Stage] = "drive"
    mechanisms: ClassVar[tuple[str, ...]] = ("serial",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("cosine", "rad", 1e-4, "part in phase with zero, harmonics from the first", True, SLOW, held=True),
        Parameter("sine", "rad", 1e-4, "part a quarter turn later, harmonics from the first", True, SLOW, held=True),
        Parameter("fast_cosine", "rad", 2e-5, "the same of the harmonics above those", True, FAST, held=True),
        Parameter("fast_sine", "rad", 2e-5, "the same of the harmonics above those", True, FAST, held=True),
    )
    called: ClassVar[str] = "encoder or gear"

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[Said, ...]:
        """How far each joint runs ahead and behind at the most where it went, and where."""
        low, high = view.q.amin(dim=0), view.q.amax(dim=0)
        places = low + torch.linspace(0.0, 1.0, PLACES, dtype=theta.dtype)[:, None] * (high - low)
        return farthest(self, self.shift(theta, view.at(q=places)), places)

    def needs(self, view: View) -> str | None:
        """More coordinates than harmonics."""
        least = ROWS_A_JOINT * view.joints
        return None if view.rows >= least else f"at least {least} rows"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Cosines and sines of the multiples of each joint's angle."""
        order = torch.arange(1, SLOW + FAST + 1, dtype=view.q.dtype)
        phase = view.q[..., None] * order  # shape: (n, k, m)
        cosine, sine = torch.cos(phase), torch.sin(phase)
        return per_joint(cosine[..., :SLOW], sine[..., :SLOW], cosine[..., SLOW:], sine[..., SLOW:])


@dataclass(frozen=True)
class SelfWeight(Effect):
    """Each joint gives way under the weight of the links behind it: dq_j = c_j g_j(q).

    The torque of gravity about joint j is linear in the mass and the first moments of every link l that it carries:
    g_j = gamma . (z_j x sum over l of m_l r_l). What a link holds along its own joint axis stands still in the link
    before, so it counts there; two moments a link are left, along its common normal x_l and across it, y_l. Their
    shapes, gamma . (z_j x x_l) and gamma . (z_j x y_l), are cosines and sines of the angles alone, free of lengths:
    mass that sits on a later link's far side only changes the moments. Each amplitude is compliance times moment times
    g, an angle; no mass needs to be known, and the amplitudes of a joint with a vertical axis stay where they are.
    """

    name: ClassVar[str] = "self-weight"
    stage: ClassVar[Stage] = "drive"
    mechanisms: ClassVar[tuple[str, ...]] = ("serial",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "along", "rad", USUAL_SAG, "sag of the joint by moments along each link's common normal", onward=True
        ),
        Parameter("across", "rad", USUAL_SAG, "sag of the joint by moments across it", onward=True),
    )
    called: ClassVar[str] = "self-weight"

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[Said, ...]:
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

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Lever of gravity on each joint by the moments of each link that it carries."""
        joint, link = torch.triu_indices(view.joints, view.joints)
        mine = torch.nn.functional.one_hot(joint, view.joints).T.to(view.q.dtype)  # shape: (k, pairs)
        return torch.cat([lever[:, None, joint, link] * mine for lever in levers(view)], dim=-1)


def farthest(effect: Effect, shift: Tensor, places: Tensor) -> tuple[Said, ...]:
    """Where each joint is farthest ahead and farthest behind.

    Args:
        effect: for the usual size.
        shift: (n, k) rad.
        places: joint values, (n, k) rad.

    Returns:
        One for each side of each joint.
    """
    parts = []
    for joint in range(shift.shape[1]):
        for row, right in ((int(shift[:, joint].argmax()), 1.0), (int(shift[:, joint].argmin()), -1.0)):
            if right * float(shift[row, joint]) > 0.0:
                where = f"at q = {float(torch.rad2deg(places[row, joint])):.0f} deg"
                ahead, behind = (f"run{{s}} up to {{what}} {side} {where}" for side in ("ahead", "behind"))
                value, usual = float(shift[row, joint]), effect.parameters[0].usual
                parts.append(said(Phrase("", ahead, behind), value, float("nan"), "rad", usual, joint + 1))
    return tuple(parts)


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
