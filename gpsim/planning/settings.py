"""What a plan is made with: the weights of what it is good for, how long its pieces are, how safe it has to be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlanSettings:
    """Weights multiply nats; `probability` and `margin` say what safe means."""

    separation: float = 1.0
    precision: float = 0.1
    novelty: float = 0.02
    enough: float = 10.0
    visible: float = 2.3
    piece: float = 8.0
    settle: float = 3.0
    returns: float = 0.15
    margin: float = 0.1
    probability: float = 0.99
    draws: int = 6
    checked: int = 240
    candidates: int = 40
    best: int = 6
    rounds: int = 2
    slowest: float = 0.1
    fastest: float = 0.4

    def __post_init__(self) -> None:
        for name in ("piece", "enough", "visible", "slowest", "fastest", "returns"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be more than 0, got {getattr(self, name):g}")
        for name in ("separation", "precision", "novelty", "settle"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} must be at least 0, got {getattr(self, name):g}")
        for name in ("margin", "probability"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} must be in [0, 1), got {getattr(self, name):g}")
        for name, least in (("draws", 1), ("checked", 1), ("candidates", 1), ("best", 1), ("rounds", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, got {getattr(self, name)}")
        if self.fastest > 0.5:
            raise ValueError(f"fastest must be at most 0.5 of the rate of commands, got {self.fastest:g}")
