"""A virtual machine: its drawing, its faults and the conditions of its run."""

from dataclasses import dataclass, field

from ptt.errors import InputError
from ptt.machine import MachineFile, SerialSpec, ThreePttSpec
from ptt.rig import schema
from ptt.rig.odd_schema import Odd


@dataclass(frozen=True)
class Rig:
    """A virtual machine and the conditions it is run under.

    Attributes:
        machine: the drawing and the base reflectors.
        seed: of every random number of the machine and of a run.
        conditions: payload, feed, room, cycles.
        controller: compensation by the controller.
        drive: faults between command and slider.
        thermal: temperatures and growth.
        geometry: faults of rails, links, joints and platform.
        structure: bending of the column.
        arm: faults of a serial arm, which has none of drive, thermal, geometry and structure.
        odd: faults that are no effect of the library.
        tracker: metrology.
        source: the file's name for messages.
    """

    machine: MachineFile
    seed: int
    conditions: schema.Conditions
    controller: schema.Controller
    drive: schema.Drive
    thermal: schema.Thermal
    geometry: schema.Geometry
    structure: schema.Structure
    arm: schema.Arm
    odd: tuple[Odd, ...]
    tracker: schema.Tracker
    source: str = field(compare=False)

    @property
    def spec(self) -> ThreePttSpec:
        """The drawing of a 3-PTT; an InputError for an arm."""
        if not isinstance(self.machine.machine, ThreePttSpec):
            what = "this needs a 3-PTT, the rig is a serial arm"
            raise InputError(what, where=self.source, fix='use a machine of kind "three-ptt"')
        return self.machine.machine

    @property
    def serial(self) -> SerialSpec | None:
        """The drawing of a serial arm; None for a 3-PTT."""
        return self.machine.machine if isinstance(self.machine.machine, SerialSpec) else None

    @property
    def sent(self) -> list[str]:
        """Columns of commands that were corrected: b1.. or q1.., one for each joint."""
        spec = self.machine.machine
        return [f"{spec.letter}{joint + 1}" for joint in range(spec.joints)]

    @property
    def commanded(self) -> list[str]:
        """Columns of joint commands in a run: mm for sliders, rad for an arm."""
        return [f"{joint}_cmd{'' if self.serial is None else '_rad'}" for joint in self.sent]
