"""Training of policies: the one place that knows stable-baselines3.

Offered are its files: what only asks for settings does not wait seconds for torch.
"""

__all__ = ["expert_iteration", "ppo", "sac", "settings"]
