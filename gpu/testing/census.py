"""Two arrays compared row by row: how many rows differ, by how much, and which.

The distance of two floats is counted in units in the last place (ULP), as the number of steps from
one to the other through all numbers of their type. The two zeros are one step apart. Every NaN is
equal to every NaN.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from halfstep.contract.arrays import Array, Bools
from halfstep.device.compute import UNWRITTEN
from halfstep.errors import UsageError

# Rows that a census shows.
SHOWN = 5
# Elements that a census shows along each axis of an array.
SHOWN_ELEMENTS = 8


@dataclass(frozen=True)
class Tolerance:
    """Differences that do not count; by default two values must have the same bits.

    Attributes:
        ulp: largest distance of two floats in units in the last place.
        atol: abs(found - expected) may be ``atol``, and for floats ``rtol`` abs(expected) more.
        rtol: see ``atol``.
    """

    ulp: int = 0
    atol: float = 0.0
    rtol: float = 0.0

    def __post_init__(self) -> None:
        for name in ("ulp", "atol", "rtol"):
            value = getattr(self, name)
            if not (
                isinstance(value, int | float | np.number) and math.isfinite(value) and value >= 0
            ):
                raise UsageError(f"{name}: {value} is not a finite number >= 0")

    def __str__(self) -> str:
        stated = [f"{name}={value:g}" for name, value in vars(self).items() if value]
        return f"tolerance {', '.join(stated)}" if stated else "exact"


@dataclass(frozen=True)
class Row:
    """A row that differs.

    Attributes:
        index: number of the row.
        inputs: the inputs of the row by name.
        found, expected: the values of the members that differ, by name; "" is the whole result.
        distance: the distance in words, by the same names; "" for truth values.
        lead: the axes of rows, if there are several.
    """

    index: int
    inputs: dict[str, Any]
    found: dict[str, Any]
    expected: dict[str, Any]
    distance: dict[str, str]
    lead: tuple[int, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The row for JSON; `Census.as_dict` has the axes."""
        return {name: plain(value) for name, value in vars(self).items() if name != "lead"}


@dataclass(frozen=True)
class Census:
    """All differences of two arrays.

    Attributes:
        name: name of the function or array that was compared.
        tolerance: differences within it do not count.
        rows: number of rows.
        differing: number of rows that differ by more than the tolerance.
        ambiguous: number of differing rows within the margin of a decision.
        unwritten: number of differing rows that still hold the prefilled words.
        flushed: number of differing rows that are right if subnormal numbers are zeros.
        worst_ulp: the largest distance of two finite floats, in tolerance or not.
        worst_row: the row of ``worst_ulp``; None if no floats differ.
        histogram: distance in words -> number of values so far apart, in tolerance or not.
        members: number of rows that differ in each member of the result; "" is the whole result.
        first: the first rows that differ and are not ambiguous.
        stack: adapter, driver and versions of the device.
        lead: the axes of rows, if there are several.
        unit: noun for a row, as "pixel".
    """

    name: str
    tolerance: Tolerance
    rows: int
    differing: int = 0
    ambiguous: int = 0
    unwritten: int = 0
    flushed: int = 0
    worst_ulp: int = 0
    worst_row: int | None = None
    histogram: dict[str, int] = field(default_factory=dict)
    members: dict[str, int] = field(default_factory=dict)
    first: tuple[Row, ...] = ()
    stack: Mapping[str, str] = field(default_factory=dict)
    lead: tuple[int, ...] = ()
    unit: str = "row"

    @property
    def failed(self) -> int:
        """Number of rows that differ and have no excuse."""
        return self.differing - self.ambiguous - self.flushed

    def as_dict(self) -> dict[str, Any]:
        """The census for JSON. A number that is not finite is a string there."""
        return {
            "name": self.name,
            "tolerance": vars(self.tolerance),
            "rows": self.rows,
            "differing": self.differing,
            "ambiguous": self.ambiguous,
            "failed": self.failed,
            "unwritten": self.unwritten,
            "worst_ulp": self.worst_ulp,
            "worst_row": self.worst_row,
            "histogram": self.histogram,
            "members": self.members,
            "first": [row.as_dict() for row in self.first],
            "stack": dict(self.stack),
            # Only comparisons with flushed rows have this entry.
            **({"flushed": self.flushed} if self.flushed else {}),
            **({"lead": list(self.lead)} if len(self.lead) > 1 else {}),
        }

    def __str__(self) -> str:
        """The census for people."""
        of_rows = f"{self.differing} of {self.rows} {self.unit}s"
        lines = [f"{self.name}: {of_rows} differ ({self.tolerance})"]
        if self.ambiguous:
            lines.append(f"  {self.ambiguous} of them within the margin of a decision")
        if self.flushed:
            lines.append(f"  {self.flushed} of them right where subnormal numbers are zeros")
        if self.unwritten:
            lines.append(f"  {self.unwritten} of them never written")
        if self.worst_row is not None:
            lines.append(
                f"  worst: {self.worst_ulp} ulp in {self.unit} {_place(self.worst_row, self.lead)}"
            )
        lines += [f"  in {name}: {count}" for name, count in self.members.items() if name]
        if self.histogram:
            bins = ", ".join(f"{label}: {count}" for label, count in self.histogram.items())
            lines.append(f"  values by distance: {bins}")
        for row in self.first:
            lines += _row_lines(row, self.unit)
        if self.failed > len(self.first):
            lines.append(f"  and {self.failed - len(self.first)} more")
        if self.stack:
            lines.append(
                "  on {adapter}, {driver}, wgpu {wgpu}, wgpu-native {wgpu_native}".format(
                    **self.stack
                )
            )
        return "\n".join(lines)


