"""An effect on the sample machine: its error over the workspace, and its signature against the telling variable."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.effects import Effect
from ptt.effects.bench import sample_machine, sample_view
from ptt.effects.card import Card
from ptt.effects.case import usual_theta
from ptt.effects.layout import family
from ptt.model.chain import predict
from ptt.run.table import make_table
from ptt.run.view import View
from ptt.run.viewing import build_view
from ptt.show.telling import telling_of

GRID = 121  # points of the field along each axis
LEAST_WAY = 1e-12  # square of a way of the tool per turn, mm per rad, below which a joint does not move it
REACH = {"three-ptt": 90.0, "serial": 700.0}  # mm, half width of the field
SPEED = {"three-ptt": 20.0, "serial": 0.05}  # mm/s or rad/s of every joint in the field, for effects of speed
WARM, LOAD = 5.0, 2.0  # K above reference and kg in the field, for effects of temperature and payload
UM = 1e3  # um per mm


@dataclass(frozen=True)
class Field:
    """Error of an effect over a horizontal plane of the workspace.

    Attributes:
        x: (m,) mm.
        y: (m,) mm.
        z: height of the plane, mm.
        error: (m, m, 3) mm, rows along y; NaN out of reach or beyond the ends of travel.
    """

    x: np.ndarray
    y: np.ndarray
    z: float
    error: np.ndarray


@dataclass(frozen=True)
class Signature:
    """Residual of an effect along a sample run, against its telling variable.

    Attributes:
        telling: (n,) values of the telling variable.
        residual: (n,) um, or urad of a serial arm's joint.
        shade: (n,) values of a second variable, which colours the points; None where the card names none.
        labels: of telling variable, residual and second variable, with units; '' where there is none.
    """

    telling: np.ndarray
    residual: np.ndarray
    shade: np.ndarray | None
    labels: tuple[str, str, str]


def picture_theta(effect: Effect, kind: str) -> Tensor:
    """Parameters of usual size for pictures; of a curve the amplitudes decrease with the order of its basis functions.

    Args:
        effect: the effect.
        kind: mechanism family.

    Returns:
        All parameters, flat.
    """
    view = sample_view(kind, effect.least_joints)
    return usual_theta(effect, kind, view, effect.usual_trial(view)) * _smoothly(effect, view.joints)


def effect_field(effect: Effect, theta: Tensor, kind: str) -> Field:
    """Error over the plane z = 0 (an arm: through its middle pose) with load, warmth and speed on.

    Args:
        effect: the effect.
        theta: all its parameters, flat.
        kind: mechanism family.

    Returns:
        The field.
    """
    sample = sample_view(kind, effect.least_joints)
    centre = np.zeros(3) if kind == "three-ptt" else sample.p.mean(dim=0).numpy()
    across = np.linspace(-REACH[kind], REACH[kind], GRID)
    x, y = centre[0] + across, centre[1] + across
    points = np.stack([*np.meshgrid(x, y), np.full((GRID, GRID), centre[2])], axis=-1).reshape(-1, 3)
    joints = sample.mechanism.inverse(torch.as_tensor(points))
    low, high = sample.travel_limits.T
    inside = (torch.isfinite(joints) & (joints >= low) & (joints <= high)).all(dim=1)
    view = _steady(sample, joints[inside], kind)
    error = np.full((GRID * GRID, 3), np.nan)
    error[inside.numpy()] = (predict([(effect, theta)], view).reading - view.p).numpy()
    return Field(x, y, float(centre[2]), error.reshape(GRID, GRID, 3))


def effect_signature(effect: Effect, theta: Tensor, view: View, card: Card) -> Signature:
    """Residual that an effect causes on the sample run, against the card's telling variable.

    Args:
        effect: the effect.
        theta: all its parameters, flat.
        view: the sample run.
        card: names the component of the residual, the telling variable and the second one.

    Returns:
        The points to draw; of joints, those of one.
    """
    error = predict([(effect, theta)], view).reading - view.p
    joint, follows = effect.shown
    if card.residual == "joint":
        linear = family(view) == "three-ptt"
        residual = _of_joint(error, view.jacobian, joint) * (UM if linear else 1e6)
        unit, name = ("um", f"J e of slider {joint + 1}") if linear else ("urad", f"J e of joint {joint + 1}")
    else:
        residual, unit = error[:, "xyz".index(card.residual)] * UM, "um"
        name = f"residual in {card.residual}"
    telling, across = telling_of(card.telling, view, follows)
    shade, third = telling_of(card.shade, view, follows) if card.shade else (None, "")
    return Signature(telling, residual.numpy(), shade, (across, f"{name} [{unit}]", third))


def _of_joint(error: Tensor, jacobian: Tensor, joint: int) -> Tensor:
    """Error of a joint that makes a tool error, (n,): together with all others or, of more than three joints, alone."""
    if jacobian.shape[2] <= jacobian.shape[1]:
        return (torch.linalg.pinv(jacobian) @ error[..., None])[:, joint, 0]
    way = jacobian[:, :, joint]
    return (way * error).sum(dim=1) / way.square().sum(dim=1).clamp(min=LEAST_WAY)


def _steady(sample: View, joints: Tensor, kind: str) -> View:
    """Independent poses, each approached upward, under load, warm, moving, and at the time of the sample run's end."""
    file = sample_machine(kind, sample.joints)
    table = make_table(None, joints.numpy(), payload_kg=LOAD, temp_c=file.machine.reference_temp_c + WARM)
    view = build_view(file, table)
    whole = torch.ones_like(view.q)
    return replace(
        view,
        direction=whole,
        turning_point=view.q,
        starts=torch.ones(view.rows, dtype=torch.bool),
        velocity=SPEED[kind] * whole,
        time=sample.time.max().expand(view.rows),
        varies=sample.varies,
    )


def _smoothly(effect: Effect, joints: int) -> Tensor:
    """Weights on parameters: 1 / order^2 on amplitudes of a curve so that it is smooth, zero on held ones, else one."""
    parts = []
    for parameter in effect.parameters:
        place = torch.arange(parameter.size(joints), dtype=torch.float64) % parameter.count
        curve = parameter.role == "linear" and parameter.per_joint and parameter.count > 1
        weight = 1.0 / (1.0 + place) ** 2 if curve else torch.ones_like(place)
        parts.append(torch.zeros_like(place) if parameter.held else weight)
    return torch.cat(parts)
