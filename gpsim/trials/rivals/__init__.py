"""What else could be said of a world: explanations as good as the truth, and another program's answer."""
