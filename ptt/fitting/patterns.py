"""Patterns that parameters of several joints make together: all alike, along x, sideways, and words for them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ptt.fitting.layout import Layout
from ptt.machine import ThreePttSpec
from ptt.model.model import Model


@dataclass(frozen=True)
class Pattern:
    """A direction of an effect's parameters, with words for it.

    Attributes:
        words: as in 'offset of all sliders together'.
        vector: (u,), unit length, in usual sizes.
        cost: words that take more explaining than a single parameter's name.
    """

    words: str
    vector: np.ndarray
    cost: float


def patterns(layout: Layout, index: int, own: np.ndarray, model: Model) -> list[Pattern]:
    """Patterns of an effect's free parameters, the simplest first.

    Args:
        layout: of the fit.
        index: the effect's place among the terms.
        own: its columns, (p,) int.
        model: that was fitted.

    Returns:
        Single parameters, then what several make together.
    """
    names = [layout.names[i] for i in own]
    term = layout.terms[index]
    places = {name.removeprefix(f"{term.effect.key} "): int(i) for name, i in zip(names, own, strict=True)}
    size = len(layout.owner)
    single = [_pattern(name, {place: 1.0}, size, 0.0) for name, place in places.items()]
    joint = [_pattern(words, weights, size, 0.5) for words, weights in _joint_patterns(layout, index, own, model)]
    return single + joint


def _pattern(words: str, weights: dict[int, float], size: int, cost: float) -> Pattern:
    vector = np.zeros(size)
    for place, weight in weights.items():
        vector[place] = weight
    return Pattern(words, vector / np.linalg.norm(vector), cost)


def _joint_patterns(
    layout: Layout, index: int, own: np.ndarray, model: Model
) -> Iterator[tuple[str, dict[int, float]]]:
    """Patterns over the joints: together, along x and y, and of sideways pairs (outward, along the azimuth)."""
    term, blocks, machine = layout.terms[index], _blocks(layout, index, own, model.joints), model.file.machine
    tripod = isinstance(machine, ThreePttSpec)
    what = "joints" if not tripod else "sliders" if term.effect.stage == "drive" else "legs"
    for stem, places in blocks.items():
        for c in range(places.shape[1]):
            name = stem if places.shape[1] == 1 else f"{stem} {c + 1}"
            yield f"{name} of all {what} together", dict(zip(places[:, c].tolist(), np.ones(len(places)), strict=True))
    if not isinstance(machine, ThreePttSpec):
        return
    angle = np.radians(machine.slider_azimuth_deg)
    if {"radial", "tangential"} <= set(blocks):
        radial, tangential = blocks["radial"], blocks["tangential"]
        for c in range(radial.shape[1]):
            yield from _sideways(term.effect.key, radial[:, c], tangential[:, c], angle)
    for stem, places in blocks.items():
        for c in range(places.shape[1]):
            name = stem if places.shape[1] == 1 else f"{stem} {c + 1}"
            for way, weight in (("x", np.cos(angle)), ("y", np.sin(angle))):
                yield f"{name} differing along {way}", dict(zip(places[:, c].tolist(), weight, strict=True))


def _sideways(
    key: str, radial: np.ndarray, tangential: np.ndarray, angle: np.ndarray
) -> Iterator[tuple[str, dict[int, float]]]:
    """All legs the same way in x or y, as radial and tangential parts."""
    word = "common lean" if "tilt" in key else "common shift"
    for way, out, along in (("x", np.cos(angle), -np.sin(angle)), ("y", np.sin(angle), np.cos(angle))):
        places = [*radial.tolist(), *tangential.tolist()]
        yield f"{word} of all legs along {way}", dict(zip(places, [*out, *along], strict=True))


def _blocks(layout: Layout, index: int, own: np.ndarray, joints: int) -> dict[str, np.ndarray]:
    """Stem -> places (joint, c) of the free parameters that each joint has."""
    term, free = layout.terms[index], layout.free[index]
    place_of = np.full(len(free), -1)
    place_of[free] = own
    result, start = {}, 0
    for parameter in term.effect.parameters:
        size = parameter.size(joints)
        places = place_of[start : start + size]
        start += size
        if parameter.per_joint and len(places) and (places >= 0).all():
            result[parameter.stem] = places.reshape(-1, parameter.count)
    return result