class MismatchError(AssertionError):
    """Two arrays differ; its text is the census.

    Attributes:
        census: the differences.
    """

    def __init__(self, census: Census) -> None:
        super().__init__(str(census))
        self.census = census


def take(
    name: str,
    found: Array,
    expected: Array,
    tolerance: Tolerance,
    *,
    inputs: Mapping[str, Array],
    excused: Bools,
    stack: Mapping[str, str],
    member: str = "",
    lead: tuple[int, ...] = (),
    flushed: Sequence[Array] = (),
    unit: str = "row",
) -> Census:
    """The census of two arrays (rows, …) of the same type, which may be structured.

    Args:
        name: name of the function or array that is compared.
        found: values from the device.
        expected: the right values.
        tolerance: differences within it do not count.
        inputs: name -> (rows, …), shown with a row that differs.
        excused: (rows,), True where a row that differs is ambiguous.
        stack: adapter, driver and versions of the device.
        member: name of the member that the arrays are, if they are one of several.
        lead: the axes of rows, if there are several.
        flushed: values that are right too, for a device that flushes subnormal numbers to zero.
        unit: noun for a row, as "pixel".
    """
    rows = len(found)
    count = _counted(found, expected, tolerance, member)
    failing = count.differs & ~excused
    for other in flushed:
        if failing.any():
            failing &= _counted(found, other, tolerance, member).differs
    failed = np.flatnonzero(failing)
    return Census(
        name=name,
        tolerance=tolerance,
        rows=rows,
        differing=int(count.differs.sum()),
        ambiguous=int((count.differs & excused).sum()),
        flushed=int((count.differs & ~excused & ~failing).sum()),
        unwritten=int((count.differs & _unwritten(found)).sum()) if len(failed) else 0,
        worst_ulp=count.worst_ulp,
        worst_row=count.worst_row,
        histogram=_histogram(count.values),
        members=count.members,
        first=tuple(
            replace(_row(int(ix), found, expected, inputs, member), lead=lead)
            for ix in failed[:SHOWN]
        ),
        stack=stack,
        lead=lead,
        unit=unit,
    )


def differing(found: Array, expected: Array, tolerance: Tolerance) -> Bools:
    """Rows (rows,) of two arrays (rows, …) that differ."""
    return _counted(found, expected, tolerance, "").differs


def _counted(found: Array, expected: Array, tolerance: Tolerance, member: str) -> _Count:
    count = _Count(len(found), tolerance)
    pairs = zip(leaves(found, member), leaves(expected, member), strict=True)
    for (label, values), (_, others) in pairs:
        count.add(label, values.reshape(len(found), -1), others.reshape(len(found), -1))
    return count


def _place(row: int, lead: tuple[int, ...]) -> str:
    """The number of a row, or its index along each axis of rows."""
    if len(lead) < 2:
        return str(row)
    return f"[{', '.join(str(k) for k in np.unravel_index(row, lead))}]"


def joined(censuses: Sequence[Census]) -> Census:
    """One census for several, whose rows it adds up."""
    worst = max(censuses, key=lambda one: (one.worst_row is not None, one.worst_ulp))
    counts: Counter[str] = Counter()
    for one in censuses:
        counts.update(one.histogram)
    return replace(
        worst,
        rows=sum(one.rows for one in censuses),
        differing=sum(one.differing for one in censuses),
        ambiguous=sum(one.ambiguous for one in censuses),
        unwritten=sum(one.unwritten for one in censuses),
        flushed=sum(one.flushed for one in censuses),
        histogram=dict(counts),
        members={name: rows for one in censuses for name, rows in one.members.items()},
        first=tuple(row for one in censuses for row in one.first)[:SHOWN],
    )


