"""Artifacts: versioned folders with a manifest, written whole or not at all, verified when read."""
