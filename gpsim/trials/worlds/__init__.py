"""What a concealed world is, as plain data: its system, its effects, how it is driven, how large things are in it."""
