"""Effects: what may be missing. One small file a family, found through one explicit registry."""

from gpsim.effects.effect import Effect, EffectParameter, Place
from gpsim.effects.registry import FAMILIES, effect_of, has_patch
from gpsim.effects.term import Gate, Term

__all__ = ["FAMILIES", "Effect", "EffectParameter", "Gate", "Place", "Term", "effect_of", "has_patch"]
