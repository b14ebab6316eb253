"""Hypotheses of mistakes in the machine file, and the list of all that the columns of a run leave possible."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from ptt.machine import ThreePttSpec
from ptt.setup.candidates import UNITS, mirrors, order_words, slider_orders, slider_units, turned_axes, units
from ptt.setup.setup import Hypothesis, Setup, Undo, drawn

SHORTEST, LONGEST = 60.0, 1e4  # mm, link lengths of machines that carry a reflector
UNEVEN = 0.1  # deg by which azimuths differ from 120 deg apart
LONG = 3.0  # link lengths: a longer travel is in millimetres while the links are in cm or inches


def is_no_machine(spec: ThreePttSpec) -> bool:
    """Whether the link length is implausible in millimetres and plausible in another unit."""
    return not SHORTEST <= spec.link_length_mm <= LONGEST and any(
        SHORTEST <= factor * spec.link_length_mm <= LONGEST for factor in UNITS.values()
    )


def mistakes_in(setup: Setup) -> list[Hypothesis]:
    """Every single geometric mistake that the columns of a run leave possible.

    Args:
        setup: both files.

    Returns:
        Hypotheses, the plainer first.
    """
    table = setup.table
    read, wanted = np.isfinite(table.measured).any(), np.isfinite(table.target).any()
    sent = table.command is not None
    found: list[Hypothesis] = []
    if read:
        found += [*mirrors("readings"), *units("readings")]
        found += [] if setup.free else turned_axes()
    if wanted:
        found += units("targets")
        found += mirrors("targets") if sent or not read else []
    if wanted and read:
        found += units("both")
        found += mirrors("both") if sent else []
    if sent:
        found += [*slider_units(setup), *slider_orders()]
    if sent or wanted:
        found += [*drawing_slips(setup)]
    return found


def drawing_slips(setup: Setup) -> Iterator[Hypothesis]:
    """Mistakes in the machine file that have no free number."""
    spec = drawn(setup)
    other = "below" if spec.sliders == "above" else "above"
    yield Hypothesis(
        "slider-side", f"the sliders {other} the platform", f'write sliders = "{other}"', drawn_with(sliders=other)
    )
    yield from _azimuths(spec)
    base, platform, link = spec.base_radius_mm, spec.platform_radius_mm, spec.link_length_mm
    swap = f"write base_radius_mm = {platform:g} and platform_radius_mm = {base:g}"
    yield Hypothesis(
        "radii-interchanged", "base and platform radius interchanged", swap,
        drawn_with(base_radius_mm=platform, platform_radius_mm=base),
    )  # fmt: skip
    for keys in (("base_radius_mm",), ("platform_radius_mm",), ("base_radius_mm", "platform_radius_mm")):
        half = {key: getattr(spec, key) / 2.0 for key in keys}
        words = f"half of {' and '.join(keys)}, which {'is a diameter' if len(keys) == 1 else 'are diameters'},"
        fix = "write " + " and ".join(f"{key} = {value:g}" for key, value in half.items())
        yield Hypothesis("diameter-for-radius", words, fix, drawn_with(**half), 0.1 * (len(keys) - 1))
    for unit, factor in UNITS.items():
        if not SHORTEST <= factor * link <= LONGEST or (SHORTEST <= link <= LONGEST and setup.table.command is None):
            continue  # without commands only the reach of targets would speak against a machine of that size
        lengths: dict[str, object] = {
            "base_radius_mm": factor * base, "platform_radius_mm": factor * platform, "link_length_mm": factor * link
        }  # fmt: skip
        low, high = spec.whole_travel
        if high - low < LONG * link:
            one_for_all = not isinstance(spec.slider_travel_mm[0], tuple)
            ends = tuple((factor * lowest, factor * highest) for lowest, highest in spec.travel_ends)
            lengths["slider_travel_mm"] = ends[0] if one_for_all else ends
        fix = f"write base_radius_mm = {factor * base:g} and so on, in mm"
        yield Hypothesis("unit-scale", f"the machine file's lengths taken as {unit}", fix, drawn_with(**lengths), 0.1)


def _azimuths(spec: ThreePttSpec) -> Iterator[Hypothesis]:
    """Azimuths in radians; in another order, where they are uneven: else that is the columns' order."""
    azimuth = spec.slider_azimuth_deg
    if 0.0 < max(map(abs, azimuth)) < 4.0 * np.pi:
        degrees = tuple(round(float(np.degrees(angle)), 3) for angle in azimuth)
        fix = f"write slider_azimuth_deg = {list(degrees)}"
        yield Hypothesis(
            "angle-unit", "slider_azimuth_deg taken as radians", fix, drawn_with(slider_azimuth_deg=degrees)
        )
    uneven = np.abs(np.diff(np.sort(np.mod(azimuth, 360.0))) - 120.0).max() > UNEVEN
    for order in list(permutations(range(3)))[1:] if uneven or len(set(spec.slider_lean_deg)) > 1 else []:
        other = tuple(azimuth[leg] for leg in order)
        fix = f"write slider_azimuth_deg = {list(other)}"
        words = f"the azimuths of {order_words(order)}"
        yield Hypothesis("slider-order", words, fix, drawn_with(slider_azimuth_deg=other), 0.12)


def drawn_with(**changes: object) -> Undo:
    """The drawing with some of its keys replaced."""
    return lambda setup: setup.with_drawing(**changes)
