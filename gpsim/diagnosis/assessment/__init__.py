"""Assessment: what the answer is worth on held-out data, where the mismatch lies, what is left."""
