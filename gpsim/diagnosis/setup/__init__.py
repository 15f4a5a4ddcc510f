"""Setup: from a recording to the question and to what may be missing."""
