"""Into the inside of a run: to a moment of it with the authors' functions at hand, and to where two runs part."""
