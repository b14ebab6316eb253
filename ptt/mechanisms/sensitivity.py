"""Forward kinematics with its exact derivatives by joint values and geometry slots."""

import torch
from torch import Tensor

from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.three_ptt import LEG_SLOTS, LEGS, ThreePtt


def sensitivity(mechanism: Mechanism, q: Tensor, geometry: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Tool position and its exact derivatives by joint values and geometry slots.

    Args:
        mechanism: the machine.
        q: (n, k) mm or rad, joint values.
        geometry: (n, G) or (1, G), shift of each geometry slot.

    Returns:
        p (n, 3) mm, dp/dq (n, 3, k), dp/dgeometry (n, 3, G).
    """
    if isinstance(mechanism, ThreePtt):
        return _three_ptt(mechanism, q, geometry)
    assert isinstance(mechanism, Serial)
    return _serial(mechanism, q, geometry)


def _three_ptt(mechanism: ThreePtt, q: Tensor, geometry: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Differentiated closure |p - c_i| = L_i: s_i . (dp - dc_i) = L_i dL_i, and dc_i = rail_i dq_i for a joint.

    A slot therefore acts as the slider travel dq_i = (s_i . dc_i + L_i dL_i) / (s_i . rail_i).
    """
    p = mechanism.forward(q, geometry)
    by_joint = mechanism.jacobian(q, geometry)
    shift = geometry.expand(len(q), -1)
    legs = shift[:, : LEGS * len(LEG_SLOTS)].unflatten(1, (LEGS, len(LEG_SLOTS)))
    centre = mechanism.foot + q[..., None] * mechanism.rail + legs[..., :3]
    link = (p - shift[:, LEGS * len(LEG_SLOTS) :])[:, None, :] - centre  # shape: (n, leg, xyz)
    along = (link * mechanism.rail).sum(dim=-1, keepdim=True)
    length = (mechanism.link + legs[..., 3])[..., None]
    equivalent = torch.cat([link, length], dim=-1) / along  # slider travel per unit of each slot, (n, leg, 4)
    by_leg = torch.einsum("ncl,lns->ncls", by_joint, equivalent.transpose(0, 1))
    tool = torch.eye(3, dtype=q.dtype).expand(len(q), 3, 3)
    return p, by_joint, torch.cat([by_leg.flatten(2), tool], dim=-1)


def _serial(mechanism: Serial, q: Tensor, geometry: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Twists of the tip by every link parameter; those by theta are the derivatives by the joint values."""
    links = mechanism.walk(q, geometry)
    end = links[-1].end
    tip = end.point(mechanism.tool(q, geometry))
    columns = [column[..., :3] for link in links for column in link.columns(tip)]
    columns += [end.x, end.y, end.z]
    by_slot = torch.stack(torch.broadcast_tensors(*columns), dim=-1)
    return tip, by_slot[..., 3 : 5 * mechanism.joints : 5], by_slot
