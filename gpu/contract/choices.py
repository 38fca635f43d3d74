"""The names that a user can choose from."""

from __future__ import annotations

from typing import Literal, get_args

NumberFormat = Literal["float32", "fixed32"]
Method = Literal["visible", "article"]
# What the colours of cells depend on.
ColorBy = Literal["material", "place"]
# "auto" takes a device if there is one, else NumPy.
BackendName = Literal["auto", "gpu", "numpy"]
# Where a view is shown. "auto" takes a window if there is a display, else a page for a browser.
Canvas = Literal["auto", "glfw", "http", "terminal"]

NUMBER_FORMATS: tuple[NumberFormat, ...] = get_args(NumberFormat)
METHODS: tuple[Method, ...] = get_args(Method)
BACKENDS: tuple[BackendName, ...] = get_args(BackendName)
CANVASES: tuple[Canvas, ...] = get_args(Canvas)
