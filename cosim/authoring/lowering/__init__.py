"""Arithmetic of whole arrays, as authors write it, into loops over elements, which both engines run alike.

An expression is walked once (`array_expressions`): what it stands for (`lowered_values`) is a number, or an array that
is known element by element, with its sizes as far as dimensions tell them (`axis_sizes`). Products, sums, slices and
calls of helpers become statements before it; assignments (`array_statements`) become loops. Memory that is needed is an
argument of the lowered function, laid out before the run: on the stack where sizes are part of the code, in the arena
else.
"""
