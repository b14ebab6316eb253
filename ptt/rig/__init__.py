"""The virtual machine: stands in for reality, and shares no equation with the model that is fitted to its readings."""

from ptt.rig.rig import Rig
from ptt.rig.rig_file import format_rig, load_rig, parse_rig
from ptt.rig.simulate import RunResult, simulate, write_run

__all__ = ["Rig", "RunResult", "format_rig", "load_rig", "parse_rig", "simulate", "write_run"]
