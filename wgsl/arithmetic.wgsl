// Values of the forms and positions on a ray in float32.

alias Value = f32;
alias v4 = vec4<f32>;
// Products of two values.
alias w4 = vec4<f32>;

// The value that u = 1 is.
const ONE: Value = 1.0;
// The relative error of a product or a sum is at most this.
const ROUNDING: f32 = 0x1p-24f;
// reduced(p) = p · REDUCTION ± REDUCTION_ERROR.
const REDUCTION: f32 = 1.0;
const REDUCTION_ERROR: f32 = 0.0;
// The most by which `moved` moves a value.
const LARGEST_MOVE: f32 = 16.0;

fn product(a: v4, b: v4) -> w4 {
  return a * b;
}

// A product as a value.
fn reduced(wide: w4) -> v4 {
  return wide;
}

// The u at a number of last steps from the middle.
fn steps_from_middle(position: i4, steps: u32, last_step: f32) -> v4 {
  return f4(position) * last_step;
}

// A bound of the error of G² - 4 A C, from errors of its coefficients and from rounding.
fn discriminant_error(form: Form, errors: FormErrors) -> f4 {
  let size_g = size_of(form.g);
  let fourfold = size_of((form.a + form.a) * (form.c + form.c));
  return 1.03 * (((2.0 * size_g + errors.g) * errors.g
    + 4.0 * (size_of(form.a) * errors.c + (size_of(form.c) + errors.c) * errors.a))
    + 3.0 * ROUNDING * (size_g * size_g + fourfold));
}

// The sum of a value and an error.
fn moved(c: v4, by: f4) -> v4 {
  return c + by;
}