def within(margin: ArrayLike | None, rows: int | tuple[int, ...]) -> Bools:
    """Rows (rows,) so close to their decisions that either answer is right.

    Args:
        margin: (rows,), the distance of each row from its decision, in units of the decision's
            largest rounding error; None if rows have no decision.
        rows: number of rows, or the numbers along each axis of rows.

    Raises:
        UsageError: the margin has another shape or type.
    """
    lead = (rows,) if isinstance(rows, int) else rows
    count = math.prod(lead)
    if margin is None:
        return np.zeros(count, bool)
    if isinstance(margin, np.ma.MaskedArray):
        raise UsageError("margin: a masked array; give its rows that are not masked")
    distance = np.asarray(margin)
    if distance.shape != lead or distance.dtype.kind not in "iuf":
        raise UsageError(
            f"margin: {distance.dtype} of shape {distance.shape}, not a number for each of "
            f"{' × '.join(map(str, lead))} rows"
        )
    return np.asarray(distance <= 1).reshape(count)


class _Count:
    """The differences in the members counted so far."""

    def __init__(self, rows: int, tolerance: Tolerance) -> None:
        self.differs: Bools = np.zeros(rows, bool)
        self.worst_ulp = 0
        self.worst_row: int | None = None
        self.members: dict[str, int] = {}
        self.values: list[Distance] = []
        self._tolerance = tolerance

    def add(self, member: str, found: Array, expected: Array) -> None:
        """Count a member's values, (rows, values) each."""
        row, column = np.nonzero(_unequal(found, expected))
        if not len(row):
            return
        values, others = found[row, column], expected[row, column]
        distance = Distance(values, others)
        beyond = ~_tolerated(values, others, distance, self._tolerance)
        wrong = np.unique(row[beyond])
        self.differs[wrong] = True
        self.values.append(distance)
        if len(wrong):
            self.members[member] = len(wrong)
        if distance.finite.any():
            ulps = np.where(distance.finite, distance.ulps, 0)
            if self.worst_row is None or int(ulps.max()) > self.worst_ulp:
                self.worst_ulp, self.worst_row = int(ulps.max()), int(row[ulps.argmax()])


class Distance:
    """The distances of pairs of numbers.

    Attributes:
        kind: NumPy's kind "f", "i", "u" or "b".
        ulps: uint64; units in the last place for floats, abs(found - expected) for other types.
        nan: True where either number is a NaN.
        finite: True where both numbers are finite floats.
    """

    def __init__(self, found: Array, expected: Array) -> None:
        self.kind = found.dtype.kind
        if self.kind != "f":
            self.nan = self.finite = np.zeros(found.shape, bool)
            low, high = np.minimum(found, expected), np.maximum(found, expected)
            # Wrapping is harmless: the difference of 64-bit integers is below 2^64.
            self.ulps = high.astype(np.uint64) - low.astype(np.uint64)
            return
        self.nan = np.isnan(found) | np.isnan(expected)
        self.finite = np.isfinite(found) & np.isfinite(expected)
        low, high = (pick(_ordinal(found), _ordinal(expected)) for pick in (np.minimum, np.maximum))
        self.ulps = high.astype(np.uint64) - low.astype(np.uint64)

    def words(self) -> list[str]:
        """The distance of each number for people."""
        return [
            self._word(ulps, nan, finite)
            for ulps, nan, finite in zip(
                self.ulps.tolist(), self.nan.tolist(), self.finite.tolist(), strict=True
            )
        ]

    def _word(self, ulps: int, nan: bool, finite: bool) -> str:
        if self.kind == "b":
            return ""
        if self.kind != "f":
            return f"by {ulps}"
        if nan:
            return "NaN"
        return f"{ulps} ulp" if finite else "infinite"


def leaves(values: Array, name: str = "") -> Iterator[tuple[str, Array]]:
    """The plain arrays in a structured array, by their names joined with dots."""
    if values.dtype.names is None:
        yield name, values
        return
    for member in values.dtype.names:
        yield from leaves(values[member], f"{name}.{member}" if name else member)


def _ordinal(values: Array) -> Array:
    """Floats as unsigned integers of the same order; from a float to the next it is one more."""
    bits = values.view(f"u{values.itemsize}")
    sign = bits.dtype.type(1 << (8 * values.itemsize - 1))
    return np.where(bits & sign, ~bits, bits | sign)


def _unequal(found: Array, expected: Array) -> Bools:
    if found.dtype.kind != "f":
        return found != expected
    bits = f"u{found.itemsize}"
    unequal = found.view(bits) != expected.view(bits)
    return unequal & ~(np.isnan(found) & np.isnan(expected)) if unequal.any() else unequal


