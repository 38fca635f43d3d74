"""Twin of ``certificate.wgsl``: certificates of solids along rays."""

from __future__ import annotations

import numpy as np

from halfstep.twin.certify import (
    BoundedForm,
    BoundedPiece,
    Certificate,
    bounded_form,
    bounded_from_the_eye,
    certify_ellipsoid,
    certify_polyhedron,
    certify_quadric,
)
from halfstep.twin.chosen import Chosen, Offset
from halfstep.twin.solid import (
    eye_inside,
    eye_outside,
    eye_sure,
    near_cut,
    starts_at_eye,
    starts_inside,
)


def ends_from_eye(solid: np.void, ends: BoundedPiece) -> BoundedPiece:
    """The piece of a ray; it begins at the eye if the eye is inside all half-spaces."""
    if eye_inside(solid):
        return bounded_from_the_eye(ends, solid["near_u"])
    return ends


def form_with_errors(solid: np.void, at: Offset, chosen: Chosen) -> BoundedForm:
    """F along the rays, with errors."""
    a, g, c = (solid[name] for name in "agc")
    form = chosen.forms.form_at(a, g, c, at)
    return bounded_form(form, chosen.forms.form_errors(a, g, c, at, solid["host_error"]))


def ellipsoid_certificate(solid: np.void, at: Offset, chosen: Chosen) -> Certificate:
    """The certificate of an uncut ellipsoid seen from outside."""
    bounded = form_with_errors(solid, at, chosen)
    return certify_ellipsoid(bounded, chosen.halvings, solid["last_step"])


def quadric_certificate(
    solid: np.void, at: Offset, tried: BoundedPiece, chosen: Chosen
) -> Certificate:
    """The certificate of a quadric; ``tried`` is the piece after all half-spaces."""
    ends = ends_from_eye(solid, tried)
    return certify_quadric(
        form_with_errors(solid, at, chosen),
        ends,
        (ends.piece.id_in == 0) & starts_at_eye(solid),
        eye_outside(solid),
        eye_sure(solid),
        eye_inside(solid) or near_cut(solid),
        chosen.halvings,
        solid["last_step"],
    )


def polyhedron_certificate(solid: np.void, tried: BoundedPiece) -> Certificate:
    """The certificate of a polyhedron; ``tried`` is the piece after all half-spaces."""
    ends = ends_from_eye(solid, tried)
    inside = starts_inside(solid, ends.piece)
    return certify_polyhedron(ends, inside, eye_sure(solid), solid["last_step"])
