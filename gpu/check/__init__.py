"""A device against the twin."""
