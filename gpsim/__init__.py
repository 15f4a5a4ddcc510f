"""gpsim: close the gap between a simple simulator and a real robot, and say which physics was missing."""

__version__ = "0.1.0"
