"""Twin of ``visit_polynomial.wgsl``: a solid that a polynomial or a formula bounds.

What is certain.  The piece of a ray begins and ends at half-spaces, so each end is known to a
slack.  The sign of F at an end is certain if F exceeds its error by more than it can change within
the slack.  If the sign at the beginning is certain, the ray shows the half-space there, or the
first root behind it.  A root is certain if it surely lies before the end, a miss if F is surely
positive at the end.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from halfstep.contract.expressions import PackedExpressions
from halfstep.contract.polynomials import PackedPolynomials
from halfstep.contract.powers import MADE, MADE_OF_FORMULA
from halfstep.twin.algebraic import (
    BEYOND,
    Cap,
    Chord,
    chord_of,
    finished,
    first_place,
    last_place,
    later_slack,
    line_place,
    line_slack,
    outline_of,
    world_slope,
)
from halfstep.twin.cells import Cell, bound_in, cells_about, cells_from, walked
from halfstep.twin.certify import (
    NO_CERTIFICATE,
    UNBOUNDED,
    Certificate,
    bounded_clip,
    bounded_form,
    bounded_from_the_eye,
    bounded_interval,
    curve_bound,
    line_bound,
    surely_ordered,
)
from halfstep.twin.chosen import Chosen
from halfstep.twin.expression import (
    Formula,
    Surety,
    expression_value,
    finished_formula,
    formula_of,
    slope_of_formula,
    surety_of,
    trace_of,
    walked_formula,
)
from halfstep.twin.lanes import F32, I32, U32, Bools, Form, FormErrors
from halfstep.twin.normal import NO_VECTOR, Vector, either, turned
from halfstep.twin.piece import clip, from_the_eye, remains, whole_interval
from halfstep.twin.sight import Seen, Sight
from halfstep.twin.solid import (
    eye_inside,
    eye_outside,
    eye_sure,
    near_cut,
    normal_of,
    other_side,
    slope_at,
    starts_at_eye,
)
from halfstep.twin.taylor import (
    Curve,
    curve_error,
    curve_value,
    on_rays,
    opposite,
    sizes_on_rays,
    slope_at_most,
    slopes_on_rays,
)


class _Polynomial:
    """A polynomial F on rays; in the pixels ``turned`` the answers are for -F."""

    made = MADE

    def __init__(self, form: np.void, right: F32, down: F32) -> None:
        self._form, self._right, self._down = form, right, down
        self._curve = Curve(
            on_rays(form["terms"], right, down),
            sizes_on_rays(form["terms"], right, down),
            form["middle"],
            form["rounding"],
            form["host_error"],
        )

    def value(self, u: F32) -> F32:
        return curve_value(self._curve, u)

    def walked(self, turned: Bools, *along: Any) -> Cell:
        return walked(opposite(turned, self._curve), *along)

    def finished(self, turned: Bools, *along: Any) -> I32:
        return finished(opposite(turned, self._curve), *along)

    def surety(
        self,
        begins_below: Bools,
        turned: Bools,
        start: F32,
        start_slack: F32,
        stop: F32,
        stop_slack: F32,
        *along: Any,
    ) -> Surety:
        return Surety(
            self._is_above(begins_below, start, start_slack, stop),
            self._is_above(turned, stop, stop_slack, start),
            bound_in(opposite(turned, self._curve), start, stop, *along),
        )

    def _is_above(self, turned: Bools, u: F32, slack: F32, other_end: F32) -> Bools:
        """Whether F is surely above 0 at an end of the piece, known to a slack."""
        curve = self._curve
        off, other = np.abs(u - curve.middle), np.abs(other_end - curve.middle)
        slope = slope_at_most(curve.sizes, np.maximum(off, other))
        value = curve_value(opposite(turned, curve), u)
        return value > curve_error(curve, off) + slack * slope

    def slope(self, u: F32) -> Vector:
        """The gradient up to its length."""
        form, right, down = self._form, self._right, self._down
        v = u - self._curve.middle
        slopes = slopes_on_rays(form["terms"], self._curve.powers, right, down, v)
        return world_slope(form, right, down, v, slopes)


class _Formula:
    """A formula F on rays; in the pixels ``turned`` the answers are for -F."""

    made = MADE_OF_FORMULA

    def __init__(self, formula: Formula, right: F32, down: F32) -> None:
        self._formula, self._trace = formula, trace_of(formula.form, right, down)

    def value(self, u: F32) -> F32:
        return expression_value(self._formula, self._trace, u)

    def walked(self, turned: Bools, *along: Any) -> Cell:
        return walked_formula(self._formula, self._trace, turned, *along)

    def finished(self, turned: Bools, *along: Any) -> I32:
        return finished_formula(self._formula, self._trace, turned, *along)

    def surety(self, begins_below: Bools, turned: Bools, *along: Any) -> Surety:
        return surety_of(self._formula, self._trace, begins_below, turned, *along)

    def slope(self, u: F32) -> Vector:
        return slope_of_formula(self._formula, self._trace, u)


def visit_polynomial(
    solid: np.void,
    rest: PackedPolynomials | PackedExpressions,
    x: I32,
    y: I32,
    member: U32,
    chosen: Chosen,
    facts: Collection[str],
) -> Seen:
    """What rays see of a solid: clip, walk through cells, halve.

    ``member`` has the members of the lists of the pixels' tiles.
    """
    form = rest.records[int(solid["polynomial"])]
    near_u, far_u = solid["near_u"], solid["far_u"]
    steps, last_step = int(solid["steps"]), solid["last_step"]
    at = chosen.offset(x, y)
    like = x + 0 * y
    piece = whole_interval(like, near_u, far_u)
    ends = bounded_interval(like, near_u, far_u, near_cut(solid))
    normal_in = normal_out = NO_VECTOR
    for k in range(int(solid["plane_count"])):
        half_space = rest.half_spaces[int(solid["plane_start"]) + k]
        number = k + 1
        line = chosen.forms.line_at(half_space["c"], half_space["b"], at)
        piece = clip(piece, line, number)
        if "error" in facts:
            errors = chosen.forms.line_errors(
                half_space["c"], half_space["b"], at, half_space["host_error"]
            )
            ends = bounded_clip(ends, line, errors, number)
        if "normal" in facts:
            normal_in = either(piece.id_in == number, normal_of(half_space), normal_in)
            normal_out = either(piece.id_out == number, normal_of(half_space), normal_out)
    if eye_inside(solid):
        piece = from_the_eye(piece, near_u)
        ends = bounded_from_the_eye(ends, near_u)

    outline = outline_of(form)
    right = x.astype(np.float32) * outline.scale
    down = y.astype(np.float32) * outline.scale
    right, down = right + 0 * down, down + 0 * right
    of_f: _Polynomial | _Formula
    if isinstance(rest, PackedExpressions):
        of_f = _Formula(formula_of(rest, int(solid["polynomial"])), right, down)
    else:
        of_f = _Polynomial(form, right, down)
    start, stop = line_place(piece.c_in, piece.b_in), line_place(piece.c_out, piece.b_out)
    id_in, id_out, some = piece.id_in, piece.id_out, remains(piece)
    plane_start, plane_stop = start, stop
    never = np.zeros(like.shape, bool)
    enters = leaves = is_ball = never
    ball: Form | None = None
    ball_errors: FormErrors | None = None
    chord: Chord | None = None
    if "ball" in facts:
        of_ball = np.int32(outline.ball)
        is_ball = never | (of_ball != 0)
        a, g, c = solid["a"], solid["g"], solid["c"]
        ball = chosen.forms.form_at(a, g, c, at)
        ball_errors = chosen.forms.form_errors(a, g, c, at, solid["host_error"])
        chord = chord_of(ball.a, ball.g, ball.c, ball_errors.a, ball_errors.g, ball_errors.c)
        enters = is_ball & (chord.enter > start) & (not eye_inside(solid))
        leaves = is_ball & (chord.leave < stop)
        start, stop = np.where(enters, chord.enter, start), np.where(leaves, chord.leave, stop)
        id_in, id_out = np.where(enters, of_ball, id_in), np.where(leaves, of_ball, id_out)
        some = some & (~is_ball | (chord.met & (start <= stop)))

    is_sheet = bool(outline.sheet)
    first = of_f.value(start)
    at_start = id_in == 0
    from_eye = at_start & starts_at_eye(solid)
    outside = np.where(from_eye, eye_outside(solid), first > 0)
    inside = ~outside & (is_sheet | (at_start & (eye_inside(solid) | near_cut(solid))))
    on_entry = ~outside & ~inside & ~at_start
    within = (outline.left <= x) & (x <= outline.right)
    within = within & ((outline.top <= y) & (y <= outline.bottom))
    some = some & within
    # F may be 0 only here.
    begin, end = np.maximum(start, first_place(member)), np.minimum(stop, last_place(member))
    cell = cells_about(begin, some & ~on_entry & (begin < end), of_f.made, steps)
    cell = of_f.walked(inside, begin, end, cell, steps, last_step)
    on_exit = inside & ~cell.met & (id_out > 0) & (not is_sheet)
    c_cap = np.where(on_entry, piece.c_in, -piece.c_out)
    b_cap = np.where(on_entry, piece.b_in, -piece.b_out)
    a_cap = np.zeros_like(c_cap)
    cap_start, cap_stop = a_cap - BEYOND, a_cap + BEYOND
    if ball is not None and chord is not None:
        on_ball = np.where(on_entry, enters, leaves)
        c_cap = np.where(on_ball, np.where(on_entry, ball.c, -ball.c), c_cap)
        b_cap = np.where(on_ball, np.where(on_entry, ball.g, -ball.g), b_cap)
        a_cap = np.where(on_ball, np.where(on_entry, ball.a, -ball.a), a_cap)
        cap_start = np.where(on_ball & ~on_entry, chord.middle, cap_start)
        cap_stop = np.where(on_ball & on_entry, chord.middle, cap_stop)
    cap = Cap(on_entry | on_exit, c_cap, b_cap, a_cap, cap_start, cap_stop)
    position = of_f.finished(inside, begin, end, cell, cap, steps, last_step)
    hit = some & (cell.met | on_entry | on_exit)
    surface = np.where(on_entry, id_in, np.where(on_exit, id_out, 0))
    left, exit_position = hit, position
    if "exit" in facts:
        stays = inside | is_sheet
        behind = (position + np.int32(1 << steps)) >> np.int32(1)
        behind = np.where(cell.met, behind + np.int32(1), np.int32(0))
        last = cells_from(behind, hit & ~stays, steps)
        last = of_f.walked(~inside, begin, end, last, steps, last_step)
        c_out, b_out = -piece.c_out, -piece.b_out
        a_out = np.zeros_like(c_out)
        out_start = a_out - BEYOND
        if ball is not None and chord is not None:
            c_out, b_out = np.where(leaves, -ball.c, c_out), np.where(leaves, -ball.g, b_out)
            a_out = np.where(leaves, -ball.a, a_out)
            out_start = np.where(leaves, chord.middle, out_start)
        out_stop = np.zeros_like(c_out) + BEYOND
        out = Cap(hit & ~stays & (id_out > 0), c_out, b_out, a_out, out_start, out_stop)
        exit_position = of_f.finished(~inside, begin, end, last, out, steps, last_step)
        exit_position = np.where(stays, position, exit_position)
        left = np.where(stays, hit, last.met | (id_out > 0))
    certificate = NO_CERTIFICATE
    if "error" in facts:
        start_slack = line_slack(piece.c_in, piece.b_in, ends.error_in, piece.id_in)
        stop_slack = line_slack(piece.c_out, piece.b_out, ends.error_out, piece.id_out)
        bounds_sure, beside = ~never, never
        if chord is not None:
            in_apart = np.abs(chord.enter - plane_start) > chord.enter_slack + start_slack
            out_apart = np.abs(chord.leave - plane_stop) > chord.leave_slack + stop_slack
            later = later_slack(chord.enter, chord.enter_slack, plane_start, start_slack)
            start_slack = np.where(is_ball & (not eye_inside(solid)), later, start_slack)
            earlier = later_slack(-chord.leave, chord.leave_slack, -plane_stop, stop_slack)
            stop_slack = np.where(is_ball, earlier, stop_slack)
            caps_sure = (in_apart | ~on_entry) & (out_apart | ~on_exit)
            bounds_sure = (chord.sure & caps_sure) | ~is_ball
            apart = start - start_slack > stop + stop_slack
            beside = is_ball & ((chord.sure & ~chord.met) | (ends.sure & apart))
        surety = of_f.surety(
            first <= 0,
            inside,
            start,
            start_slack,
            stop,
            stop_slack,
            cell,
            position,
            last_step,
        )
        sure_start = surety.begins
        sure_start = np.where(from_eye, eye_sure(solid), sure_start)
        ordered = surely_ordered(ends)
        bound = surety.bound
        u = position.astype(np.float32) * last_step
        before_end = (u + bound) + stop_slack < stop
        sure_root = (bound < UNBOUNDED) & (before_end | (stop_slack == 0))
        past = surety.ends
        sure_miss = (past | (stop_slack == 0)) & (ordered | ~on_exit)
        certain = np.where(on_entry, ordered, cell.sure & np.where(cell.met, sure_root, sure_miss))
        certain = certain & sure_start & bounds_sure & (outside | inside | on_entry)
        # Whether a ray misses the ball, ``beside`` tells.
        none = ~remains(piece)
        known = (ends.empty & none) | (ends.sure & ((ordered & none) | (some & certain)))
        plane_in = line_bound(piece.c_in, piece.b_in, ends.error_in, last_step)
        plane_out = line_bound(piece.c_out, piece.b_out, ends.error_out, last_step)
        if ball is not None and ball_errors is not None:
            bounded = bounded_form(ball, ball_errors)
            ball_bound = curve_bound(bounded, chosen.halvings, last_step)
            plane_in = np.where(enters, ball_bound, plane_in)
            plane_out = np.where(leaves, ball_bound, plane_out)
        certificate = Certificate(
            known | ~within | beside,
            hit,
            surface,
            inside,
            np.where(on_entry, plane_in, np.where(on_exit, plane_out, bound)),
        )
    sight = Sight(hit, surface, position, left, exit_position)
    slope_vector = NO_VECTOR
    if "normal" in facts:
        bend = of_f.slope(position.astype(np.float32) * last_step)
        bend = turned(inside & is_sheet, bend)
        curved = hit & (surface == 0)
        slope_vector = either(on_entry, normal_in, normal_out)
        if "ball" in facts:
            on_cap = is_ball & (surface == outline.ball)
            slope_vector = either(on_cap, slope_at(solid, x, y, position), slope_vector)
        slope_vector = either(curved, bend, slope_vector)
    side = other_side(solid, inside)
    if is_sheet:
        side = inside.astype(np.uint32)
    return Seen(sight, slope_vector, certificate, turned=side)
