// Coefficients and a pixel offset -> a solid's forms along the ray, in 32-bit integers.
//
// Each ray shifts its values down to 29 bits: c and b by one number of bits, A, G and C by another.
// The joint logic asks for signs of homogeneous expressions, which a common factor does not change.

const VALUE_BITS: u32 = 29u;
// Errors of more units than this exceed all values; their products stay within float32.
const LARGEST_ERROR: f32 = 0x1p40;

// The bits to shift a number of a size down, so that it has `VALUE_BITS` bits.
fn excess_bits(size: vec4<i64>) -> u4 {
  let high = u4(size >> u4(32u));
  let word = select(u4(size), high, high > u4(0u));
  let bits = select(u4(32u), u4(64u), high > u4(0u)) - countLeadingZeros(word);
  return max(bits, u4(VALUE_BITS)) - u4(VALUE_BITS);
}

// A number shifted down, rounded to nearest.
fn shifted(number: vec4<i64>, excess: u4) -> v4 {
  let half = (vec4<i64>(1li) << excess) >> u4(1u);
  return v4((number + half) >> excess);
}

// An error shifted down, and half a unit for the rounding; of 16 bits, rounded up, so that sums of
// a few are exact in whichever order a driver takes them.
fn shifted_error(error: f4, excess: u4) -> f4 {
  let down = error * bitcast<f4>((u4(127u) - excess) << u4(23u));
  let whole = min(down, f4(LARGEST_ERROR)) + 0.5;
  return bitcast<f4>((bitcast<u4>(whole) + u4(255u)) & u4(0xFFFFFF00u));
}

// The shift of a half-space, after which |c| and |b| fit.
fn line_excess(c: array<Coefficient, 3>, b: array<Coefficient, 3>, at: Offset) -> u4 {
  return excess_bits(max(abs(linear(c, at)), abs(linear(b, at))));
}

// A half-space along the ray.
fn line_at(c: array<Coefficient, 3>, b: array<Coefficient, 3>, at: Offset) -> Line {
  let excess = line_excess(c, b, at);
  return Line(shifted(linear(c, at), excess), shifted(linear(b, at), excess));
}

// Its errors, given the error of the set-up.
fn line_errors(
  c: array<Coefficient, 3>,
  b: array<Coefficient, 3>,
  at: Offset,
  host_error: f32,
) -> LineErrors {
  let error = shifted_error(linear_error(at) + host_error, line_excess(c, b, at));
  return LineErrors(error, error);
}

// The shift of F, after which |C| fits, and |G| + 3 |A|, a bound of the halvings' values.
fn form_excess(
  a: array<Coefficient, 6>,
  g: array<Coefficient, 6>,
  c: array<Coefficient, 6>,
  at: Offset,
) -> u4 {
  let bend = abs(quadratic(a, at));
  let slope = abs(quadratic(g, at)) + (bend + bend + bend);
  return excess_bits(max(abs(quadratic(c, at)), slope));
}

// F along the ray.
fn form_at(
  a: array<Coefficient, 6>,
  g: array<Coefficient, 6>,
  c: array<Coefficient, 6>,
  at: Offset,
) -> Form {
  let excess = form_excess(a, g, c, at);
  return Form(
    shifted(quadratic(a, at), excess),
    shifted(quadratic(g, at), excess),
    shifted(quadratic(c, at), excess),
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
  let error = shifted_error(quadratic_error(at) + host_error, form_excess(a, g, c, at));
  return FormErrors(error, error, error);
}
