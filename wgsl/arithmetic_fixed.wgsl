// Values of the forms and places on a ray in 32-bit integers.
//
// A value has at most 29 bits and a sign, a place 30 bits after the point: u from -2^30 to 2^30.
// Products of two are below 2^60, sums of four such below 2^62: 64 bits hold them exactly.

alias Value = i32;
alias v4 = vec4<i32>;
// Products of two values.
alias w4 = vec4<i64>;

// The value that u = 1 is.
const ONE: Value = 1073741824;
// A product or a sum is off by at most this, relative to it.
const ROUNDING: f32 = 0.0;
// A reduced product is the product times this, off by at most so much besides.
const REDUCTION: f32 = 0x1p-30f;
const REDUCTION_ERROR: f32 = 1.0;
// A value is moved by no more than this.
const LARGEST_MOVE: f32 = 0x1p+20f;

fn product(a: v4, b: v4) -> w4 {
  return w4(a) * w4(b);
}

// A product as a value, rounded up, so that what is positive stays so.
fn reduced(wide: w4) -> v4 {
  return v4((wide + w4(0x3FFFFFFFli)) >> u4(30u));
}

// u of a number of last steps.
fn steps_from_middle(position: i4, steps: u32, last_step: f32) -> v4 {
  return position << u4(30u - steps);
}

// How far errors of its coefficients, all the same, take G² - 4 A C; with room.  Summed in
// integers, and written so that there is only one way for a driver to compute it.
fn discriminant_error(form: Form, errors: FormErrors) -> f4 {
  let sizes = abs(w4(form.g)) + w4(2) * (abs(w4(form.a)) + abs(w4(form.c)));
  return (1.03 * errors.g) * (2.0 * f4(sizes) + 5.0 * errors.g);
}

// A value and an error, which is rounded away from 0.
fn moved(c: v4, by: f4) -> v4 {
  let cut = i4(min(ceil(abs(by)), f4(LARGEST_MOVE)));
  return c + select(cut, -cut, by < f4(0.0));
}
