"""Static forces in links and joints under the weight of payload, platform and arm links."""

import torch
from torch import Tensor

from ptt.machine import SerialSpec, ThreePttSpec
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.three_ptt import ThreePtt

GRAVITY = 9.80665
"""Standard gravity in N/kg."""


def gravity_of(spec: ThreePttSpec | SerialSpec) -> Tensor:
    """Direction of gravity, (3,) unit vector in the base frame: (0, 0, -1) on a 3-PTT."""
    direction = spec.gravity if isinstance(spec, SerialSpec) else (0.0, 0.0, -1.0)
    return torch.nn.functional.normalize(torch.tensor(direction, dtype=torch.float64), dim=0)


def weight(
    payload_kg: Tensor | float, platform_mass_kg: Tensor | float = 0.0, direction: Tensor | None = None
) -> Tensor:
    """Weight of payload and platform, acting at the tool.

    Args:
        payload_kg: (n,) or one number, kg.
        platform_mass_kg: (n,) or one number, kg.
        direction: (3,) unit vector in the base frame; None for downward, (0, 0, -1).

    Returns:
        F = m g direction: (n, 3) or (3,) N.
    """
    mass = torch.as_tensor(payload_kg, dtype=torch.float64) + platform_mass_kg
    down = torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64) if direction is None else direction
    return mass.unsqueeze(-1) * GRAVITY * down


def link_forces(
    mechanism: ThreePtt, p: Tensor, payload_kg: Tensor | float, platform_mass_kg: Tensor | float = 0.0
) -> Tensor:
    """Axial forces in the links of a 3-PTT under payload and platform; the links' own weight is left out.

    Source: force balance of the platform, sum of f_i s_i / |s_i| + F = 0, solved by Cramer's rule.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.
        payload_kg: (n,) or one number, kg.
        platform_mass_kg: (n,) or one number, kg.

    Returns:
        f: (n, 3) N, compression positive (a platform that hangs from its links pulls: negative); NaN out of reach.
    """
    unit = torch.nn.functional.normalize(mechanism.link_vectors(p), dim=-1)
    minor = torch.linalg.cross(unit.roll(-1, -2), unit.roll(-2, -2), dim=-1)
    volume = (unit[..., 0, :] * minor[..., 0, :]).sum(-1, keepdim=True)
    load = weight(payload_kg, platform_mass_kg).unsqueeze(-2)
    return -(minor * load).sum(-1) / volume


def link_torques(mechanism: Mechanism, spec: ThreePttSpec | SerialSpec, q: Tensor) -> Tensor | None:
    """Torques of the weight of an arm's own links about its joints, positive toward growing joint values.

    Source: virtual work, tau = sum over links of (dc_i/dq)^T m_i g, c_i the link's centre of mass.

    Args:
        mechanism: the machine.
        spec: its drawing; masses in kg, centres of mass in mm in the frame that the link carries.
        q: (n, k) rad, joint values.

    Returns:
        tau: (n, k) N mm; None where the drawing states no mass, as for a 3-PTT.
    """
    if not isinstance(mechanism, Serial) or not isinstance(spec, SerialSpec):
        return None
    links = [(index, joint) for index, joint in enumerate(spec.joint) if joint.mass_kg]
    if not links:
        return None
    frames, down = mechanism.walk(q), gravity_of(spec)
    torque = torch.zeros_like(q)
    for index, joint in links:
        centre = frames[index].end.point(torch.tensor(joint.com_mm or (0.0, 0.0, 0.0), dtype=q.dtype))
        force = weight(float(joint.mass_kg or 0.0), direction=down).to(q)
        for moved in range(index + 1):
            by_joint = frames[moved].before_z.revolute_twist("z", centre)[..., :3]
            torque[:, moved] += (by_joint * force).sum(dim=-1)
    return torque


def load_levers(arm: Serial, q: Tensor, down: Tensor) -> Tensor:
    """By how much a load's centre beside the tool point turns each joint more.

    Source: about the tool point a weight w that hangs at e_i in the tool's frame has the torque (R e_i) x w.

    Args:
        arm: the mechanism.
        q: (n, k) rad, joint values.
        down: (3,) unit vector in which weights pull.

    Returns:
        (n, k, 3): torque about joint j for each unit of weight and of offset along an axis of the tool.
    """
    axes, turn = arm.pose_jacobian(q)[:, 3:], arm.pose(q)[1]
    pulls = torch.linalg.cross(turn, down.to(turn)[None, :, None].expand_as(turn), dim=1)
    return torch.einsum("ncj,nci->nji", axes, pulls)
