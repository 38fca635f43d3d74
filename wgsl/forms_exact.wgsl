// Coefficients and a pixel offset -> a solid's forms along the ray, in float32, rounded once.

// A unit of the coefficients.
const UNIT: f32 = 0x1p-60f;
// Room for the rounding of a value and of its bound.
const ONCE: f32 = 0x1.04p-24f;

// A half-space along the ray.
fn line_at(c: array<Coefficient, 3>, b: array<Coefficient, 3>, at: Offset) -> Line {
  return Line(f4(linear(c, at)) * UNIT, f4(linear(b, at)) * UNIT);
}

// Its errors, given the error of the set-up.
fn line_errors(
  c: array<Coefficient, 3>,
  b: array<Coefficient, 3>,
  at: Offset,
  host_error: f32,
) -> LineErrors {
  let line = line_at(c, b, at);
  let given = UNIT * (linear_error(at) + host_error);
  return LineErrors(ONCE * abs(line.c) + given, ONCE * abs(line.b) + given);
}

// F along the ray.
fn form_at(
  a: array<Coefficient, 6>,
  g: array<Coefficient, 6>,
  c: array<Coefficient, 6>,
  at: Offset,
) -> Form {
  return Form(
    f4(quadratic(a, at)) * UNIT,
    f4(quadratic(g, at)) * UNIT,
    f4(quadratic(c, at)) * UNIT,
  );
}

// Its errors, given the error of the set-up.
fn form_errors(
  a: array<Coefficient, 6>,
  g: array<Coefficient, 6>,
  c: array<Coefficient, 6>,
  at: Offset,
  host_error: f32,
) -> FormErrors {
  let form = form_at(a, g, c, at);
  let given = UNIT * (quadratic_error(at) + host_error);
  return FormErrors(
    ONCE * abs(form.a) + given,
    ONCE * abs(form.g) + given,
    ONCE * abs(form.c) + given,
  );
}
