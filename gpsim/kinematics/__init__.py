"""Kinematics: what a motion capture of a model's sites says of its geometry, before anything is simulated."""

from gpsim.kinematics.calibration import Calibration, calibrate
