// Coefficients and a pixel offset -> values of polynomials, in float32.

alias Coefficient = f32;

// The offset of a pixel from the middle of a solid's rectangle.
struct Offset {
  x: f4,
  y: f32,
}

// The offset in the type of the coefficients; exact below 2^24.
fn offset(x: i4, y: i32) -> Offset {
  return Offset(f4(x), f32(y));
}

// k[0] + k[1] x + k[2] y + k[3] x² + k[4] x y + k[5] y²
fn quadratic(k: array<Coefficient, 6>, at: Offset) -> f4 {
  let constant = k[0] + at.y * (k[2] + at.y * k[5]);
  let slope = k[1] + at.y * k[4];
  return constant + at.x * (slope + at.x * k[3]);
}

// k[0] + k[1] x + k[2] y
fn linear(k: array<Coefficient, 3>, at: Offset) -> f4 {
  return (k[0] + at.y * k[2]) + at.x * k[1];
}

// Bound of the error of `quadratic`, from the roundings that each term passes: that of the
// coefficient and of each operation on the way to the value.
fn quadratic_error(k: array<Coefficient, 6>, at: Offset) -> f4 {
  let x = abs(at.x);
  let y = abs(at.y);
  let constant = 3.0 * abs(k[0]) + y * (5.0 * abs(k[2]) + y * (6.0 * abs(k[5])));
  let slope = 5.0 * abs(k[1]) + y * (6.0 * abs(k[4]));
  return 0x1.04p-24f * (constant + x * (slope + x * (5.0 * abs(k[3]))));
}

// Bound of the error of `linear`.
fn linear_error(k: array<Coefficient, 3>, at: Offset) -> f4 {
  let constant = 3.0 * abs(k[0]) + abs(at.y) * (4.0 * abs(k[2]));
  return 0x1.04p-24f * (constant + abs(at.x) * (3.0 * abs(k[1])));
}
