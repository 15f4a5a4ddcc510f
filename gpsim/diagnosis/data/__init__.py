"""Data: a recording cut into windows, some held out."""
