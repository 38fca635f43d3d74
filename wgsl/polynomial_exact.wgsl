// Coefficients and a pixel offset -> values of polynomials, exactly, in 64-bit integers.
//
// The host scales the coefficients so that the sum of the magnitudes of all terms stays below 2^60
// and a little more, for the rounding of the coefficients. So nothing overflows.

alias Coefficient = i64;

// The offset of a pixel from the middle of a solid's rectangle.
struct Offset {
  x: vec4<i64>,
  y: i64,
}

// The offset in the type of the coefficients.
fn offset(x: i4, y: i32) -> Offset {
  return Offset(vec4<i64>(x), i64(y));
}

// k[0] + k[1] x + k[2] y + k[3] x² + k[4] x y + k[5] y²
fn quadratic(k: array<Coefficient, 6>, at: Offset) -> vec4<i64> {
  let constant = k[0] + at.y * (k[2] + at.y * k[5]);
  let slope = k[1] + at.y * k[4];
  return vec4<i64>(constant) + at.x * (vec4<i64>(slope) + at.x * k[3]);
}

// k[0] + k[1] x + k[2] y
fn linear(k: array<Coefficient, 3>, at: Offset) -> vec4<i64> {
  return vec4<i64>(k[0] + at.y * k[2]) + at.x * k[1];
}

// Bound of the error of `quadratic` from coefficients that are off by half a unit.
fn quadratic_error(at: Offset) -> f4 {
  let x = abs(f4(at.x));
  let y = abs(f32(at.y));
  return 0x1.04p-1f * (((1.0 + y) + y * y) + x * ((1.0 + y) + x));
}

// Bound of the error of `linear` from coefficients that are off by half a unit.
fn linear_error(at: Offset) -> f4 {
  return 0x1.04p-1f * ((1.0 + abs(f32(at.y))) + abs(f4(at.x)));
}
