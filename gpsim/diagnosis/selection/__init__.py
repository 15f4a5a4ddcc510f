"""Selection: which of the candidates are taken."""
