"""Stages with several files: the twin takes one module of each, as a shader takes one file."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.formats import Format
from halfstep.twin import certify
from halfstep.twin.certify import LineErrors, Run
from halfstep.twin.conveyor import conveyor
from halfstep.twin.lanes import Form, FormErrors
from halfstep.twin.piece import Line
from halfstep.twin.root import Root
from halfstep.twin.sight import Sight

Coefficients = NDArray[Any]
# The offset of a pixel, in the type of the chosen module of polynomials.
Offset = Any


class Forms(Protocol):
    """A solid's forms along rays, and their errors."""

    def line_at(self, c: Coefficients, b: Coefficients, at: Offset) -> Line:
        """A half-space along the ray, given ``c`` and ``b`` (3,)."""

    def line_errors(
        self, c: Coefficients, b: Coefficients, at: Offset, host_error: np.float32
    ) -> LineErrors:
        """Its errors, given the error of the set-up."""

    def form_at(self, a: Coefficients, g: Coefficients, c: Coefficients, at: Offset) -> Form:
        """F along the ray, given ``a``, ``g`` and ``c`` (6,)."""

    def form_errors(
        self,
        a: Coefficients,
        g: Coefficients,
        c: Coefficients,
        at: Offset,
        host_error: np.float32,
    ) -> FormErrors:
        """Its errors; that of the set-up is known."""


class Chosen(NamedTuple):
    """The chosen stages."""

    offset: Callable[[NDArray[Any], NDArray[Any]], Offset]
    forms: Forms
    conveyor: Callable[[Root, Root, int, Collection[str]], Sight]
    halvings: Run  # the roundings of the method
    searches: Run  # the roundings of the conveyor


def chosen_for(number_format: Format, method: str) -> Chosen:
    """The stages of a number format."""
    run = number_format.article_run if method == "article" else number_format.run
    forms: Any = module(number_format.forms)
    return Chosen(
        offset=module(number_format.polynomial).offset,
        forms=forms,
        conveyor=partial(conveyor, module(number_format.halve)),
        halvings=getattr(certify, run),
        searches=getattr(certify, number_format.run),
    )


def module(name: str) -> ModuleType:
    """The twin of a stage."""
    return import_module(f"halfstep.twin.{name}")
