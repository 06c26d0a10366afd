"""Arithmetic of whole arrays, as authors write it, into loops over elements, which both engines run alike."""
