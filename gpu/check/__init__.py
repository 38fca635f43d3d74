"""Compares a device with the twin: whole frames, and every stage function alone."""
