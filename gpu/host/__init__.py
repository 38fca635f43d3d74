"""Computes the numbers of a frame in float64: the rectangles of solids, and their forms on rays."""
