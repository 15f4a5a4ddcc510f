"""What a diagnosis claims, held against the answer."""
