"""Training of policies: the one place that knows stable-baselines3."""

from gpsim.policies.ppo import train_ppo
from gpsim.policies.sac import train_sac

__all__ = ["train_ppo", "train_sac"]
