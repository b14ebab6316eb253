"""Parasitic rotation of the platform (3-PTT)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Parameter
from ptt.effects.card import Card
from ptt.effects.geometry import (
    UPWARD,
    ThreePttEffect,
    horizontal_axes,
    machine,
)
from ptt.effects.phrases import Phrase
from ptt.mechanisms.three_ptt import LEGS, SLOTS
from ptt.run.view import View


@dataclass(frozen=True)
class PlatformTwist(ThreePttEffect):
    """Skew joint axes turn the platform a little: (s_i - (s_i.e_i) e_i) . w = -s_i . (e_i x d_i).

    Near the edge of the workspace the turn w is many times the skew d, so terms in w w count beside those in d: the
    shift meets s_i . (e_i x R (e_i + d_i)) = 0 to second order, with the link s_i where the turn has moved it.
    """

    name: ClassVar[str] = "platform-twist"
    of_drawing: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("radial", "rad", 1e-3, "radial error of the platform joint's axis against the slider's", True),
        Parameter("upward", "rad", 1e-3, "upward error of the platform joint's axis against the slider's", True),
    )
    noun: ClassVar[str] = "leg"
    called: ClassVar[str] = "skew joint axes, which turn the platform"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "radial",
            "{has} the platform's joint axis {what} outward of the slider's",
            "{has} the platform's joint axis {what} inward of the slider's",
        ),
        Phrase(
            "upward",
            "{has} the platform's joint axis {what} upward of the slider's",
            "{has} the platform's joint axis {what} downward of the slider's",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="The joint axes on slider and platform are not parallel, so the platform turns a little as it moves.",
        equation=(
            "(s_i - (s_i . e_i) e_i) . w = -s_i . (e_i x d_i), e_i the slider's joint axis, d_i = a_i u_i + b_i z the "
            "platform's less it; platform joints B_i: dc_i = -w x B_i; reflector: dp = w x reflector_mm"
        ),
        source="first order of s_i . (e_i x R e'_i) = 0, universal joints with parallel middle axes",
        size="0.1 to 2 mrad",
        fingerprint="A smooth field that grows with the reflector's distance from the platform's centre.",
        confused_with=(
            ("reflector_mm", "a wrong offset is constant in the base frame: a second run with the reflector elsewhere"),
            ("tower-position", "does not grow with the reflector's offset: repeat with the reflector elsewhere"),
        ),
        remedy="Ream or shim the joint seats parallel; put the reflector and the tool at the platform's centre.",
        telling="y",
        residual="x",
        shade="x",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Geometry shifts of the platform rotation that a unit of each skew causes."""
        link = machine(view).link_vectors(view.p)  # shape: (n, leg, xyz)
        radial, axis = horizontal_axes(view)
        skews = torch.stack([radial, UPWARD.expand(LEGS, 3)], dim=1)  # shape: (leg, 2, xyz)
        right = -torch.einsum("nlx,lcx->nlc", link, torch.linalg.cross(axis[:, None].expand_as(skews), skews))
        right = torch.diag_embed(right.transpose(1, 2)).permute(0, 2, 1, 3).reshape(-1, 3, 6)  # shape: (n, leg, P)
        return _carried(view, torch.linalg.solve(_across(link, axis), right), radial)

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """Geometry shifts of the platform rotation to second order in the skews, by two Newton steps."""
        link = machine(view).link_vectors(view.p)
        radial, axis = horizontal_axes(view)
        skewed = axis + theta[:LEGS, None] * radial + theta[LEGS:, None] * UPWARD
        arm, rows = view.platform_radius * radial, _across(link, axis)
        turn, swung, moved = link.new_zeros(len(link), 3), torch.zeros_like(link), torch.zeros_like(link)
        for _ in range(2):
            crossed = torch.linalg.cross(axis.expand_as(link), skewed + _rotated_by(turn, skewed))
            turn = turn - torch.linalg.solve(rows, ((link + moved) * crossed).sum(dim=-1))
            swung = _rotated_by(turn, arm)
            centre = -torch.linalg.solve(link, (link * swung).sum(dim=-1))  # keeps the links as long as they are
            moved = centre[:, None] + swung
        centres = torch.nn.functional.pad(-swung, (0, 1)).flatten(1)  # the links' lengths stay
        return torch.cat([centres, _rotated_by(turn, view.reflector[None])[:, 0]], dim=1)


def _across(link: Tensor, axis: Tensor) -> Tensor:
    """Part of each link vector perpendicular to its joint axis, (n, leg, xyz)."""
    return link - (link * axis).sum(dim=-1, keepdim=True) * axis


def _rotated_by(turn: Tensor, arms: Tensor) -> Tensor:
    """Displacement of the ends of arms (m, xyz) by small rotations (n, xyz), to second order, (n, m, xyz)."""
    about = turn[:, None].expand(-1, len(arms), -1)
    once = torch.linalg.cross(about, arms.expand_as(about))
    return once + 0.5 * torch.linalg.cross(about, once)


def _carried(view: View, turn: Tensor, radial: Tensor) -> Tensor:
    """Geometry shifts that platform rotations (n, xyz, P) cause: joints B_i by -w x B_i, the reflector by w x r."""
    turns = turn.transpose(1, 2)  # shape: (n, P, xyz)
    basis = turn.new_zeros(view.rows, len(SLOTS), turns.shape[1])
    for leg in range(LEGS):
        joint = view.platform_radius * radial[leg]
        basis[:, 4 * leg : 4 * leg + 3] = -torch.linalg.cross(turns, joint.expand_as(turns)).transpose(1, 2)
    basis[:, 12:] = torch.linalg.cross(turns, view.reflector.expand_as(turns)).transpose(1, 2)
    return basis
