"""Residuals: where a recording meets a simulator, what happened minus what was predicted."""
