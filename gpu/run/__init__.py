"""A band of a frame, rendered by a device or by the twin."""
