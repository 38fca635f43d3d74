"""Chooses which cells of an OpenMC geometry are shown, and their colours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from halfstep.errors import UsageError
from halfstep.models.look import PLACE, Look, Table
from halfstep.models.openmc import Cell, Geometry
from halfstep.models.openmc_plots import WHITE, Plot
from halfstep.scene.faults import hint, show
from halfstep.scene.hues import colors_of

VOID = "void"


@dataclass
class _Named:
    """The materials and cells that names of the command line stand for.

    Attributes:
        materials: numbers of materials, None for void.
        cells: numbers of cells.
    """

    materials: set[int | None] = field(default_factory=set)
    cells: set[int] = field(default_factory=set)


class Shown:
    """Decides which cells of a geometry are shown, and their materials.

    Attributes:
        materials: tables of the materials that `finish` has used so far.
    """

    def __init__(self, geometry: Geometry, look: Look, plot: Plot | None) -> None:
        self._geometry, self._plot = geometry, plot
        self._color_by = look.color_by or ("material" if plot is None else plot.color_by)
        if self._color_by == PLACE:
            # The scene replaces the colours of materials.
            self._color_by = "material"
        # A plot's colours apply only to the kind of number that it colours by.
        of_plot = plot if plot is not None and self._color_by == plot.color_by else None
        self._colors = {} if of_plot is None else of_plot.colors
        self._mask = None if of_plot is None else of_plot.mask
        self._hidden = self._named("--hide", look.hide)
        self._only = self._named("--only", look.only) if look.only else None
        materials = {material for cell in geometry.cells for material in cell.materials}
        # In a model without materials, only void can be seen.
        self._is_void_seen = materials == {None} or (plot is not None and plot.shows_void)
        self._tables: dict[str, Table] = {}
        self._titles: dict[int, str] = {}
        given = list(geometry.materials.values())
        for number in sorted(materials - {None}, key=lambda each: each or 0):
            assert number is not None
            name = geometry.materials.get(number, "")
            own = f"material {number}"
            self._titles[number] = f"{name} ({number})" if given.count(name) > 1 else name or own

    @property
    def materials(self) -> list[Table]:
        """The tables of the materials that `finish` has used so far."""
        return [*self._tables.values()]

    def is_hidden(self, cell: Cell) -> bool:
        """Whether a cell is hidden with everything inside it."""
        return cell.id in self._hidden.cells

    def is_chosen(self, cell: Cell) -> bool:
        """Whether `--only` names a cell."""
        return self._only is not None and cell.id in self._only.cells

    def is_seen(self, cell: Cell, material: int | None, *, chosen: bool) -> bool:
        """Whether an unfilled cell is shown; ``chosen``: `--only` names a cell around it."""
        if self.is_hidden(cell) or material in self._hidden.materials:
            return False
        if self._only is not None:
            if self.is_chosen(cell) or material in self._only.materials:
                return True
            if not chosen:
                return False
        if self._plot is not None and self._plot.opaque is not None:
            number = cell.id if self._plot.color_by == "cell" else material
            return number in self._plot.opaque
        return material is not None or self._is_void_seen

    def finish(self, cell: Cell, material: int | None) -> Table:
        """The keys of a cell's table for its material or colour."""
        numbers = {"material": material, "cell": cell.id, "group": cell.universe}
        number = numbers[self._color_by]
        if material is None:
            if number is None and self._plot is not None and self._plot.shows_void:
                return {"color": WHITE}
            return {"color": self._color(cell.id if number is None else number)}
        name = self._titles[material]
        if self._color_by != "material":
            what = "universe" if self._color_by == "group" else self._color_by
            name += f" of {what} {number}"
        if name not in self._tables:
            assert number is not None
            table: Table = {"name": name, "id": material, "color": self._color(number)}
            self._tables[name] = table
        return {"material": name}

    def _color(self, number: int) -> list[float]:
        if self._mask is not None and number not in self._mask.components:
            return self._mask.color
        return self._colors.get(number) or colors_of([number])[0].tolist()

    def _named(self, option: str, names: Iterable[str]) -> _Named:
        """The materials and cells that names stand for.

        Raises:
            UsageError: a name is unknown.
        """
        geometry, found = self._geometry, _Named()
        numbers = {str(cell.id): cell.id for cell in geometry.cells}
        materials = {material for cell in geometry.cells for material in cell.materials}
        for name in names:
            kind, colon, number = name.partition(":")
            if name == VOID:
                found.materials.add(None)
            elif colon and kind == "material" and number.isdecimal() and int(number) in materials:
                found.materials.add(int(number))
            elif colon and kind == "cell" and number in numbers:
                found.cells.add(numbers[number])
            else:
                own = {each for each, text in geometry.materials.items() if text == name}
                cells = {cell.id for cell in geometry.cells if cell.name == name}
                if not own and not cells:
                    known = {*geometry.materials.values(), *(cell.name for cell in geometry.cells)}
                    kinds = "void, material:4 and cell:7 are names, and those of the file"
                    help_ = hint(name, sorted(known - {""}), f"{kinds}:")
                    raise UsageError(f"{option}: {show(name)} is not in {geometry.name}; {help_}")
                found.materials |= own
                found.cells |= cells
        return found
