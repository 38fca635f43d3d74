// Coefficients and a pixel offset -> values of the forms, in 64-bit integers, rounded once.
//
// Coefficients are integers in units of 2^-60.  The host scales them so that the sum of the
// magnitudes of all terms stays below 2^60: nothing overflows.

alias Coefficient = i64;

const UNIT: f32 = 0x1p-60f;

// Pixels from the middle of a solid's rectangle.
struct Offset {
  x: vec4<i64>,
  y: i64,
}

// The offset in the arithmetic of the forms.
fn offset(x: i4, y: i32) -> Offset {
  return Offset(vec4<i64>(x), i64(y));
}

// k[0] + k[1] x + k[2] y + k[3] x² + k[4] x y + k[5] y²
fn quadratic(k: array<Coefficient, 6>, at: Offset) -> f4 {
  let constant = k[0] + at.y * (k[2] + at.y * k[5]);
  let slope = k[1] + at.y * k[4];
  return f4(vec4<i64>(constant) + at.x * (vec4<i64>(slope) + at.x * k[3])) * UNIT;
}

// k[0] + k[1] x + k[2] y
fn linear(k: array<Coefficient, 3>, at: Offset) -> f4 {
  return f4(vec4<i64>(k[0] + at.y * k[2]) + at.x * k[1]) * UNIT;
}

// Bound of the error of `quadratic`: one rounding of the value, half a unit in each coefficient.
fn quadratic_error(k: array<Coefficient, 6>, at: Offset, value: f4) -> f4 {
  let x = abs(f4(at.x));
  let y = abs(f32(at.y));
  let monomials = ((1.0 + y) + y * y) + x * ((1.0 + y) + x);
  return 0x1.04p-24f * abs(value) + 0x1.04p-61f * monomials;
}

// Bound of the error of `linear`.
fn linear_error(k: array<Coefficient, 3>, at: Offset, value: f4) -> f4 {
  let monomials = (1.0 + abs(f32(at.y))) + abs(f4(at.x));
  return 0x1.04p-24f * abs(value) + 0x1.04p-61f * monomials;
}
