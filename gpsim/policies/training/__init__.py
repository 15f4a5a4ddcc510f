"""Training of policies: the one place that knows stable-baselines3."""

from gpsim.policies.training.ppo import train_ppo
from gpsim.policies.training.sac import train_sac

__all__ = ["train_ppo", "train_sac"]
