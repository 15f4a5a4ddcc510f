"""Judgement: the verdict on what was selected, and its rivals."""
