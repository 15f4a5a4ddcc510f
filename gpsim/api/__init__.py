"""The face: what `import gpsim` offers. Nothing else in the package imports it; its files load when they are asked for.

Offered are its files: what asks for one name does not wait for what others need.
"""

__all__ = [
    "corrected", "diagnosis", "environment", "evaluation", "planning", "processes", "recordings",
    "registration", "simulators",
]  # fmt: skip
