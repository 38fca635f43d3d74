"""A device or the twin renders a band of a frame: some of its rows of pixels."""
