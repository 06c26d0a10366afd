"""Functions of fleets, for eight members at a time: see `tiling`."""
