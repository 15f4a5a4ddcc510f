"""Policies: what acts, how it is written down for other programs, and the search that teaches it."""
