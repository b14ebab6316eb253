"""Denavit-Hartenberg chain of a serial arm as screws about z and x: a point mapped to the base, frames and twists."""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

Scalar = Tensor | float


@dataclass(frozen=True)
class Link:
    """Parameters of one link, numbers or tensors (...,).

    Attributes:
        a: length along x, mm.
        alpha: twist about x, rad.
        d: offset along z, mm.
        theta_offset: added to the joint value to give the angle theta about z, rad.
        beta: Hayati rotation about y that follows the twist, rad; None for none.
    """

    a: Scalar
    alpha: Scalar
    d: Scalar
    theta_offset: Scalar
    beta: Tensor | None = None

    def shifted(self, da: Tensor, dalpha: Tensor, dd: Tensor, dtheta: Tensor, dbeta: Tensor) -> "Link":
        """Add errors to the parameters, mm and rad, (...,) each."""
        return Link(self.a + da, self.alpha + dalpha, self.d + dd, self.theta_offset + dtheta, dbeta)


@dataclass(frozen=True)
class Frame:
    """A frame in base coordinates.

    Attributes:
        x: (..., 3) unit vector.
        y: (..., 3) unit vector.
        z: (..., 3) unit vector.
        origin: (..., 3) mm.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    origin: Tensor

    def point(self, local: Tensor) -> Tensor:
        """Express a point (..., 3) given in this frame in base coordinates, (..., 3) mm."""
        return self.origin + local[..., :1] * self.x + local[..., 1:2] * self.y + local[..., 2:] * self.z

    def rotation(self) -> Tensor:
        """Rotation from this frame to the base, (..., 3, 3): its columns are x, y, z."""
        return torch.stack(torch.broadcast_tensors(self.x, self.y, self.z), -1)

    def revolute_twist(self, axis: Literal["x", "y", "z"], tip: Tensor) -> Tensor:
        """Twist (..., 6) of the tip by a rotation about an axis: linear part, mm/rad, above angular part, rad/rad."""
        arm, unit = torch.broadcast_tensors(tip - self.origin, getattr(self, axis))
        return torch.cat([torch.linalg.cross(unit, arm), unit], -1)

    def prismatic_twist(self, axis: Literal["x", "y", "z"]) -> Tensor:
        """Twist (..., 6) of the tip by a translation along an axis: linear part, mm/mm, above angular part, zero."""
        unit = getattr(self, axis)
        return torch.cat([unit, torch.zeros_like(unit)], -1)


@dataclass(frozen=True)
class LinkFrames:
    """The frames before and after each screw of one link, in base coordinates.

    Attributes:
        before_z: before the screw about z (theta, d); its z is the joint axis.
        before_x: before the screw about x (a, alpha, beta); its x is the common normal.
        after_x: after that screw, Hayati rotation included.
        end: the frame that the link carries, in which the next link begins.
    """

    before_z: Frame
    before_x: Frame
    after_x: Frame
    end: Frame

    def columns(self, tip: Tensor) -> tuple[Tensor, ...]:
        """Twists (..., 6) of the tip per unit of this link's a, alpha, d, theta and beta: columns of a Jacobian."""
        return (
            self.before_x.prismatic_twist("x"),
            self.before_x.revolute_twist("x", tip),
            self.before_z.prismatic_twist("z"),
            self.before_z.revolute_twist("z", tip),
            self.after_x.revolute_twist("y", tip),
        )


def carry(point: Tensor, links: tuple[Link, ...], q: Tensor, standard: bool) -> Tensor:
    """Map a point from the last frame to the base, link by link; coordinates alone are rotated, no matrix is built.

    Args:
        point: (..., 3) in the last frame, mm.
        links: the k links.
        q: (..., k) joint values, rad.
        standard: standard convention (z screw first), else modified.

    Returns:
        (..., 3) in the base frame, mm.
    """
    x, y, z = point.unbind(-1)
    for link, value in zip(reversed(links), reversed(q.unbind(-1)), strict=True):
        if standard:
            x, y, z = _carry_x(x, y, z, link)
        x, y = _turn(x, y, value + link.theta_offset)
        z = z + link.d
        if not standard:
            x, y, z = _carry_x(x, y, z, link)
    return torch.stack(torch.broadcast_tensors(x, y, z), -1)


def walk(links: tuple[Link, ...], q: Tensor, standard: bool) -> tuple[LinkFrames, ...]:
    """Frames of every link, from the base to the last.

    Args:
        links: the k links.
        q: (..., k) joint values, rad.
        standard: standard convention (z screw first), else modified.

    Returns:
        k sets of frames, of the first joint first.
    """
    shape = (*q.shape[:-1], 3)
    x, y, z = (axis.expand(shape) for axis in torch.eye(3, dtype=q.dtype, device=q.device))
    frame = Frame(x, y, z, torch.zeros(3, dtype=q.dtype, device=q.device).expand(shape))
    path = []
    for link, value in zip(links, q.unbind(-1), strict=True):
        if standard:
            before_z = frame
            before_x = _screw_z(before_z, value + link.theta_offset, link.d)
            after_x = frame = _screw_x(before_x, link)
        else:
            before_x = frame
            after_x = before_z = _screw_x(before_x, link)
            frame = _screw_z(before_z, value + link.theta_offset, link.d)
        path.append(LinkFrames(before_z, before_x, after_x, frame))
    return tuple(path)


def _carry_x(x: Tensor, y: Tensor, z: Tensor, link: Link) -> tuple[Tensor, Tensor, Tensor]:
    """Coordinates of a point after the link's screw about x, as they are before it."""
    if link.beta is not None:
        z, x = _turn(z, x, link.beta)
    y, z = _turn(y, z, link.alpha)
    return x + link.a, y, z


def _screw_z(frame: Frame, angle: Scalar, d: Scalar) -> Frame:
    x, y = _turn(frame.x, frame.y, _column(angle), axes=True)
    return Frame(x, y, frame.z, frame.origin + _column(d) * frame.z)


def _screw_x(frame: Frame, link: Link) -> Frame:
    y, z = _turn(frame.y, frame.z, _column(link.alpha), axes=True)
    x, origin = frame.x, frame.origin + _column(link.a) * frame.x
    if link.beta is not None:
        z, x = _turn(z, x, _column(link.beta), axes=True)
    return Frame(x, y, z, origin)


def _turn(u: Tensor, v: Tensor, angle: Scalar, axes: bool = False) -> tuple[Tensor, Tensor]:
    """Rotate coordinates (u, v) by an angle; `axes` rotates the axes u and v themselves, which is the transpose."""
    cos, sin = (angle.cos(), angle.sin()) if isinstance(angle, Tensor) else (math.cos(angle), math.sin(angle))
    return (cos * u + sin * v, cos * v - sin * u) if axes else (cos * u - sin * v, sin * u + cos * v)


def _column(value: Scalar) -> Scalar:
    return value[..., None] if isinstance(value, Tensor) else value
