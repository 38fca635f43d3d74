"""Checks the numbers and names of a scene: each is given once, and each name used is defined.

A scene with other faults is checked as well, so that no fault hides another. A value of the wrong
type is skipped here, because its own table reports it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter

from pydantic import BaseModel

from halfstep.scene.faults import Fault, Loc, hint, line, show
from halfstep.scene.formula import (
    MAX_LEVELS,
    WORD,
    Formula,
    Leaf,
    Sense,
    fault_at,
    leaves,
    parse,
)


def name_faults(scene: object) -> list[Fault]:
    """Faults of numbers and names: given twice, missing, undefined; groups inside themselves.

    Args:
        scene: a `Scene`, or the mapping that a file holds, which may be faulty anywhere.
    """
    materials = _Materials(scene)
    faults = [*_twice("name", [(("material",), _tables(scene, "material"))])]
    solids = _tables(scene, "solid")
    of_solids = [*_twice("name", [(("solid",), solids)])]
    for index, solid in enumerate(solids):
        of_solids += materials.faults(solid, ("solid", index))
        if _is_table(solid) and get(solid, "material") is None and get(solid, "color") is None:
            text = "has neither material nor color; one must be given"
            of_solids.append((("solid", index), text))
    faults += sorted(of_solids, key=lambda fault: fault[0][1])
    root = _Group(scene, (), None)
    for group in root.all():
        faults += group.faults(materials)
    return [*faults, *_chains(root)]


class _Materials:
    """The names of a scene's materials."""

    def __init__(self, scene: object) -> None:
        given, tables = get(scene, "material"), _tables(scene, "material")
        self._names = {name for each in tables if (name := _word(each, "name"))}
        # A material without a name may be the one that another table means.
        self._all_named = given is None or (
            isinstance(given, list | tuple) and all(_word(each, "name") for each in tables)
        )

    def faults(self, table: object, loc: Loc) -> Iterator[Fault]:
        """The fault of a table whose material is not defined."""
        name = _word(table, "material")
        if name and self._all_named and name not in self._names:
            known = hint(name, sorted(self._names), "the scene has")
            yield (*loc, "material"), f"{show(name)} is not a material of the scene; {known}"


class _Group:
    """A scene or group where it is defined. Its position decides what the names in it mean."""

    def __init__(self, table: object, loc: Loc, around: _Group | None) -> None:
        self.table, self.loc, self._around = table, loc, around
        self.level: int = 0 if around is None else around.level + 1
        tables = _tables(table, "group") if self.level <= MAX_LEVELS else []
        self._inside = [
            _Group(each, (*loc, "group", index), self) for index, each in enumerate(tables)
        ]
        self._named: dict[str, _Group] = {}
        for group in self._inside:
            if name := _word(group.table, "name"):
                self._named.setdefault(name, group)

    def all(self) -> Iterator[_Group]:
        """The group itself, and all groups defined in it."""
        yield self
        for group in self._inside:
            yield from group.all()

    def named(self, name: str) -> _Group | None:
        """The group of a name: defined in this group, or else in a group around it."""
        found = self._named.get(name)
        return found if found or self._around is None else self._around.named(name)

    def placed(self) -> Iterator[tuple[Loc, str]]:
        """The group names in its tables, each with its path."""
        for index, place in enumerate(_tables(self.table, "place")):
            if name := _word(place, "group"):
                yield (*self.loc, "place", index, "group"), name
        for index, lattice in enumerate(_tables(self.table, "lattice")):
            if name := _word(lattice, "group"):
                yield (*self.loc, "lattice", index, "group"), name
            letters = get(lattice, "groups")
            for letter, name in letters.items() if isinstance(letters, Mapping) else ():
                if isinstance(name, str) and name:
                    yield (*self.loc, "lattice", index, "groups", str(letter)), name
        for index, cell in enumerate(_tables(self.table, "cell")):
            if name := _word(cell, "fill"):
                yield (*self.loc, "cell", index, "fill"), name

    def faults(self, materials: _Materials) -> Iterator[Fault]:
        """All faults of its numbers and names except cycles."""
        if self.level > MAX_LEVELS:
            yield self.loc, f"lies in more than {MAX_LEVELS} groups"
            return
        surfaces, parts, cells = (_tables(self.table, key) for key in ("surface", "part", "cell"))
        yield from _twice("id", [((*self.loc, "surface"), surfaces)])
        for index, surface in enumerate(surfaces):
            if _is_table(surface) and get(surface, "id") is None:
                yield (*self.loc, "surface", index, "id"), "missing"
        yield from _twice("name", [((*self.loc, "part"), parts), ((*self.loc, "cell"), cells)])
        for index, part in enumerate(parts):
            loc: Loc = (*self.loc, "part", index)
            yield from materials.faults(part, loc)
            name = get(part, "name")
            if _is_table(part) and name is None:
                yield (*loc, "name"), "missing"
            elif isinstance(name, str) and name and not WORD.fullmatch(name):
                rule = "a letter or _, then letters, digits and _"
                yield (*loc, "name"), f"{show(name)} is not a word, as formulas have it: {rule}"
        yield from self._faults_of_cells(materials)
        yield from _twice("name", [((*self.loc, "group"), [each.table for each in self._inside])])
        for index, place in enumerate(_tables(self.table, "place")):
            yield from self._formula_faults(place, (*self.loc, "place", index, "within"))
        for loc, name in self.placed():
            if self.named(name) is None:
                known = hint(name, self.names(), "those that may be named here are")
                yield loc, f"{show(name)} is not a group; {known}"

    def names(self) -> list[str]:
        return [*self._named, *(self._around.names() if self._around else ())]

    def _faults_of_cells(self, materials: _Materials) -> Iterator[Fault]:
        # Two groups that are variants of each other may have cells of the same id.
        yield from _twice("id", [((*self.loc, "cell"), _tables(self.table, "cell"))])
        for index, cell in enumerate(_tables(self.table, "cell")):
            loc: Loc = (*self.loc, "cell", index)
            yield from materials.faults(cell, loc)
            yield from self._formula_faults(cell, (*loc, "region"), before=index)

    @functools.cached_property
    def _ids(self) -> set[int | None]:
        return {_integer(each, "id") for each in _tables(self.table, "surface")}

    @functools.cached_property
    def _words(self) -> dict[str, int]:
        """The names for formulas, with the index of a cell, or -1 for a part."""
        cells = enumerate(_tables(self.table, "cell"))
        words = {name: index for index, cell in cells if (name := _word(cell, "name"))}
        parts = _tables(self.table, "part")
        return words | {name: -1 for part in parts if (name := _word(part, "name"))}

    def _formula_faults(
        self, holder: object, loc: Loc, before: int | None = None
    ) -> Iterator[Fault]:
        """Faults of the names in a formula: undefined, or of a cell that is not ``before`` it."""
        given = get(holder, str(loc[-1]))
        try:
            if isinstance(given, Formula) and not any(
                self._fault_of(leaf, before) for leaf in leaves(given)
            ):
                return
            # Columns count in the text that the message shows.
            text = str(given)
            formula = parse(text) if isinstance(given, str | Formula) else None
        except ValueError:
            return
        for leaf in leaves(formula) if formula is not None else ():
            if what := self._fault_of(leaf, before):
                yield loc, fault_at(text, leaf.column, what)

    def _fault_of(self, leaf: Leaf, before: int | None) -> str | None:
        """What is wrong with a name in a formula; None if nothing is."""
        if isinstance(leaf, Sense):
            if leaf.surface in self._ids:
                return None
            ids = sorted(each for each in self._ids if each is not None)
            there = ", ".join(map(str, ids[:10])) + ", …" * (len(ids) > 10)
            return f"there is no surface {leaf.surface} here; there are {there or 'none'}"
        name = str(leaf.of)
        if name not in self._words:
            known = hint(name, self._words, "there are")
            return f"{show(name)} is neither a part nor a cell here; {known}"
        if before is not None and self._words[name] >= before:
            return f"{show(name)} is no cell before this one"
        return None


