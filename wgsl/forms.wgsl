// Coefficients and a pixel offset -> a solid's forms along the ray, in float32.

// A half-space along the ray.
fn line_at(c: array<Coefficient, 3>, b: array<Coefficient, 3>, at: Offset) -> Line {
  return Line(linear(c, at), linear(b, at));
}

// Its errors, given the error of the set-up.
fn line_errors(
  c: array<Coefficient, 3>,
  b: array<Coefficient, 3>,
  at: Offset,
  host_error: f32,
) -> LineErrors {
  return LineErrors(linear_error(c, at) + host_error, linear_error(b, at) + host_error);
}

// F along the ray.
fn form_at(
  a: array<Coefficient, 6>,
  g: array<Coefficient, 6>,
  c: array<Coefficient, 6>,
  at: Offset,
) -> Form {
  return Form(quadratic(a, at), quadratic(g, at), quadratic(c, at));
}

// Its errors, given the error of the set-up.
fn form_errors(
  a: array<Coefficient, 6>,
  g: array<Coefficient, 6>,
  c: array<Coefficient, 6>,
  at: Offset,
  host_error: f32,
) -> FormErrors {
  return FormErrors(
    quadratic_error(a, at) + host_error,
    quadratic_error(g, at) + host_error,
    quadratic_error(c, at) + host_error,
  );
}
