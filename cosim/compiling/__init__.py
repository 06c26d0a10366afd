"""An author's function becomes an address."""
