"""Accuracy against time: frames measured against the exact answer."""
