"""Gymnasium's own tasks on plants of their robots: what they reward and when they end is theirs."""

from gpsim.gymtasks.task import GymTask, is_gym_task
