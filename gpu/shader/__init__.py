"""Composes the text of shaders from WGSL files, for the needs of a frame."""
