"""Frames of scenes: what is rendered, and what comes of it."""
