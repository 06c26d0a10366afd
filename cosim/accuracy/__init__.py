"""How wrong figures may be: runs of one diagram with smaller steps, and what they tell."""
