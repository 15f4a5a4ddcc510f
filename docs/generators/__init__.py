"""Pages of docs/ that are made from the code and from records: see docs/generate.py."""

MADE = "Made by `python docs/generate.py` from {source}; a test holds it current."
