// Functions made of additions, products and quotients alone, so that the twin has the same bits.
//
// Their errors are stated in gpu/twin/elementary.py.

// The largest angle whose sine and cosine are exact enough.
const LARGEST_ANGLE: f32 = 8192.0;
// The largest error of a sine or cosine of angles up to it.
const TURN_ERROR: f32 = 0x1p-22f;
// The largest relative error of the exponential function.
const GROWTH_ERROR: f32 = 0x1p-22f;
// The exponential function limits its argument to this magnitude.
const LARGEST_EXPONENT: f32 = 80.0;
// The logarithm has at most this error, plus this times itself.
const LOGARITHM_ERROR: f32 = 0x1p-23f;
// Logarithms and reciprocals raise smaller magnitudes to this.
const SMALLEST_ARGUMENT: f32 = 0x1p-40f;
// Products are limited to this magnitude.
const LARGEST_PRODUCT: f32 = 0x1p60f;

// An angle as whole quarter turns and a rest of at most half of one.
struct Angle {
  rest: f4,
  quarters: i4,
}

fn angle_of(x: f4) -> Angle {
  let angle = min(max(x, f4(-LARGEST_ANGLE)), f4(LARGEST_ANGLE));
  let k = floor(angle * 0x1.45f306p-1f + 0.5);
  let rest = ((angle - k * 1.5703125) - k * 0x1.fb4p-12f) - k * 0x1.4442d2p-24f;
  return Angle(rest, i4(k));
}

// The sine of an angle and some more quarter turns.
fn turned_sine(angle: Angle, more: i32) -> f4 {
  let r = angle.rest;
  let q = r * r;
  let series = q * (-0x1.55554p-3f + q * (0x1.1105b4p-7f - q * 0x1.98da4p-13f));
  let tail = q * (0x1.55554ap-5f - q * (0x1.6c0c8cp-10f - q * 0x1.9a023ap-16f));
  let quarters = angle.quarters + i4(more);
  let is_odd = (quarters & i4(1)) != i4(0);
  let size = select(r + r * series, 1.0 - q * (0.5 - tail), is_odd);
  // The sign changes after half a turn.
  return bitcast<f4>(bitcast<u4>(size) ^ (bitcast<u4>(quarters & i4(2)) << u4(30u)));
}

// sin(x)
fn sine_of(x: f4) -> f4 {
  return turned_sine(angle_of(x), 0);
}

// cos(x)
fn cosine_of(x: f4) -> f4 {
  return turned_sine(angle_of(x), 1);
}

// e^x
fn exponential_of(x: f4) -> f4 {
  let y = min(max(x, f4(-LARGEST_EXPONENT)), f4(LARGEST_EXPONENT));
  let k = floor(y * 0x1.715476p0f + 0.5);
  let r = (y - k * 0.693359375) + k * 0x1.bd0106p-13f;
  let high = 0x1.111112p-7f + r * (0x1.6c16c2p-10f + r * 0x1.a01a02p-13f);
  let low = 0.5 + r * (0x1.555556p-3f + r * (0x1.555556p-5f + r * high));
  let p = 1.0 + r * (1.0 + r * low);
  return max(p * bitcast<f4>((i4(k) + i4(127)) << u4(23u)), f4(0.0));
}

// log(x)
fn logarithm_of(x: f4) -> f4 {
  let bits = bitcast<u4>(max(x, f4(SMALLEST_ARGUMENT)));
  let mantissa = bitcast<f4>((bits & u4(0x7FFFFFu)) | u4(0x3F800000u));
  let upper = mantissa > f4(0x1.6a09e6p0f);
  let k = f4(i4(bits >> u4(23u)) - i4(127)) + select(f4(0.0), f4(1.0), upper);
  let less = select(mantissa, mantissa * 0.5, upper) - 1.0;
  let s = less / (less + 2.0);
  let q = s * s;
  let tail = 0x1.24924ap-3f + q * 0x1.c71c72p-4f;
  let series = q * (0x1.555556p-2f + q * (0x1.99999ap-3f + q * tail));
  let small = (s + s) + (s + s) * series;
  return k * 0.693359375 + (small - k * 0x1.bd0106p-13f);
}

// 1/x
fn reciprocal_of(x: f4) -> f4 {
  return 1.0 / select(x, f4(SMALLEST_ARGUMENT), abs(x) < f4(SMALLEST_ARGUMENT));
}

// A product that never becomes infinite. Compilers do not take it apart, as they do with the sum of
// two products and a third number.
fn product_of(a: f4, b: f4) -> f4 {
  return min(max(a * b, f4(-LARGEST_PRODUCT)), f4(LARGEST_PRODUCT));
}

// The square root; 0 for a negative number.
fn root_of(x: f4) -> f4 {
  return sqrt(max(x, f4(0.0)));
}
