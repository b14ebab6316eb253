"""The linear delta of printer firmware: upright towers on one circle, with individual rods and end stops; its fit."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.optimize import least_squares

from ptt.correct.exports.left import WorkspaceSample
from ptt.errors import InputError
from ptt.machine import ThreePttSpec
from ptt.mechanisms import build_mechanism
from ptt.run.viewing import joint_limits

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Delta:
    """Parameters of a firmware's inverse kinematics.

    Attributes:
        radius: horizontal distance between both ends of a rod with the tool at the centre, mm.
        azimuth: of each tower, (3,) deg, anticlockwise from x.
        rod: length of each rod, (3,) mm.
        shift: slider height less height of the rod's upper end, (3,) mm.
        tilt: rise of the bed along x and y that is added to z, (2,) mm per mm.
    """

    radius: float
    azimuth: Array
    rod: Array
    shift: Array
    tilt: Array

    def sliders(self, p: Array) -> Array:
        """Slider heights of a tool position.

        Source: b_i = shift_i + z + tilt . (x, y) + sqrt(rod_i^2 - |(x, y) - tower_i|^2).

        Args:
            p: (n, 3) mm.

        Returns:
            (n, 3) mm, NaN out of reach.
        """
        angle = np.radians(self.azimuth)
        tower = self.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        square = ((p[:, None, :2] - tower) ** 2).sum(axis=-1)
        with np.errstate(invalid="ignore"):
            rise = np.sqrt(self.rod**2 - square)
        return np.asarray(self.shift + rise + (p[:, 2] + p[:, :2] @ self.tilt)[:, None])

    @property
    def stops(self) -> Array:
        """Height of the rods' upper ends above the tool at the centre, (3,) mm."""
        return np.asarray(np.sqrt(self.rod**2 - self.radius**2))


def drawn_delta(spec: ThreePttSpec) -> Delta:
    """The delta of a drawing, leaning rails taken as upright.

    A platform wider than the base is a delta whose towers stand on the other side.

    Args:
        spec: the [machine] section.

    Returns:
        The delta.
    """
    spread = spec.base_radius_mm - spec.platform_radius_mm
    azimuth = np.array(spec.slider_azimuth_deg) + (180.0 if spread < 0.0 else 0.0)
    rod, shift = np.full(3, spec.link_length_mm), np.full(3, spec.joint_height_mm)
    return Delta(abs(spread), azimuth, rod, shift, np.zeros(2))


def fit_delta(sample: WorkspaceSample, *, tilted: bool = False) -> tuple[Delta, Array]:
    """Fit the delta with the least error of the tool over the workspace.

    Least squares of the difference between its commands and the model's, mapped to the tool by the Jacobian. Reversal
    is left out, since no delta has it.

    Args:
        sample: places and the model's commands there.
        tilted: whether the firmware has a tilt of the bed.

    Returns:
        The delta, and the derivative of the tool by each of its parameters, (n, 3, P).
    """
    spec = require_upright(sample)
    start = drawn_delta(spec)
    jacobian = tool_by_slider(sample)
    scale = np.concatenate([[1.0], np.full(3, np.degrees(1.0 / max(start.radius, 1.0))), np.ones(6), np.full(2, 1e-3)])
    free = np.arange(12 if tilted else 10)

    def delta(values: Array) -> Delta:
        whole = np.zeros(12)
        whole[free] = values * scale[free]
        return Delta(
            start.radius + whole[0], start.azimuth + whole[1:4], start.rod + whole[4:7], start.shift + whole[7:10],
            whole[10:],
        )  # fmt: skip

    def miss(values: Array) -> Array:
        lacks = np.nan_to_num(delta(values).sliders(sample.targets) - sample.static, nan=1e3)
        return np.asarray(np.einsum("ncl,nl->nc", jacobian, lacks).ravel())

    found = least_squares(miss, np.zeros(len(free)), method="lm", xtol=1e-14, ftol=1e-14)
    return delta(found.x), found.jac.reshape(len(jacobian), 3, -1)


def tool_by_slider(sample: WorkspaceSample) -> Array:
    """dp/db of the drawing at the places, (n, 3, 3)."""
    mechanism = build_mechanism(sample.compensator.model.file.machine)
    return np.asarray(mechanism.jacobian(torch.as_tensor(sample.nominal)).numpy())


def rounded(delta: Delta, digits: int) -> Delta:
    """The delta as it will be printed."""
    parts = {key: np.round(getattr(delta, key), digits) for key in ("azimuth", "rod", "shift")}
    return replace(delta, radius=round(delta.radius, digits), **parts)


def upper_ends(sample: WorkspaceSample) -> Array:
    """Where the end stops are: the upper ends of the sliders' travel, (3,) mm."""
    return np.asarray(joint_limits(sample.compensator.model.file).numpy()[:, 1])


def require_upright(sample: WorkspaceSample) -> ThreePttSpec:
    """The drawing of the machine; refused where firmware has no such delta.

    Args:
        sample: of the machine.

    Returns:
        The [machine] section.

    Raises:
        InputError: the sliders are below the platform.
    """
    file = sample.compensator.model.file
    spec = file.machine
    assert isinstance(spec, ThreePttSpec)
    if spec.sliders == "below":
        raise InputError(
            "the sliders are below the platform, and this firmware computes towers above it only",
            where=f"{file.source} key sliders",
            fix="take --to c, onnx, siemens or table",
        )
    return spec


def require_anticlockwise(delta: Delta, firmware: str, source: str) -> None:
    """Refuse towers numbered clockwise: the firmware's forward kinematics would then find the solution above them.

    Args:
        delta: fitted.
        firmware: its name.
        source: the machine file.

    Raises:
        InputError: they do.
    """
    x, y = np.cos(np.radians(delta.azimuth)), np.sin(np.radians(delta.azimuth))
    turn = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
    if turn <= 0.0:
        raise InputError(
            f"sliders 1, 2, 3 are numbered clockwise; after homing {firmware} is right only for towers a, b, c numbered"
            " counter-clockwise",
            where=f"{source} key slider_azimuth_deg",
            fix="exchange two sliders in wiring, machine file and run",
        )
