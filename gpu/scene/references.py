"""Names of groups and formulas, as values of the keys of tables."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import PlainSerializer, PlainValidator, WithJsonSchema

from halfstep.scene.faults import fault, show
from halfstep.scene.formula import MAX_FORMULA_BYTES, Formula, as_formula
from halfstep.scene.values import Name, Table


class NamedGroup(Table):
    """A group, as the tables that place it see it: it has a name."""

    name: Name


class Reference(str):
    """The name of a group that was given as an object.

    Attributes:
        group: the object, which the scene or group that uses the name adds to its own.
    """

    group: NamedGroup

    @classmethod
    def to(cls, group: NamedGroup) -> Reference:
        """The reference to a group."""
        reference = cls(group.name)
        reference.group = group
        return reference


def _group_name(value: Any) -> str:
    if isinstance(value, NamedGroup):
        return Reference.to(value)
    if not isinstance(value, str):
        raise fault(f"{show(value)} is not a string")
    if not value:
        raise fault('"" is empty')
    return value


def _to_formula(value: Any) -> Formula:
    try:
        return as_formula(value)
    except ValueError as error:
        raise fault(str(error)) from None


GroupName = Annotated[
    str, PlainValidator(_group_name), WithJsonSchema({"type": "string", "minLength": 1})
]
RegionFormula = Annotated[
    Formula,
    PlainValidator(_to_formula),
    PlainSerializer(str, return_type=str),
    WithJsonSchema({"type": "string", "minLength": 1, "maxLength": MAX_FORMULA_BYTES}),
]
