"""Environments: a simulator or target with a task, to be driven and recorded."""
