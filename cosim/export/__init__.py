"""A network becomes an FMU."""
