"""Elementary functions in plain IEEE arithmetic: the same bits wherever they are computed."""
