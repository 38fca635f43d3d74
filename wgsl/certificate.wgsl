// A solid and the errors of its forms -> its certificates along rays.

// The piece of a ray; it begins at the eye if the eye is inside all half-spaces.
fn ends_from_eye(solid: Solid, ends: BoundedPiece) -> BoundedPiece {
  if eye_inside(solid) {
    return bounded_from_the_eye(ends, solid.near_u);
  }
  return ends;
}

// F along the rays, with errors.
fn form_with_errors(solid: Solid, at: Offset) -> BoundedForm {
  let form = form_at(solid.a, solid.g, solid.c, at);
  let errors = form_errors(solid.a, solid.g, solid.c, at, solid.host_error);
  return bounded_form(form, errors);
}

// The certificate of an uncut ellipsoid seen from outside.
fn ellipsoid_certificate(solid: Solid, at: Offset) -> Certificate {
  return certify_ellipsoid(form_with_errors(solid, at), HALVINGS, solid.last_step);
}

// The certificate of a quadric; `tried` is the piece after all half-spaces.
fn quadric_certificate(solid: Solid, at: Offset, tried: BoundedPiece) -> Certificate {
  let ends = ends_from_eye(solid, tried);
  return certify_quadric(
    form_with_errors(solid, at),
    ends,
    (ends.piece.id_in == i4(0)) & b4(starts_at_eye(solid)),
    eye_outside(solid),
    eye_sure(solid),
    eye_inside(solid) | near_cut(solid),
    HALVINGS,
    solid.last_step,
  );
}

// The certificate of a polyhedron; `tried` is the piece after all half-spaces.
fn polyhedron_certificate(solid: Solid, tried: BoundedPiece) -> Certificate {
  let ends = ends_from_eye(solid, tried);
  let inside = starts_inside(solid, ends.piece);
  return certify_polyhedron(ends, inside, eye_sure(solid), solid.last_step);
}
