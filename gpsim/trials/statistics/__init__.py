"""From the scores of all trials to figures with intervals, and the goals that they must reach."""
