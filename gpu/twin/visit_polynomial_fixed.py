"""Twin of ``visit_polynomial_fixed.wgsl``: a solid that a polynomial bounds, in integers.

What is certain is as in `halfstep.twin.visit_polynomial`.  The ends of a piece are places within
2^-30 of exact roots of integer forms, found by halvings, and the errors of these forms.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from halfstep.contract.polynomials import PackedPolynomials
from halfstep.twin.algebraic import outline_of, world_slope
from halfstep.twin.arithmetic_fixed import steps_from_middle
from halfstep.twin.bernstein import (
    FARTHEST,
    PLACE_UNIT,
    bound_of,
    gap_between,
    is_before,
    later_place,
    leaf_from,
    leaf_until,
    line_place_of,
    opposite_weights,
    place_of,
    rooted_leaf,
    slope_about,
    slopes_of_weights,
    sought_cell,
    stretch_begin,
    stretch_end,
    weight_at,
    weights_on_rays,
)
from halfstep.twin.cells import position_in
from halfstep.twin.certify import (
    NO_CERTIFICATE,
    ROOM,
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
from halfstep.twin.lanes import I32, U32, Form, FormErrors
from halfstep.twin.normal import NO_VECTOR, either, turned
from halfstep.twin.piece import clip, from_the_eye, remains, whole_interval
from halfstep.twin.root import ellipsoid_entry, ellipsoid_exit
from halfstep.twin.sight import Seen, Sight
from halfstep.twin.solid import (
    eye_inside,
    eye_outside,
    eye_sure,
    near_cut,
    normal_of,
    slope_at,
    starts_at_eye,
)


def visit_polynomial_fixed(
    solid: np.void,
    rest: PackedPolynomials,
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
    error = np.int64(form["host_error"])
    weights = weights_on_rays(form["terms"], x, y, int(form["shift"]))
    start = line_place_of(piece.c_in, piece.b_in, near_u, piece.id_in)
    stop = line_place_of(-piece.c_out, -piece.b_out, far_u, piece.id_out)
    id_in, id_out, some = piece.id_in, piece.id_out, remains(piece)
    plane_start, plane_stop = start, stop
    never = np.zeros(like.shape, bool)
    enters = leaves = is_ball = met_ball = never
    ball: Form | None = None
    ball_errors: FormErrors | None = None
    enter, leave = start, stop
    if "ball" in facts:
        of_ball = np.int32(outline.ball)
        is_ball = never | (of_ball != 0)
        a, g, c = solid["a"], solid["g"], solid["c"]
        ball = chosen.forms.form_at(a, g, c, at)
        ball_errors = chosen.forms.form_errors(a, g, c, at, solid["host_error"])
        way_in = ellipsoid_entry(ball)
        met_ball = way_in.hit
        enter, leave = place_of(way_in), place_of(ellipsoid_exit(ball))
        # The place of a root before the interval is its first one.
        enters = is_ball & (enter > start + np.int32(1)) & (not eye_inside(solid))
        leaves = is_ball & (leave < stop)
        start, stop = np.where(enters, enter, start), np.where(leaves, leave, stop)
        id_in, id_out = np.where(enters, of_ball, id_in), np.where(leaves, of_ball, id_out)
        some = some & (~is_ball | (met_ball & (start + np.int32(1) < stop)))

    is_sheet = bool(outline.sheet)
    first = weight_at(weights, start)
    at_start = id_in == 0
    from_eye = at_start & starts_at_eye(solid)
    outside = np.where(from_eye, eye_outside(solid), first > 0)
    inside = ~outside & (is_sheet | (at_start & (eye_inside(solid) | near_cut(solid))))
    on_entry = ~outside & ~inside & ~at_start
    within = (outline.left <= x) & (x <= outline.right)
    within = within & ((outline.top <= y) & (y <= outline.bottom))
    some = some & within
    begin, end = leaf_from(start, steps), leaf_until(stop, steps)
    # F may be 0 only here.
    from_place = np.maximum(start, stretch_begin(member))
    to_place = np.minimum(stop, stretch_end(member))
    searched_from, searched_to = leaf_from(from_place, steps), leaf_until(to_place, steps)
    searched = some & ~on_entry & (from_place < to_place)
    final = weight_at(weights, stop)
    seen = opposite_weights(inside, weights)
    at_stop = np.where(inside, -final, final)
    sought = sought_cell(seen, error, at_stop, searched_from, searched_to, searched, steps)
    met = sought.cell.met
    on_exit = inside & ~met & (id_out > 0) & (not is_sheet)
    rooted = rooted_leaf(sought, error, steps)
    cap = np.where(on_entry, begin, end)
    position = position_in(np.where(met, rooted.cell.first, cap), steps)
    hit = some & (met | on_entry | on_exit)
    surface = np.where(on_entry, id_in, np.where(on_exit, id_out, 0))
    left, exit_position = hit, position
    if "exit" in facts:
        stays = inside | is_sheet
        behind = np.where(met, rooted.cell.first + np.int32(1), searched_from)
        going = hit & ~stays & (behind <= searched_to) & (from_place < to_place)
        back = opposite_weights(~inside, weights)
        back_at_stop = np.where(inside, final, -final)
        last = sought_cell(back, error, back_at_stop, behind, searched_to, going, steps)
        leaving = rooted_leaf(last, error, steps).cell.first
        leaving = np.where(last.cell.met, leaving, end)
        exit_position = np.where(stays, position, position_in(leaving, steps))
        left = np.where(stays, hit, last.cell.met | (id_out > 0))
    certificate = NO_CERTIFICATE
    if "error" in facts:
        zero = np.float32(0)
        in_exact = (piece.id_in == 0) & (ends.error_in == 0)
        out_exact = (piece.id_out == 0) & (ends.error_out == 0)
        in_slack = line_bound(piece.c_in, piece.b_in, ends.error_in, PLACE_UNIT)
        out_slack = line_bound(piece.c_out, piece.b_out, ends.error_out, PLACE_UNIT)
        start_slack, stop_slack = (
            np.where(in_exact, zero, in_slack),
            np.where(out_exact, zero, out_slack),
        )
        bounds_sure, beside = ~never, never
        if ball is not None and ball_errors is not None:
            bounded = bounded_form(ball, ball_errors)
            slack = curve_bound(bounded, chosen.searches, PLACE_UNIT)
            sure_chord = np.abs(bounded.discriminant) > bounded.error_d
            after, before = gap_between(enter, plane_start), gap_between(plane_stop, leave)
            in_apart = np.abs(after) > ROOM * (slack + start_slack)
            out_apart = np.abs(before) > ROOM * (slack + stop_slack)
            later = later_place(after, slack, start_slack)
            start_slack = np.where(is_ball & (not eye_inside(solid)), later, start_slack)
            stop_slack = np.where(is_ball, later_place(before, slack, stop_slack), stop_slack)
            caps_sure = (in_apart | ~on_entry) & (out_apart | ~on_exit)
            bounds_sure = (sure_chord & caps_sure) | ~is_ball
            apart = gap_between(start, stop) > ROOM * (start_slack + stop_slack)
            past = is_before(ball, ball_errors)
            beside = is_ball & ((sure_chord & ~met_ball) | (ends.sure & apart) | past)
        off = np.float32(error)
        start_slope = slope_about(weights, off, start, start_slack)
        stop_slope = slope_about(weights, off, stop, stop_slack)
        start_error = ROOM * (off + np.minimum(start_slack, FARTHEST) * start_slope)
        stop_error = ROOM * (off + np.minimum(stop_slack, FARTHEST) * stop_slope)
        sure_start = np.where(
            from_eye, eye_sure(solid), np.abs(first.astype(np.float32)) > start_error
        )
        ordered = surely_ordered(ends)
        bound = bound_of(rooted, last_step)
        value = at_stop.astype(np.float32)
        place = steps_from_middle(position, steps)
        before_end = gap_between(stop, place) > ROOM * (bound + stop_slack)
        sure_root = before_end | (value < -stop_error) | (stop_slack == 0)
        sure_miss = ((value > stop_error) | (stop_slack == 0)) & (ordered | ~on_exit)
        certain = np.where(
            on_entry, ordered, sought.cell.sure & np.where(met, sure_root, sure_miss)
        )
        certain = certain & sure_start & bounds_sure & (outside | inside | on_entry)
        none = ~remains(piece)
        known = (ends.empty & none) | (ends.sure & ((ordered & none) | (some & certain)))
        plane_in = line_bound(piece.c_in, piece.b_in, ends.error_in, last_step)
        plane_out = line_bound(piece.c_out, piece.b_out, ends.error_out, last_step)
        if ball is not None and ball_errors is not None:
            ball_bound = curve_bound(bounded_form(ball, ball_errors), chosen.halvings, last_step)
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
        u = position.astype(np.float32) * last_step
        right = x.astype(np.float32) * outline.scale
        down = y.astype(np.float32) * outline.scale
        right, down = right + 0 * down, down + 0 * right
        slopes = slopes_of_weights(form["terms"], right, down, u)
        bend = turned(inside & is_sheet, world_slope(form, right, down, u - form["middle"], slopes))
        curved = hit & (surface == 0)
        slope_vector = either(on_entry, normal_in, normal_out)
        if "ball" in facts:
            on_cap = is_ball & (surface == outline.ball)
            slope_vector = either(on_cap, slope_at(solid, x, y, position), slope_vector)
        slope_vector = either(curved, bend, slope_vector)
    return Seen(sight, slope_vector, certificate)
