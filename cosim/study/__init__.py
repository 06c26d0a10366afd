"""Studies: many runs of one diagram, in variants, over a grid and over random draws."""
