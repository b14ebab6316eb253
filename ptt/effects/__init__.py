"""The library of physical effects, and a user's own beside it.

Every effect of the library is here under its class's name, as `ptt.effects.ColumnBend()`; all are loaded together
when the first is asked for.
"""

from typing import TYPE_CHECKING, Any

from ptt.effects.base import STAGES, Effect
from ptt.effects.curve import Curve
from ptt.effects.own import load_effects
from ptt.effects.parameter import Parameter
from ptt.effects.phrases import Phrase
from ptt.effects.registry import Library, classes, library

if TYPE_CHECKING:
    from ptt.effects.dh_offsets import DhOffsets as DhOffsets
    from ptt.effects.drive import AxisCompliance as AxisCompliance
    from ptt.effects.drive import FollowingError as FollowingError
    from ptt.effects.drive import HomingOffset as HomingOffset
    from ptt.effects.drive import HomingSlip as HomingSlip
    from ptt.effects.joint_error_map import JointErrorMap as JointErrorMap
    from ptt.effects.links import JointClearance as JointClearance
    from ptt.effects.links import JointOffset as JointOffset
    from ptt.effects.links import LinkCompliance as LinkCompliance
    from ptt.effects.links import LinkLength as LinkLength
    from ptt.effects.metrology import SetupJump as SetupJump
    from ptt.effects.metrology import TrackerDrift as TrackerDrift
    from ptt.effects.metrology import TrackerFrame as TrackerFrame
    from ptt.effects.metrology import TrackerScale as TrackerScale
    from ptt.effects.reversal import Backlash as Backlash
    from ptt.effects.reversal import Windup as Windup
    from ptt.effects.screw import LeadScale as LeadScale
    from ptt.effects.screw import OncePerRev as OncePerRev
    from ptt.effects.screw import ScrewErrorMap as ScrewErrorMap
    from ptt.effects.screw import ScrewGrowth as ScrewGrowth
    from ptt.effects.self_weight import SelfWeight as SelfWeight
    from ptt.effects.structure import ColumnBend as ColumnBend
    from ptt.effects.structure import FrameGrowth as FrameGrowth
    from ptt.effects.towers import GuideStraightness as GuideStraightness
    from ptt.effects.towers import TowerPosition as TowerPosition
    from ptt.effects.towers import TowerTilt as TowerTilt
    from ptt.effects.twist import PlatformTwist as PlatformTwist

__all__ = ["STAGES", "Curve", "Effect", "Library", "Parameter", "Phrase", "library", "load_effects"]


def __getattr__(name: str) -> Any:
    """An effect of the library by its class's name."""
    found = classes().get(name)
    if found is None:
        raise AttributeError(f"module 'ptt.effects' has no attribute '{name}'; `ptt effects` lists the effects")
    return found


def __dir__() -> list[str]:
    """Names of the module, including the classes of the library, which are imported on demand."""
    return sorted([*__all__, *classes()])
