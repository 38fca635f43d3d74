"""Gathers, for a group built from Python, the objects that its cells, places and lattices use."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import count
from typing import Any, TypeAlias

from halfstep.scene.faults import fault
from halfstep.scene.formula import Formula, Leaf, Name, Sense, leaves, with_leaves
from halfstep.scene.references import NamedGroup, Reference
from halfstep.scene.solids import Part
from halfstep.scene.surfaces import Surface
from halfstep.scene.values import Table

# Keys of tables by the names of their attributes; Python may give either.
_KEYS = {
    "surfaces": "surface",
    "parts": "part",
    "cells": "cell",
    "groups": "group",
    "places": "place",
    "lattices": "lattice",
}
_Label: TypeAlias = int | str


def with_what_is_named(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The keys of a scene or group, completed by the surfaces, parts and groups that it uses.

    A table from a file is a mapping. It uses others by number and word only, and adds nothing.

    Raises:
        PydanticCustomError: a region uses a cell that the group lacks.
    """
    keys = {name: name if name in data else alias for name, alias in _KEYS.items()}
    given = {name: data.get(key) for name, key in keys.items()}
    tables = {
        name: list(each) if isinstance(each, list | tuple) else [] for name, each in given.items()
    }
    if not any(isinstance(each, Table) for own in tables.values() for each in own):
        return data
    named = [_named(leaf) for each in tables["cells"] + tables["places"] for leaf in _leaves(each)]
    holders = tables["cells"] + tables["places"] + tables["lattices"]
    _take_in(tables["surfaces"], "id", (each for each in named if isinstance(each, Surface)))
    _take_in(tables["parts"], "name", (each for each in named if isinstance(each, Part)))
    _take_in(tables["groups"], "name", (each for holder in holders for each in _groups(holder)))

    asked = {id(each) for each in named}
    numbers = {_get(each, "id") for each in tables["surfaces"]}
    words = {_get(each, "name") for each in tables["parts"] + tables["cells"]}
    labels: dict[int, _Label] = {}
    _label(tables["surfaces"], "id", lambda k: k, numbers, labels)
    _label(tables["parts"], "name", lambda k: f"part{k}", words, labels)
    # A cell that no formula uses may stay without a name.
    _label(tables["cells"], "name", lambda k: f"cell{k}", words, labels, asked)

    def labelled(leaf: Leaf) -> Formula:
        named = _named(leaf)
        if not isinstance(named, Table):
            return leaf
        label = labels.get(id(named), getattr(named, "id" if isinstance(leaf, Sense) else "name"))
        if label is None:
            raise fault("a region names a cell that is not in the list of cells")
        return Sense(label, leaf.positive) if isinstance(leaf, Sense) else Name(label)

    for name, key in (("cells", "region"), ("places", "within")):
        for index, holder in enumerate(tables[name]):
            if any(isinstance(_named(leaf), Table) for leaf in _leaves(holder)):
                formula = with_leaves(getattr(holder, key), labelled)
                tables[name][index] = holder.model_copy(update={key: formula})
    return {**data, **{keys[name]: own for name, own in tables.items() if own}}


def _named(leaf: Leaf) -> object:
    return leaf.surface if isinstance(leaf, Sense) else leaf.of


def _leaves(holder: object) -> Iterator[Leaf]:
    """Leaves of the formula of a cell or place; none of a mapping."""
    if isinstance(holder, Table):
        formula = getattr(holder, "region", None) or getattr(holder, "within", None)
        if formula is not None:
            yield from leaves(formula)


def _groups(holder: object) -> Iterator[NamedGroup]:
    """Groups that a cell, place or lattice was given as objects."""
    if isinstance(holder, Table):
        names = [getattr(holder, "fill", None), getattr(holder, "group", None)]
        names += getattr(holder, "groups", {}).values()
        yield from (name.group for name in names if isinstance(name, Reference))


def _get(table: object, key: str) -> object:
    return table.get(key) if isinstance(table, Mapping) else getattr(table, key, None)


def _take_in(own: list[Any], key: str, found: Iterable[Any]) -> None:
    """Add the tables that are missing: neither they nor an equal of the same label is there."""
    there = {id(each) for each in own}
    known = {_get(each, key): each for each in own}
    for each in found:
        label = getattr(each, key)
        if id(each) not in there and (label is None or known.get(label) != each):
            own.append(each)
            known[label] = each
        there.add(id(each))


def _label(
    own: list[Any],
    key: str,
    label_of: Callable[[int], _Label],
    taken: set[Any],
    labels: dict[int, _Label],
    asked: set[int] | None = None,
) -> None:
    """Give each table without a label the next free one; with ``asked`` only to the asked."""
    free = (label for label in map(label_of, count(1)) if label not in taken)
    for index, each in enumerate(own):
        wanted = asked is None or id(each) in asked
        if wanted and isinstance(each, Table) and getattr(each, key) is None:
            labels[id(each)] = next(free)
            taken.add(labels[id(each)])
            own[index] = each.model_copy(update={key: labels[id(each)]})
