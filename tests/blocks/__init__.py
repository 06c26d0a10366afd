"""Tests of the signal blocks, each called alone."""
