"""URDF: the calibrated arm as a chain of joint origins, refitted.

Source: URDF, joint element: child = parent * origin(xyz, rpy) * Rot(axis, q), rpy about the fixed axes x, y, z, metres
and radians. A screw along z commutes with the joint's own rotation, so origin_i = X_i-1 Z_i(0) for standard and
X_i Z_i(0) for modified Denavit-Hartenberg parameters; the rest after the last joint is the tool.
"""

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from ptt.correct.exports.firmware import judged
from ptt.correct.exports.format import Options, Written
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import cannot_hold, network_note, useless_note
from ptt.correct.exports.left import WorkspaceSample, error_left, holdings, sample_workspace
from ptt.correct.exports.whole import write_all
from ptt.correct.terms import split_terms
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.sensitivity import sensitivity
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.workspace import translation_rank
from ptt.model.chain import predict
from ptt.run.viewing import build_view

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

Array = np.ndarray

SHAPE = "a chain of rigid links has no place for it"
UNKNOWN = "effort and velocity of the joints are not known and written as 0"
ROUNDS = 10  # of Gauss-Newton and of the inverse; both converge within a few
USUAL_MM, USUAL_RAD = 1.0, 1e-3  # sigma of link errors (prior): undetermined ones stay as drawn
HYPHENS = re.compile("-(?=-)")  # XML comments must not contain two in a row
FAINT = 1e-7  # mm, least residual that weights the prior: a chain can represent the model exactly


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write a URDF: links base_link, link_1, ..., tool; joints joint_1, ... turn by the commands of the controller."""
    sample = sample_workspace(compensator, options)
    arm = build_mechanism(compensator.model.file.machine)
    assert isinstance(arm, Serial)
    geometry, tangent = fit_links(sample, arm)
    left = error_left(sample, _inverse(arm, geometry, sample))
    holds, cannot = holdings(sample, cannot_hold(sample, tangent, SHAPE))
    told = [*head_lines(compensator, options), *judged(left, holds, [item.effect for item in cannot])]
    written = write_all({out: _text(arm, origins(arm, geometry), [*told, UNKNOWN])})
    return Written(written, holds, cannot, left, (*useless_note(sample, left, holds), *network_note(sample)))


def fit_links(sample: WorkspaceSample, arm: Serial) -> tuple[Array, Array]:
    """Fit the link parameters for which a rigid chain is closest to the model.

    Least squares of the tool's error with a prior of usual link errors, weighted by the residual of the chain: nearly
    undetermined parameters would otherwise diverge in fitting what no rigid link can represent.

    Args:
        sample: places and commands.
        arm: the drawing.

    Returns:
        Shifts of the arm's geometry slots (G,), mm and rad, and the derivative of the tool by them, (n, 3, G).
    """
    model = sample.compensator.model
    steady = split_terms(model)[0]
    view = build_view(model.file, sample.table.replace(command=sample.static))
    tool = predict(steady, view).p
    scale = torch.tensor([USUAL_MM if "mm" in slot else USUAL_RAD for slot in arm.slots], dtype=torch.float64)
    geometry = torch.zeros(len(scale), dtype=torch.float64)
    for _ in range(ROUNDS):
        place, _, by_slot = sensitivity(arm, view.q, geometry[None])
        miss = tool - place
        faint = max(float(miss.square().mean().sqrt()), FAINT)
        rows = torch.cat(
            [(by_slot * scale).reshape(-1, len(scale)), faint * torch.eye(len(scale), dtype=torch.float64)]
        )
        rest = torch.cat([miss.reshape(-1), -faint * geometry / scale])
        geometry = geometry + scale * torch.linalg.lstsq(rows, rest[:, None], driver="gelsd").solution[:, 0]
    return geometry.numpy(), by_slot.numpy()


def origins(arm: Serial, geometry: Array) -> list[Array]:
    """Origin of each joint in the link before it, and of the tool in the last link.

    Args:
        arm: the drawing.
        geometry: shifts of its slots, (G,).

    Returns:
        k + 1 matrices, (4, 4), mm.
    """
    errors = geometry[:-3].reshape(arm.joints, 5)
    drawn = np.column_stack([arm.a_mm, arm.alpha_rad, arm.d_mm, arm.offset_rad])
    tool = _shift(*(np.array(arm.tool_mm) + geometry[-3:]))
    carried, found = np.eye(4), []
    for (a, alpha, d, theta), beta in zip(drawn + errors[:, :4], errors[:, 4], strict=True):
        across = _shift(a, 0.0, 0.0) @ _turn("x", alpha) @ _turn("y", beta)
        along = _shift(0.0, 0.0, d) @ _turn("z", theta)
        if arm.convention == "standard":
            found.append(carried @ along)
            carried = across
        else:
            found.append(across @ along)
    return [*found, carried @ tool]


def _inverse(arm: Serial, geometry: Array, sample: WorkspaceSample) -> Array:
    """Inverse kinematics of the chain for the targets, by Newton from the nominal posture, (n, k) rad."""
    shift, place = torch.as_tensor(geometry)[None], torch.as_tensor(sample.targets)
    q = torch.as_tensor(sample.nominal)
    for _ in range(ROUNDS):
        q = q + least_move(sensitivity(arm, q, shift)[1], place - arm.forward(q, shift), translation_rank(arm))
    return np.asarray(q.numpy())


def _text(arm: Serial, places: list[Array], told: list[str]) -> str:
    count = arm.joints
    lines = ['<?xml version="1.0"?>', "<!--", *(f"  {HYPHENS.sub('- ', line)}" for line in told), "-->"]
    lines.append(f"<robot name={quoteattr(arm.name)}>")
    links = ["base_link", *(f"link_{joint + 1}" for joint in range(count)), "tool"]
    lines += [f'  <link name="{link}"/>' for link in links]
    for joint, place in enumerate(places):
        name, kind, limit = f"joint_{joint + 1}", "revolute", ""
        if joint == count:
            name, kind = "tool_joint", "fixed"
        elif not np.isfinite(arm.limits_rad[joint]).all():
            kind = "continuous"
        else:
            low, high = arm.limits_rad[joint]
            limit = f'    <limit lower="{low:.12g}" upper="{high:.12g}" effort="0" velocity="0"/>'
        lines += [f'  <joint name="{name}" type="{kind}">', f'    <parent link="{links[joint]}"/>']
        lines += [f'    <child link="{links[joint + 1]}"/>', f"    {_origin(place)}"]
        lines += [] if kind == "fixed" else ['    <axis xyz="0 0 1"/>']
        lines += [limit] if limit else []
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>"]) + "\n"


def _origin(place: Array) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # at a pitch of 90 deg any split between roll and yaw is the same rotation
        angles = Rotation.from_matrix(place[:3, :3]).as_euler("xyz")
    xyz, rpy = (" ".join(f"{value + 0.0:.15g}" for value in values) for values in (1e-3 * place[:3, 3], angles))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def _shift(x: float, y: float, z: float) -> Array:
    place = np.eye(4)
    place[:3, 3] = (x, y, z)
    return place


def _turn(axis: str, angle: float) -> Array:
    place = np.eye(4)
    place[:3, :3] = Rotation.from_euler(axis, angle).as_matrix()
    return place
