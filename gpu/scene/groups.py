"""Cells, and the groups that hold them: fragments of a scene that may be placed many times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from halfstep.scene.faults import TABLE_FAULT, fault
from halfstep.scene.formula import MAX_ID, Operand
from halfstep.scene.functions import Function, Names, functions_of
from halfstep.scene.gathering import with_what_is_named
from halfstep.scene.keys import SolidKey, are_in_order
from halfstep.scene.lattices import AnyLattice
from halfstep.scene.references import GroupName, NamedGroup, RegionFormula
from halfstep.scene.shapes import Named, Placed, check_turns
from halfstep.scene.solids import AnyPart
from halfstep.scene.surfaces import AnySurface
from halfstep.scene.values import Color, Name, Sequence, Table, check_at_most_one

CellId = Annotated[int, Field(ge=0, le=MAX_ID)]


class Cell(Named, Operand):
    """A region with a material, or with copies of a group in it.

    Attributes:
        id: number in the output ``cell``; by default its position among all cells, from 1.
        region: a formula over the surfaces, the parts and the earlier cells of its group; by
            default everywhere. Where two visible cells overlap, the earlier one is seen.
        visible: whether it is shown; an invisible cell hides nothing.
        casts_shadow: whether it hides lights that have shadows.
        fill: the group that is seen inside the region.
    """

    positional: ClassVar[tuple[str, ...]] = ("name", "region")

    if TYPE_CHECKING:

        def __init__(
            self, name: str | None = None, region: Operand | str | None = None, **keys: Any
        ) -> None: ...

    id: CellId | None = None
    region: RegionFormula | None = None
    material: Name | None = None
    color: Color | None = None
    visible: bool = True
    casts_shadow: bool = True
    fill: GroupName | None = None

    @field_validator("fill")
    @classmethod
    def _one_content(cls, fill: str | None, info: ValidationInfo) -> str | None:
        if fill is not None and not info.data.get("casts_shadow", True):
            raise fault(
                "casts_shadow = false stands beside fill; the cells of that group have their own",
                TABLE_FAULT,
            )
        if {"material", "color", "visible"} <= info.data.keys():
            finish = {key: info.data[key] for key in ("material", "color")}
            check_at_most_one(**finish, fill=fill)
            if info.data["visible"] and fill is None and not any(finish.values()):
                raise fault(
                    "has none of material, color, fill; one must be given, or visible = false",
                    TABLE_FAULT,
                )
        return fill

    @property
    def title(self) -> str:
        """Its name, for people."""
        known = ("cell", "" if self.id is None else str(self.id), self.name or "")
        return " ".join(filter(None, known))

    @property
    def is_shown(self) -> bool:
        """Whether the cell itself is seen: it is visible, and no group fills it."""
        return self.visible and self.fill is None


class Place(Placed):
    """One copy of a group.

    Attributes:
        group: its name.
        within: a region of the scene or group that holds the place; the copy is seen only inside.
        keyframes: its positions at times of the animation.
    """

    positional: ClassVar[tuple[str, ...]] = ("group",)

    if TYPE_CHECKING:

        def __init__(self, group: Group | str, **keys: Any) -> None: ...

    group: GroupName
    within: RegionFormula | None = None
    keyframes: Annotated[Sequence[SolidKey], AfterValidator(are_in_order)] = Field(
        default=(), alias="key"
    )

    @field_validator("keyframes")
    @classmethod
    def _turn_from_angles(
        cls, keyframes: tuple[SolidKey, ...], info: ValidationInfo
    ) -> tuple[SolidKey, ...]:
        return check_turns(keyframes, info.data.get("axis"), "place")


class Fragment(Table):
    """The tables that a scene and a group both hold.

    From Python, the surfaces, parts and groups that its cells, places and lattices use need not be
    listed. They are added, and those without a number or a name get one.
    """

    surfaces: Sequence[AnySurface] = Field(default=(), alias="surface")
    parts: Sequence[AnyPart] = Field(default=(), alias="part")
    cells: Sequence[Cell] = Field(default=(), alias="cell")
    groups: Sequence[Group] = Field(default=(), alias="group")
    places: Sequence[Place] = Field(default=(), alias="place")
    lattices: Sequence[AnyLattice] = Field(default=(), alias="lattice")

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, data: Any) -> Any:
        return with_what_is_named(data) if isinstance(data, Mapping) else data

    def functions(self) -> tuple[Function, ...]:
        """All functions F: those of the surfaces, then of the parts, in the file's order."""
        return functions_of(self.surfaces, self.parts)

    def names(self) -> Names:
        """The meaning of the numbers and words in its formulas, and the regions of its cells."""
        cells = [(cell.name, cell.region) for cell in self.cells]
        return Names(self.surfaces, self.parts, cells)


class Group(Fragment, NamedGroup):
    """A named fragment of a scene, seen where a place, a lattice or a cell puts it."""

    positional: ClassVar[tuple[str, ...]] = ("name",)

    if TYPE_CHECKING:

        def __init__(self, name: str, **tables: Any) -> None: ...


Fragment.model_rebuild()
