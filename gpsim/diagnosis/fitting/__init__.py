"""Fitting: a hypothesis against windows, by multiple shooting."""
