"""The library of physical effects, and a user's own beside it."""

from ptt.effects.base import STAGES, Effect
from ptt.effects.parameter import Parameter
from ptt.effects.phrases import Phrase
from ptt.effects.registry import Library, library, load_effects

__all__ = ["STAGES", "Effect", "Library", "Parameter", "Phrase", "library", "load_effects"]
