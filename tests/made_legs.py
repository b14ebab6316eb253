"""Drawings of a 3-PTT by its numbers, R 200, r 100, L 300 mm where nothing else is said, and poses about its home."""

import torch

from ptt.machine import ThreePttSpec
from ptt.mechanisms.three_ptt import ThreePtt


def drawing(**changes: object) -> ThreePttSpec:
    values = {"base_radius_mm": 200.0, "platform_radius_mm": 100.0, "link_length_mm": 300.0}
    return ThreePttSpec(kind="three-ptt", **{**values, "slider_travel_mm": (150.0, 420.0), **changes})


def made(**changes: object) -> ThreePtt:
    return ThreePtt.from_spec(drawing(**changes))


def at_random(n: int, columns: int = 3, size: float = 60.0, seed: int = 0) -> torch.Tensor:
    """Numbers at random between -size and size, (n, columns)."""
    generator = torch.Generator().manual_seed(seed)
    return size * (2.0 * torch.rand(n, columns, dtype=torch.float64, generator=generator) - 1.0)


def tensor(*values: object) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)
