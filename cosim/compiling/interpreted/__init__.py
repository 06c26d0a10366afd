"""Authors' functions as plain Python whose numbers behave as in compiled kernels, to the bit."""