def _chains(root: _Group) -> Iterator[Fault]:
    """Faults of groups that contain themselves, one for each cycle; or of groups too deep."""
    ways: dict[int, dict[int, Loc]] = {}
    groups = {id(group): group for group in root.all()}
    for key, group in groups.items():
        ways[key] = {}
        for loc, name in group.placed():
            if (target := group.named(name)) is not None:
                ways[key].setdefault(id(target), loc)
    while True:
        try:
            TopologicalSorter({key: [*targets] for key, targets in ways.items()}).prepare()
        except CycleError as error:
            # `CycleError` lists each group after a group that it contains.
            cycle = [*reversed(error.args[1])]
            names = " → ".join(str(get(groups[key].table, "name")) for key in cycle)
            yield ways[cycle[0]].pop(cycle[1]), f"leads a group into itself: {names}"
        else:
            break
    level: dict[int, int] = {}
    for key in TopologicalSorter({key: [*targets] for key, targets in ways.items()}).static_order():
        level[key] = 1 + max((level[each] for each in ways[key]), default=-1)
    if level[id(root)] > MAX_LEVELS:
        yield (), f"{level[id(root)]} groups lie in one another, which is not <= {MAX_LEVELS}"


def _twice(key: str, lists: Iterable[tuple[Loc, list[object]]]) -> Iterator[Fault]:
    """Values of a key that several tables have."""
    first: dict[object, Loc] = {}
    for loc, tables in lists:
        for index, table in enumerate(tables):
            value = _word(table, key) or _integer(table, key)
            own: Loc = (*loc, index)
            if value is not None and first.setdefault(value, own) != own:
                text = f"{show(value)} is already the {key} of {line('', first[value], '')}"
                yield (*own, key), text


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping | BaseModel)


def get(table: object, key: str) -> object:
    """The value of a key of a table, which is a mapping or a `Table`; None if it is missing."""
    if type(table) is dict or isinstance(table, Mapping):
        # From Python, an array of tables may have the name of its attribute.
        return table[key] if key in table else table.get(f"{key}s")
    if isinstance(table, BaseModel):
        fields = type(table).model_fields
        name = next((name for name, field in fields.items() if field.alias == key), key)
        return getattr(table, name, None)
    return None


def _tables(table: object, key: str) -> list[object]:
    tables = get(table, key)
    return list(tables) if isinstance(tables, list | tuple) else []


def _word(table: object, key: str) -> str:
    """The value of a key if it is a string; else an empty string."""
    value = get(table, key)
    return value if isinstance(value, str) else ""


def _integer(table: object, key: str) -> int | None:
    value = get(table, key)
    return value if isinstance(value, int) and not isinstance(value, bool) else None
