"""The library of physical effects, and a user's own beside it."""

from ptt.effects.base import STAGES, Effect, Parameter
from ptt.effects.registry import Library, library, load_effects

__all__ = ["STAGES", "Effect", "Library", "Parameter", "library", "load_effects"]
