"""Stages: one file a command; inputs and configuration in, one artifact out."""
