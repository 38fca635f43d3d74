// A polynomial along rays, of any degree.
//
// DEGREE is the highest degree in the scene.  gpu/twin/taylor.py derives the error of F.

const POWERS: u32 = DEGREE + 1u;
// The number of terms with one power of u, and of all terms.
const ROW_TERMS: u32 = (DEGREE + 1u) * (DEGREE + 2u) / 2u;

// F on the rays of pixels.
struct Curve {
  powers: array<f4, POWERS>,  // coefficients of powers of u - middle
  sizes: array<f4, POWERS>,  // of their terms
  middle: f32,
  rounding: f32,  // error of F, as a part of the sum of the sizes
  host_error: f32,  // error of F from the set-up
}

// Derivatives of F.
struct Slopes {
  x: f4,
  y: f4,
  u: f4,
}

// The polynomial with the terms k on the rays of pixels.
fn on_rays(k: array<Length, TERMS>, x: f4, y: f32) -> array<f4, POWERS> {
  var powers: array<f4, POWERS>;
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    var total = f4(k[j * ROW_TERMS]);
    // written out
    for (var a = 1u; a < DEGREE + 1u; a++) {
      var row = k[j * ROW_TERMS + a * (a + 1u) / 2u];
      // written out
      for (var b = 1u; b < a + 1u; b++) {
        row = row * y + k[j * ROW_TERMS + a * (a + 1u) / 2u + b];
      }
      total = total * x + row;
    }
    powers[j] = total;
  }
  return powers;
}

// Sums of the magnitudes of the terms that `on_rays` sums.
fn sizes_on_rays(k: array<Length, TERMS>, x: f4, y: f32) -> array<f4, POWERS> {
  let size_x = abs(x);
  let size_y = abs(y);
  var sizes: array<f4, POWERS>;
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    var total = f4(abs(k[j * ROW_TERMS]));
    // written out
    for (var a = 1u; a < DEGREE + 1u; a++) {
      var row = abs(k[j * ROW_TERMS + a * (a + 1u) / 2u]);
      // written out
      for (var b = 1u; b < a + 1u; b++) {
        row = row * size_y + abs(k[j * ROW_TERMS + a * (a + 1u) / 2u + b]);
      }
      total = total * size_x + row;
    }
    sizes[j] = total;
  }
  return sizes;
}

// Derivatives of the polynomial at u; `powers` are those of `on_rays`.
fn slopes_on_rays(
  k: array<Length, TERMS>,
  powers: array<f4, POWERS>,
  x: f4,
  y: f32,
  u: f4,
) -> Slopes {
  var in_x = f4(0.0);
  var in_y = f4(0.0);
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    var slope_x = f4(f32(DEGREE) * k[(DEGREE - j) * ROW_TERMS]);
    var slope_y = f4(k[(DEGREE - j) * ROW_TERMS + 1u]);
    // written out
    for (var a = 1u; a < DEGREE; a++) {
      var row = k[(DEGREE - j) * ROW_TERMS + a * (a + 1u) / 2u];
      // written out
      for (var b = 1u; b < a + 1u; b++) {
        row = row * y + k[(DEGREE - j) * ROW_TERMS + a * (a + 1u) / 2u + b];
      }
      slope_x = slope_x * x + f32(DEGREE - a) * row;
      var slope_row = f32(a + 1u) * k[(DEGREE - j) * ROW_TERMS + (a + 1u) * (a + 2u) / 2u];
      // written out
      for (var b = 1u; b < a + 1u; b++) {
        slope_row = slope_row * y
          + f32(a + 1u - b) * k[(DEGREE - j) * ROW_TERMS + (a + 1u) * (a + 2u) / 2u + b];
      }
      slope_y = slope_y * x + slope_row;
    }
    in_x = in_x * u + slope_x;
    in_y = in_y * u + slope_y;
  }
  var in_u = f32(DEGREE) * powers[DEGREE];
  // written out
  for (var j = 1u; j < DEGREE; j++) {
    in_u = in_u * u + f32(DEGREE - j) * powers[DEGREE - j];
  }
  return Slopes(in_x, in_y, in_u);
}

// F at u.
fn value_at(p: array<f4, POWERS>, u: f4) -> f4 {
  var value = p[DEGREE];
  // written out
  for (var j = 0u; j < DEGREE; j++) {
    value = value * u + p[DEGREE - 1u - j];
  }
  return value;
}

// The largest slope of F for |u| up to u >= 0.
fn slope_at_most(sizes: array<f4, POWERS>, u: f4) -> f4 {
  var slope = f32(DEGREE) * sizes[DEGREE];
  // written out
  for (var j = 1u; j < DEGREE; j++) {
    slope = slope * u + f32(DEGREE - j) * sizes[DEGREE - j];
  }
  return slope;
}

// F(m + s h) as a polynomial in s.
fn about(p: array<f4, POWERS>, m: f4, h: f4) -> array<f4, POWERS> {
  var t = p;
  // written out
  for (var k = 0u; k < DEGREE; k++) {
    // written out
    for (var j = k; j < DEGREE; j++) {
      t[DEGREE + k - 1u - j] = t[DEGREE + k - 1u - j] + m * t[DEGREE + k - j];
    }
  }
  var scale = h;
  // written out
  for (var j = 1u; j < DEGREE + 1u; j++) {
    t[j] = t[j] * scale;
    scale = scale * h;
  }
  return t;
}

// F at u in the interval.
fn curve_value(curve: Curve, u: f4) -> f4 {
  return value_at(curve.powers, u - curve.middle);
}

// The largest error of F at distances from the middle up to `reach`.
fn curve_error(curve: Curve, reach: f4) -> f4 {
  return curve.rounding * value_at(curve.sizes, reach) + curve.host_error;
}

// -F in some pixels.
fn opposite(some: b4, curve: Curve) -> Curve {
  var turned = curve;
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    turned.powers[j] = select(curve.powers[j], -curve.powers[j], some);
  }
  return turned;
}

// Those of c + b u + a u² in some pixels, `powers` in the others.
fn cap_or(some: b4, powers: array<f4, POWERS>, c: f4, b: f4, a: f4) -> array<f4, POWERS> {
  var chosen: array<f4, POWERS>;
  chosen[0] = select(powers[0], c, some);
  chosen[1] = select(powers[1], b, some);
  chosen[2] = select(powers[2], a, some);
  // written out
  for (var j = 3u; j < DEGREE + 1u; j++) {
    chosen[j] = select(powers[j], f4(0.0), some);
  }
  return chosen;
}
