"""Evaluation: one step, rollout, return - the thesis's three layers - and which starts can be solved at all."""
