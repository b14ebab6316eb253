"""Mechanisms: forward and inverse kinematics behind one protocol."""

from ptt.machine import SerialSpec, ThreePttSpec
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.three_ptt import ThreePtt

__all__ = ["Mechanism", "Serial", "ThreePtt", "build_mechanism"]


def build_mechanism(spec: ThreePttSpec | SerialSpec) -> Mechanism:
    """Build the mechanism that a machine file's [machine] section describes.

    Args:
        spec: the section, by `ptt.machine.load_machine`.

    Returns:
        The mechanism.

    Raises:
        MachineError: its dimensions cannot be built.
    """
    if isinstance(spec, ThreePttSpec):
        return ThreePtt.from_spec(spec)
    return Serial.from_spec(spec)
