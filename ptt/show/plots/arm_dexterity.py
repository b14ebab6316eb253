"""Dexterity of an arm: condition number and manipulability over its workspace, and its singular joint values."""

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from ptt.mechanisms.dexterity_serial import DexterityMap, dexterity_map, joint_map, singular_families
from ptt.mechanisms.serial import Serial
from ptt.show.plots.common import plain_log

SAMPLES = 200_000  # random joint values from which the map of the workspace is made
CELLS = 60  # of that map along each axis
ROUNDING = 1e-9  # manipulability below which it is zero but for rounding
WORST = 30.0  # condition number at which the colour scale ends


def draw_arm_dexterity(arm: Serial) -> Figure:
    """Draw condition number and manipulability over the workspace, and manipulability over two pairs of joints.

    Args:
        arm: the arm.

    Returns:
        The figure.
    """
    pairs = deciding_pairs(arm)
    rows = 2 if pairs else 1  # an arm of one joint has no pair
    figure = Figure(figsize=(11.0, 1.0 + 4.25 * rows), layout="constrained")
    axes = figure.subplots(rows, 2, squeeze=False)
    space = dexterity_map(arm, samples=SAMPLES, cells=CELLS)
    _draw_space(figure, axes[0, 0], space, space.condition, "least condition number at a place", _norm(space.condition))
    _draw_space(figure, axes[0, 1], space, space.manipulability, "largest manipulability at a place", None)
    for axis, (first, second) in zip(axes[1:].ravel(), pairs, strict=False):
        _draw_joints(figure, axis, joint_map(arm, first, second, cells=181), first, second)
    for axis in axes[1:].ravel()[len(pairs) :]:
        axis.set_axis_off()
    figure.suptitle(
        f"{arm.name}: dexterity of the whole pose, one radian of turn counted as {arm.length_mm:.0f} mm of shift"
    )
    return figure


def deciding_pairs(arm: Serial) -> tuple[tuple[int, int], ...]:
    """Two pairs of joints over which an arm's singular configurations show; of an arm of two joints its only pair.

    Args:
        arm: the arm.

    Returns:
        Numbers from 0: first pairs of joints that are singular only together, then pairs of joints that each are
        singular alone, then any, those without joint 1 first.
    """
    families = list(singular_families(arm, starts=100))
    alone = sorted({joints[0] for joints in families if len(joints) == 1})
    together = [joints for joints in families if len(joints) == 2]
    wanted = [*together[:1], *combinations(alone, 2), *together[1:], *combinations(range(1, arm.joints), 2)]
    wanted += combinations(range(arm.joints), 2)
    distinct = list(dict.fromkeys((min(pair), max(pair)) for pair in wanted))
    return tuple(distinct[:2])


def _norm(condition: np.ndarray) -> LogNorm:
    """Scale of condition numbers, from the least to `WORST`; an arm may be worse than that everywhere."""
    return LogNorm(min(float(np.nanmin(condition)), WORST / 2.0), WORST)


def _draw_space(
    figure: Figure, axis: Axes, space: DexterityMap, values: np.ndarray, title: str, norm: Normalize | None
) -> None:
    shown = np.ma.masked_invalid(
        np.where(values < ROUNDING, 0.0, values) if norm is None else np.minimum(values, WORST)
    )
    colours = "viridis" if norm is None else "viridis_r"
    mesh = axis.pcolormesh(space.across, space.up, shown, cmap=colours, norm=norm, rasterized=True)
    bar = figure.colorbar(mesh, ax=axis, extend="max" if norm is not None else "neither")
    if norm is not None:  # plain figures instead of powers of ten
        plain_log(bar.ax.yaxis, (1.0, 2.0, 3.0, 5.0))
    axis.set(title=title, xlabel="distance from axis 1, mm", ylabel="height, mm", aspect="equal")


def _draw_joints(figure: Figure, axis: Axes, found: DexterityMap, first: int, second: int) -> None:
    across, up = np.degrees(found.across), np.degrees(found.up)
    values, top = found.manipulability, float(np.nanmax(found.manipulability))
    top = top if top > ROUNDING else 0.0  # an arm that is singular everywhere would show rounding, enlarged
    norm = Normalize(0.0, top or 1.0)  # dark is 0: an arm may be singular nowhere
    mesh = axis.pcolormesh(across, up, values, norm=norm, cmap="viridis", shading="nearest", rasterized=True)
    figure.colorbar(mesh, ax=axis)
    if top > 0.0:
        axis.contour(across, up, values, levels=[0.02 * top, 0.1 * top], colors="white", linewidths=0.7)
    axis.set(title="manipulability, dark is singular; others amid their limits", xlabel=f"joint {first + 1}, deg")
    axis.set_ylabel(f"joint {second + 1}, deg")
