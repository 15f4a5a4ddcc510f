"""Corrected simulators: the base with what recordings taught, by a Gaussian process or by named effects."""
