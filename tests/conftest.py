"""What several test files share."""

import pytest

from ptt.machine import MachineFile, parse_machine

BENCH = """
[machine]
kind = "three-ptt"
name = "bench"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
screw_lead_mm = 5
platform_mass_kg = 1
"""


@pytest.fixture
def bench() -> MachineFile:
    """The machine of the hand-worked cases: R 200, r 100, L 300 mm."""
    return parse_machine(BENCH, "bench.toml")
