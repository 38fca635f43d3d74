"""Numbers of a frame, computed once in float64: where solids are seen, and their forms on rays."""
