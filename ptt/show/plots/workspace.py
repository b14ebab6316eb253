"""Picture of a machine's dexterity; of a 3-PTT the condition number of the Jacobian over x and y at three heights."""

import math

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

from ptt.machine import MachineSpec, ThreePttSpec
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.mechanisms.workspace import WorkspaceMap, heights_in_the_middle, workspace_map
from ptt.show.plots.arm_dexterity import draw_arm_dexterity

GRID = 241
DPI = 150
TICKS = (1, 1.2, 1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5, 6, 7, 8, 10, 12, 15, 20, 30, 50, 100)
FEW_TICKS, WIDE = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000), 15.0  # where the scale's ends are further apart, times
BEYOND = 1e9  # condition number above the end of any scale
COLOUR_MAP = "viridis_r"  # bright is good, as on the maps of arms
LIMIT_COLOUR = "#d1495b"


def draw_dexterity(spec: MachineSpec) -> Figure:
    """Draw a machine's dexterity: an arm's by `draw_arm_dexterity`.

    Args:
        spec: the machine.

    Returns:
        The figure; of a 3-PTT the condition number over x and y at three heights, with the ends of travel.
    """
    mechanism = build_mechanism(spec)
    if isinstance(mechanism, Serial):
        return draw_arm_dexterity(mechanism)
    assert isinstance(spec, ThreePttSpec) and isinstance(mechanism, ThreePtt)
    heights = torch.tensor(_heights(mechanism), dtype=torch.float64)
    reach = spec.link_length_mm + abs(spec.base_radius_mm - spec.platform_radius_mm)  # upper bound of |x| and |y|
    extent = _tighten(workspace_map(mechanism, *_axes(reach), heights), reach)
    result = workspace_map(mechanism, *_axes(extent), heights)
    return _draw(result, f"{spec.name}: dexterity over the workspace")


def _heights(mechanism: ThreePtt) -> list[float]:
    """Three round heights in mm: a sixth, a half and five sixths of what the travel reaches at x = y = 0."""
    low, high = heights_in_the_middle(mechanism)
    digits = 2 - math.floor(math.log10(max(high - low, 1e-3)))
    return [round(low + share * (high - low), digits) for share in (1 / 6, 1 / 2, 5 / 6)]


def _tighten(result: WorkspaceMap, extent: float) -> float:
    """Half width in mm of what can be reached, with a margin."""
    reached = (~torch.isnan(result.condition)).any(0)
    if not bool(reached.any()):
        return extent
    across = result.x[reached.any(0)].abs().max(), result.y[reached.any(1)].abs().max()
    return 1.06 * float(max(across))


def _axes(extent: float) -> tuple[torch.Tensor, torch.Tensor]:
    axis = torch.linspace(-extent, extent, GRID, dtype=torch.float64)
    return axis, axis


def _draw(result: WorkspaceMap, title: str) -> Figure:
    """Draw a figure with one panel per height and one colour bar."""
    norm = _norm(result)
    figure = Figure(figsize=(4.0 * len(result.z) + 1.2, 4.8), dpi=DPI, layout=ConstrainedLayoutEngine(h_pad=0.08))
    panels = figure.subplots(1, len(result.z), sharex=True, sharey=True, squeeze=False)[0]
    for index, panel in enumerate(panels):
        mesh = _draw_panel(panel, result, index, norm)
    panels[0].set_ylabel("y [mm]")
    bar = figure.colorbar(mesh, ax=panels, extend="max", pad=0.015, shrink=0.9)
    bar.set_label("condition number of the Jacobian [1]")
    ticks = FEW_TICKS if float(norm.vmax or 1.0) > WIDE * float(norm.vmin or 1.0) else TICKS
    bar.ax.yaxis.set_major_locator(FixedLocator(ticks))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(ScalarFormatter())
    line = Line2D([], [], color=LIMIT_COLOUR, linewidth=1.8, label="end of travel (pale: beyond it)")
    figure.legend(handles=[line], loc="outside lower center", frameon=False)
    figure.suptitle(title)
    return figure


def _draw_panel(panel: Axes, result: WorkspaceMap, index: int, norm: Normalize) -> QuadMesh:
    """Draw one height: condition number, pale beyond the ends of travel, which a line marks."""
    x, y = result.x.numpy(), result.y.numpy()
    condition = np.minimum(
        result.condition[index].numpy(), BEYOND
    )  # an infinite one would be left white, as if no pose
    margin = result.travel_margin[index].numpy()
    mesh = panel.pcolormesh(x, y, condition, norm=norm, cmap=COLOUR_MAP, shading="nearest", rasterized=True)
    beyond = np.where(margin < 0.0, 1.0, np.nan)
    panel.pcolormesh(x, y, beyond, cmap="Greys", vmin=2.0, vmax=3.0, alpha=0.6, shading="nearest", rasterized=True)
    if np.nanmin(margin, initial=np.inf) < 0.0 < np.nanmax(margin, initial=-np.inf):
        panel.contour(x, y, margin, levels=[0.0], colors=LIMIT_COLOUR, linewidths=1.8)
    panel.plot(0.0, 0.0, marker="+", color="white", markersize=8)
    panel.set_title(f"z = {float(result.z[index]):g} mm")
    panel.set_xlabel("x [mm]")
    panel.set_aspect("equal")
    return mesh


def _norm(result: WorkspaceMap) -> LogNorm:
    """Colour scale over what lies within travel; the infinite values near singularities would take up all of it."""
    within = result.condition[torch.isfinite(result.condition) & (result.travel_margin >= 0.0)]
    values = within if len(within) else result.condition[torch.isfinite(result.condition)]
    if not len(values):
        return LogNorm(1.0, 10.0)
    low, high = float(values.min()), float(torch.quantile(values[:: max(1, len(values) // 100_000)], 0.99))
    return LogNorm(max(1.0, 0.98 * low), max(1.5 * low, high))
