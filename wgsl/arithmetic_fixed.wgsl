// Values of the forms and positions on a ray in 32-bit integers.
//
// A value has at most 29 bits and a sign. A position has 30 bits after the point: u from -2^30 to
// 2^30. A product of two values is below 2^60 and a sum of four products below 2^62, so 64 bits
// hold them exactly.

alias Value = i32;
alias v4 = vec4<i32>;
// Products of two values.
alias w4 = vec4<i64>;

// The value that u = 1 is.
const ONE: Value = 1073741824;
// The relative error of a product or a sum is at most this.
const ROUNDING: f32 = 0.0;
// reduced(p) = p · REDUCTION ± REDUCTION_ERROR.
const REDUCTION: f32 = 0x1p-30f;
const REDUCTION_ERROR: f32 = 1.0;
// The most by which `moved` moves a value.
const LARGEST_MOVE: f32 = 0x1p+20f;

fn product(a: v4, b: v4) -> w4 {
  return w4(a) * w4(b);
}

// A product as a value, rounded up, so that a positive product stays positive.
fn reduced(wide: w4) -> v4 {
  return v4((wide + w4(0x3FFFFFFFli)) >> u4(30u));
}

// The u at a number of last steps from the middle.
fn steps_from_middle(position: i4, steps: u32, last_step: f32) -> v4 {
  return position << u4(30u - steps);
}

// A bound of the error of G² - 4 A C, from errors of its coefficients, which are equal. The sum is
// in integers, and written so that a driver can compute it in only one way.
fn discriminant_error(form: Form, errors: FormErrors) -> f4 {
  let sizes = abs(w4(form.g)) + w4(2) * (abs(w4(form.a)) + abs(w4(form.c)));
  return (1.03 * errors.g) * (2.0 * f4(sizes) + 5.0 * errors.g);
}

// The sum of a value and an error, which is rounded away from 0.
fn moved(c: v4, by: f4) -> v4 {
  let cut = i4(min(ceil(abs(by)), f4(LARGEST_MOVE)));
  return c + select(cut, -cut, by < f4(0.0));
}
