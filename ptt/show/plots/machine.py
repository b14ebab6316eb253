"""Picture of a 3-PTT as the program understands its file: from above, from the side, with its dimensions."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptt.errors import MachineError
from ptt.machine import MachineFile, ThreePttSpec
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.setup.machine import describe_machine, reachable
from ptt.show.plots.common import BLUE, DARK, ORANGE, PALE

RAIL, GREY = "#bbbbbb", "#666666"
BEYOND = 0.12  # margin above and below, as a share of the drawn heights
GRID = 241  # points across at which it is tested what can be reached; twice as many upward


def draw_machine(file: MachineFile, words: bool = True) -> Figure:
    """Draw a machine: slider numbers, direction of b, position of z = 0, meaning of sliders 'above' or 'below'.

    Args:
        file: the machine.
        words: whether its dimensions are listed below.

    Returns:
        A figure with the view from above, the view from the side, and the list of dimensions.

    Raises:
        MachineError: an arm, or a machine that cannot be built.
    """
    if not isinstance(file.machine, ThreePttSpec):
        raise MachineError("only a 3-PTT is drawn", where=file.source, fix="leave --drawing out")
    figure = Figure(figsize=(13.0, 7.2 if words else 6.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.25), height_ratios=(1.0, 0.13 if words else 1e-3))
    mechanism = ThreePtt.from_spec(file.machine)
    _from_above(figure.add_subplot(grid[0, 0]), file.machine, mechanism)
    _from_side(figure.add_subplot(grid[0, 1]), file.machine, mechanism)
    if words:
        below = figure.add_subplot(grid[1, :])
        below.axis("off")
        below.text(0.0, 1.0, str(describe_machine(file)), va="top", fontsize=10, family="monospace")
    figure.suptitle(f"{file.machine.name}, as understood", fontsize=13, fontweight="bold")
    return figure


def _from_above(axes: Axes, spec: ThreePttSpec, mechanism: ThreePtt) -> None:
    """Draw sliders with their numbers, the platform at home, and what can be reached at z = 0."""
    size = _width(spec)
    _shade_reach(axes, mechanism, size, plane=(0, 1))
    base, platform = _joints(spec)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(spec.base_radius_mm * np.cos(turn), spec.base_radius_mm * np.sin(turn), ":", color=GREY, lw=1)
    axes.fill(*platform.T, color=ORANGE, alpha=0.5, zorder=3)
    for leg in range(3):
        axes.plot(*np.column_stack([base[leg], platform[leg]]), color=BLUE, lw=3, zorder=4)
        _slider(axes, base[leg], str(leg + 1))
        out = base[leg] / spec.base_radius_mm
        beside = base[leg] + 0.22 * size * out
        angle = f"{spec.slider_azimuth_deg[leg]:g}\N{DEGREE SIGN}"
        axes.text(beside[0], beside[1], angle, ha="center", va="center", fontsize=10, color=GREY)
    for end, name in (((0.3 * size, 0.0), "x"), ((0.0, 0.3 * size), "y")):
        axes.annotate("", end, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": "black", "lw": 1.5}, zorder=7)
        axes.text(1.2 * end[0], 1.2 * end[1], name, fontsize=11, fontweight="bold", ha="center", va="center", zorder=7)
    first, *others = spec.slider_azimuth_deg
    between = np.radians(first + min((other - first) % 360.0 for other in others) / 2.0)  # no slider hides the words
    rim = spec.base_radius_mm * np.array([np.cos(between), np.sin(between)])
    axes.annotate("", _at(rim), (0.0, 0.0), arrowprops={"arrowstyle": "<->", "color": GREY, "lw": 0.8}, zorder=2)
    words = f"base radius\n{spec.base_radius_mm:g} mm"
    axes.text(1.13 * rim[0], 1.13 * rim[1], words, color=GREY, fontsize=9, ha="center", va="center")
    axes.set_title("from above, tool at x = y = z = 0; shaded: reach at z = 0", fontsize=10)
    _frame(axes, (-1.4 * size, 1.4 * size), (-1.4 * size, 1.4 * size), "x [mm]", "y [mm]")


def _from_side(axes: Axes, spec: ThreePttSpec, mechanism: ThreePtt) -> None:
    """Draw slider 1 in the plane of its rail: travel, direction of b, z = 0, side of the sliders."""
    size = _width(spec)
    home, ends = float(mechanism.home()[0]), mechanism.limits().numpy()[:, 0]
    lean = np.radians(spec.slider_lean_deg[0])
    rail = np.array([np.sin(lean), np.cos(lean)])
    slider = np.array([spec.base_radius_mm, home])
    joint, inner = slider - spec.joint_height_mm * np.array([0.0, 1.0]), np.array([spec.platform_radius_mm, 0.0])
    low, high = (slider + (end - home) * rail for end in ends)
    _shade_reach(axes, mechanism, size, plane=(0, 2), azimuth=float(np.radians(spec.slider_azimuth_deg[0])))
    axes.axhline(0.0, color="black", lw=0.8, ls="--", zorder=1)
    axes.plot(*np.column_stack([low, high]), color=RAIL, lw=9, solid_capstyle="butt", zorder=2)
    axes.plot(*np.column_stack([-0.5 * inner, inner]), color=ORANGE, lw=7, solid_capstyle="round", zorder=3)
    axes.plot(*np.column_stack([inner, joint]), color=BLUE, lw=3, marker="o", ms=5, zorder=5)
    _slider(axes, slider, "1")
    axes.plot(0.0, 0.0, "o", color="black", ms=7, zorder=7)
    _count(axes, slider, rail, size, ((home, "home"), (ends[0], "least"), (ends[1], "most")))
    _name_parts(axes, spec, inner, joint)
    side = -1.0 if spec.sliders == "above" else 1.0
    heights = np.array([low[1], high[1], 0.0, joint[1], side * 0.5 * size])
    rim = BEYOND * np.ptp(heights)
    towards = f"{spec.slider_azimuth_deg[0]:g}\N{DEGREE SIGN}"
    axes.set_title(f"from the side, through slider 1 (towards {towards}); shaded: reach", fontsize=10)
    _frame(
        axes, (-2.15 * size, 2.3 * size), (heights.min() - rim, heights.max() + rim), "towards slider 1 [mm]", "z [mm]"
    )


def _name_parts(axes: Axes, spec: ThreePttSpec, inner: np.ndarray, joint: np.ndarray) -> None:
    """Label z = 0, the side of the sliders and the lengths, at platform joint `inner` and slider joint `joint`, mm."""
    above = spec.sliders == "above"
    left, side = -2.1 * _width(spec), -1.0 if above else 1.0
    words = "z = 0: tool (black) at home,\nlevel with the platform's joints"
    axes.text(left, 0.0, words, fontsize=9, va="bottom" if above else "top")
    hang = "hang down from them" if above else "stand up from them"
    word = f'sliders = "{spec.sliders}":\nthey ride {spec.sliders} the platform,\nthe links {hang}'
    axes.text(left, 0.6 * joint[1], word, fontsize=10, color=BLUE, va="center")
    axes.annotate(f"link {spec.link_length_mm:g} mm", _at((inner + joint) / 2.0), (-10, 0), textcoords="offset points",
                  fontsize=9, color=BLUE, ha="right", va="center")  # fmt: skip
    axes.annotate(f"platform radius {spec.platform_radius_mm:g} mm", _at(inner / 2.0), (0, 16 * side),
                  textcoords="offset points", fontsize=9, color="#8a6000", ha="center", va="center")  # fmt: skip
    if spec.joint_height_mm:
        axes.annotate(f"joint {spec.joint_height_mm:g} mm below the height that is read", _at(joint), (14, -4),
                      textcoords="offset points", fontsize=8, color=GREY, va="top")  # fmt: skip


def _slider(axes: Axes, place: np.ndarray, number: str) -> None:
    axes.plot(*place, "s", color=DARK, ms=16, zorder=6)
    axes.text(place[0], place[1], number, color="white", ha="center", va="center", fontweight="bold", zorder=7)


def _count(axes: Axes, slider: np.ndarray, rail: np.ndarray, size: float, marks: tuple[tuple[float, str], ...]) -> None:
    """Draw the direction of b, and its values at home and at both ends of travel."""
    home = marks[0][0]
    start = slider + np.array([0.16 * size, 0.0]) + 0.1 * size * rail
    axes.annotate(
        "", _at(start + 0.36 * size * rail), _at(start), arrowprops={"arrowstyle": "-|>", "color": DARK, "lw": 2.5}
    )
    beside = start + 0.18 * size * rail + np.array([0.04 * size, 0.0])
    axes.text(beside[0], beside[1], "b1 counts this way", color=DARK, fontsize=10, va="center")
    for value, name in marks:
        place = slider + (value - home) * rail
        axes.text(place[0] + 0.12 * size, place[1], f"{name}: b1 = {value:.6g} mm", fontsize=9, color=GREY, va="center")


def _joints(spec: ThreePttSpec) -> tuple[np.ndarray, np.ndarray]:
    """Joints of base and platform seen from above, (3, 2) mm each."""
    azimuth = np.radians(spec.slider_azimuth_deg)
    radial = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    return spec.base_radius_mm * radial, spec.platform_radius_mm * radial


def _at(place: np.ndarray) -> tuple[float, float]:
    return float(place[0]), float(place[1])


def _width(spec: ThreePttSpec) -> float:
    """Length that sets the scale of the picture, mm."""
    return float(max(spec.base_radius_mm, spec.platform_radius_mm, 0.4 * spec.link_length_mm))


def _shade_reach(axes: Axes, mechanism: ThreePtt, size: float, plane: tuple[int, int], azimuth: float = 0.0) -> None:
    """Shade what can be reached within the travel, in a horizontal plane or in the vertical one at an azimuth, rad."""
    across = 1.3 * size * np.linspace(-1.0, 1.0, GRID)
    up = across if plane == (0, 1) else 2.5 * float(mechanism.link.max()) * np.linspace(-1.0, 1.0, 2 * GRID)
    first, second = np.meshgrid(across, up)
    points = np.zeros((*first.shape, 3))
    points[..., 0], points[..., 1] = first * np.cos(azimuth), first * np.sin(azimuth)
    points[..., plane[1]] = second
    inside = reachable(mechanism, points)
    axes.contourf(first, second, inside.astype(float), levels=[0.5, 1.5], colors=[PALE], alpha=0.35, zorder=0)


def _frame(axes: Axes, across: tuple[float, float], up: tuple[float, float], label: str, other: str) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(*across)
    axes.set_ylim(*up)
    axes.set_xlabel(label)
    axes.set_ylabel(other)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
