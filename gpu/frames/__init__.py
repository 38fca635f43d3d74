"""Renders frames of scenes, and makes the arrays of a frame from the outputs of its bands."""
