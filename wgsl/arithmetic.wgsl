// Values of the forms and places on a ray in float32.

alias Value = f32;
alias v4 = vec4<f32>;
// Products of two values.
alias w4 = vec4<f32>;

// The value that u = 1 is.
const ONE: Value = 1.0;
// A product or a sum is off by at most this, relative to it.
const ROUNDING: f32 = 0x1p-24f;
// A reduced product is the product times this, off by at most so much besides.
const REDUCTION: f32 = 1.0;
const REDUCTION_ERROR: f32 = 0.0;
// A value is moved by no more than this.
const LARGEST_MOVE: f32 = 16.0;

fn product(a: v4, b: v4) -> w4 {
  return a * b;
}

// A product as a value.
fn reduced(wide: w4) -> v4 {
  return wide;
}

// u of a number of last steps.
fn steps_from_middle(position: i4, steps: u32, last_step: f32) -> v4 {
  return f4(position) * last_step;
}

// How far errors of its coefficients, and rounding it, take G² - 4 A C; with room.
fn discriminant_error(form: Form, errors: FormErrors) -> f4 {
  let size_g = size_of(form.g);
  let fourfold = size_of((form.a + form.a) * (form.c + form.c));
  return 1.03 * (((2.0 * size_g + errors.g) * errors.g
    + 4.0 * (size_of(form.a) * errors.c + (size_of(form.c) + errors.c) * errors.a))
    + 3.0 * ROUNDING * (size_g * size_g + fourfold));
}

// A value and an error.
fn moved(c: v4, by: f4) -> v4 {
  return c + by;
}
