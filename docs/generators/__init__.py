"""Pages of docs/ that are made from the code and from records: see docs/generate.py."""

MADE = "`python docs/generate.py` makes this page from {source}; a test keeps it current."
