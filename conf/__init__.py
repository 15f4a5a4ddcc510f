"""Hydra configs, one folder a choice."""
