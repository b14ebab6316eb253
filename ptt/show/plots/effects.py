"""Picture of an effect: its error over the workspace, and its residual against the telling variable."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ptt.effects import Effect
from ptt.effects.bench import sample_machine, sample_view
from ptt.effects.cards import card_of
from ptt.show.plots.atlas import LOAD, SPEED, UM, WARM, Field, Signature, effect_field, effect_signature, picture_theta
from ptt.show.plots.common import DPI, in_micro, save
from ptt.show.sizing import round_down

ARROWS = 15  # grid points per arrow along each axis


def plot_effect(effect: Effect, path: str | Path) -> None:
    """Draw an effect at its usual size on the sample machine.

    Args:
        effect: the effect.
        path: PNG to write.
    """
    kind = effect.mechanisms[0]
    theta = picture_theta(effect, kind)
    figure = Figure(figsize=(11.0, 5.1), dpi=DPI, layout=ConstrainedLayoutEngine(w_pad=0.15, h_pad=0.15))
    left, right = figure.subplots(1, 2)
    _draw_field(figure, left, effect_field(effect, theta, kind), kind)
    _draw_signature(
        figure, right, effect_signature(effect, theta, sample_view(kind, effect.least_joints), card_of(effect))
    )
    figure.suptitle(f"{effect.key} at usual size on the {sample_machine(kind).machine.name}, before any alignment")
    save(figure, path)


def _draw_field(figure: Figure, panel: Axes, field: Field, kind: str) -> None:
    """Size of the error in colour, its horizontal part as arrows."""
    size = UM * np.linalg.norm(field.error, axis=-1)
    low, high = float(np.nanmin(size)), float(np.nanmax(size))
    if high - low < 0.05 * max(high, 1e-3):
        low, high = 0.0, 1.05 * max(high, 1e-3)  # an almost constant field gets one colour, not amplified differences
    mesh = panel.pcolormesh(
        field.x, field.y, size, cmap="viridis", vmin=low, vmax=high, shading="nearest", rasterized=True
    )
    figure.colorbar(mesh, ax=panel, label="size of the error [um]")
    part = (slice(ARROWS // 2, None, ARROWS), slice(ARROWS // 2, None, ARROWS))
    flat = UM * field.error[part][..., :2]
    largest = float(np.nanmax(np.linalg.norm(flat, axis=-1)))
    if largest > 1e-3:
        x, y = np.meshgrid(field.x, field.y)
        scale = largest / (0.9 * ARROWS * (field.x[1] - field.x[0]))
        arrows = panel.quiver(
            x[part], y[part], flat[..., 0], flat[..., 1], angles="xy", scale_units="xy", scale=scale, color="white",
            edgecolor="black", linewidth=0.4, width=0.006,
        )  # fmt: skip
        nice = round_down(largest)
        panel.quiverkey(arrows, 0.72, -0.105, nice, in_micro(f"{nice:g} um in x, y"), labelpos="E", color="black")
    panel.set_box_aspect(1.0)  # both axes span the same length
    panel.set_xlabel("x [mm]")
    panel.set_ylabel("y [mm]")
    speed = f"{SPEED[kind]:g} {'mm/s' if kind == 'three-ptt' else 'rad/s'}"
    panel.set_title(f"z = {field.z:.0f} mm; {LOAD:g} kg, +{WARM:g} K, upward at {speed}", fontsize=9, loc="left")


def _draw_signature(figure: Figure, panel: Axes, sign: Signature) -> None:
    """Points of the sample run, coloured by the second variable."""
    if sign.shade is None:
        panel.scatter(sign.telling, sign.residual, s=16, color="#33638d")
    elif len(np.unique(sign.shade)) == 2:
        for value, colour, marker in zip(np.unique(sign.shade), ("#440154", "#35b779"), ("v", "^"), strict=True):
            rows = sign.shade == value
            panel.scatter(
                sign.telling[rows], sign.residual[rows], s=18, color=colour, marker=marker, label=f"{value:+g}"
            )
        panel.legend(
            title=sign.labels[2], title_fontsize=8, fontsize=8, ncols=2, frameon=False, borderpad=0.0,
            loc="lower right", bbox_to_anchor=(1.0, 1.0),
        )  # fmt: skip
    else:
        points = panel.scatter(sign.telling, sign.residual, s=18, c=sign.shade, cmap="cividis")
        figure.colorbar(points, ax=panel, label=sign.labels[2])
    spread, middle = float(np.ptp(sign.residual)), abs(float(sign.residual.mean()))
    if not 0.02 * middle < spread < 0.5 * middle:  # small variations about a large mean are drawn without the zero line
        panel.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
    panel.set_xlabel(sign.labels[0])
    panel.set_ylabel(sign.labels[1])
    panel.set_title("sample run, no noise", fontsize=9, loc="left")
