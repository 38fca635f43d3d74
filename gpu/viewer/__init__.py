"""A live view of a scene, in a window, in a browser, in a terminal and in a notebook.

A `session` turns events into pictures and knows no canvas. `show` connects it to a canvas of
rendercanvas.
"""
