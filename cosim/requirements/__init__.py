"""Requirements in signal temporal logic, and by how much a run keeps them."""
