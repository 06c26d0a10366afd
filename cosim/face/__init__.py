"""What a program or a notebook works with: a diagram as an object, its runs and studies as data."""
