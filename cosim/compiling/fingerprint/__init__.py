"""A text of a function by which what was made of it is found again."""
