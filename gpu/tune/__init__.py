"""Measures accuracy against time: frames are compared with the exact answer."""
