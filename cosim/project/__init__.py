"""A person's own project: what it begins with, and the files of a new block."""
