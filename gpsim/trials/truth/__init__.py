"""What truly happens in a concealed world, and how visible its effects are."""