def _tolerated(found: Array, expected: Array, distance: Distance, tolerance: Tolerance) -> Bools:
    """Whether unequal numbers are close enough; infinities and NaNs never are."""
    if distance.kind == "b":
        return np.zeros(found.shape, bool)
    if distance.kind != "f":
        return distance.ulps <= tolerance.atol
    close = distance.ulps <= tolerance.ulp
    if tolerance.atol or tolerance.rtol:
        with np.errstate(all="ignore"):
            off = np.abs(found.astype(np.float64) - expected.astype(np.float64))
            room = tolerance.atol + tolerance.rtol * np.abs(expected.astype(np.float64))
        close |= off <= room
    return distance.finite & close


def _unwritten(values: Array) -> Bools:
    """Rows in which every word is still the prefilled one."""
    rows = np.ones(len(values), bool)
    for _, leaf in leaves(values):
        words = leaf.reshape(len(values), -1)
        if words.dtype.kind == "b":
            continue
        if words.itemsize == 1 and words.shape[1] % 4 == 0:
            # A single byte may equal one of the four by chance.
            words = np.ascontiguousarray(words).view("<u4")
        bits = words.view(f"u{words.itemsize}")
        halves = {UNWRITTEN >> 16, UNWRITTEN & 0xFFFF}
        pattern = {2: halves, 4: {UNWRITTEN}, 8: {UNWRITTEN << 32 | UNWRITTEN}}
        rows &= np.isin(bits, list(pattern.get(words.itemsize, ()))).all(axis=1)
    return rows


def _histogram(distances: list[Distance]) -> dict[str, int]:
    """Numbers of values by distance: floats by powers of two of their units, then all others."""
    counts: dict[str, int] = {}
    ulps = [distance.ulps[distance.finite] for distance in distances]
    exponents = np.frexp(np.concatenate([*ulps, np.empty(0, np.uint64)]).astype(np.float64))[1] - 1
    for exponent, count in zip(*np.unique(exponents, return_counts=True), strict=True):
        counts[_bin(int(exponent))] = int(count)
    for distance in distances:
        others = {
            "NaN": distance.nan.sum(),
            "infinite": (~distance.nan & ~distance.finite).sum() if distance.kind == "f" else 0,
            "integers": distance.ulps.size if distance.kind in "iu" else 0,
            "bools": distance.ulps.size if distance.kind == "b" else 0,
        }
        for label, count in others.items():
            if count:
                counts[label] = counts.get(label, 0) + int(count)
    return counts


def _bin(exponent: int) -> str:
    if exponent == 0:
        return "1 ulp"
    if exponent < 10:
        return f"{1 << exponent}…{(2 << exponent) - 1} ulp"
    return f"2^{exponent}… ulp"


def _row(index: int, found: Array, expected: Array, inputs: Mapping[str, Array], part: str) -> Row:
    shown = Row(index, {}, {}, {}, {})
    for name, values in inputs.items():
        shown.inputs.update({n: v[0] for n, v in leaves(values[index : index + 1], name)})
    here = slice(index, index + 1)
    for (member, value), (_, other) in zip(
        leaves(found[here], part), leaves(expected[here], part), strict=True
    ):
        unequal = _unequal(value, other)
        if unequal.any():
            shown.found[member], shown.expected[member] = value[0], other[0]
            distance = Distance(value[unequal], other[unequal])
            words = distance.words()
            shown.distance[member] = words[int(distance.ulps.argmax())]
    return shown


def _row_lines(row: Row, unit: str) -> list[str]:
    inputs = ", ".join(f"{name} = {as_text(value)}" for name, value in row.inputs.items())
    lines = [f"  {unit} {_place(row.index, row.lead)}{': ' if inputs else ''}{inputs}"]
    for member, value in row.found.items():
        label = f" {member}" if member else ""
        distance = f" ({row.distance[member]})" if row.distance[member] else ""
        lines += [
            f"    found{label} {as_text(value)}",
            f"    expected{label} {as_text(row.expected[member])}{distance}",
        ]
    return lines


def as_text(value: Any) -> str:
    """A value of one row, with enough digits to tell it from any other of its type."""
    array = np.asarray(value)
    if array.ndim == 0:
        return str(array[()])
    parts = ", ".join(map(as_text, array[:SHOWN_ELEMENTS]))
    more = f", … {len(array)} in all" if len(array) > SHOWN_ELEMENTS else ""
    return f"[{parts}{more}]"


def plain(value: Any) -> Any:
    """``value`` in types that JSON has."""
    if isinstance(value, Mapping):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
