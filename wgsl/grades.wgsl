// Values of formulas at points, with their derivatives along the axes: what shading asks for.

// A value and its gradient.
struct Grade {
  value: f4,
  x: f4,
  y: f4,
  z: f4,
}

// Of a value that changes `first` times as fast as another one.
fn chained(value: f4, first: f4, a: Grade) -> Grade {
  return Grade(value, product_of(first, a.x), product_of(first, a.y), product_of(first, a.z));
}

// One of two.
fn either_grade(some: b4, chosen: Grade, other: Grade) -> Grade {
  return Grade(
    select(other.value, chosen.value, some),
    select(other.x, chosen.x, some),
    select(other.y, chosen.y, some),
    select(other.z, chosen.z, some),
  );
}

// A number.
fn number_grade(k: f32) -> Grade {
  return Grade(f4(k), f4(0.0), f4(0.0), f4(0.0));
}

// The same, if it is not too large.
fn checked_grade(a: Grade) -> Grade {
  return chained(a.value, f4(1.0), a);
}

// a + k
fn raised_grade(a: Grade, k: f32) -> Grade {
  return Grade(a.value + k, a.x, a.y, a.z);
}

// k a
fn scaled_grade(a: Grade, k: f32) -> Grade {
  return chained(product_of(a.value, f4(k)), f4(k), a);
}

// -a
fn negated_grade(a: Grade) -> Grade {
  return Grade(-a.value, -a.x, -a.y, -a.z);
}

// a + b
fn sum_grade(a: Grade, b: Grade) -> Grade {
  return Grade(a.value + b.value, a.x + b.x, a.y + b.y, a.z + b.z);
}

// a - b
fn difference_grade(a: Grade, b: Grade) -> Grade {
  return sum_grade(a, negated_grade(b));
}

// a b
fn product_grade(a: Grade, b: Grade) -> Grade {
  return Grade(
    product_of(a.value, b.value),
    product_of(b.value, a.x) + product_of(a.value, b.x),
    product_of(b.value, a.y) + product_of(a.value, b.y),
    product_of(b.value, a.z) + product_of(a.value, b.z),
  );
}

// a²
fn square_grade(a: Grade) -> Grade {
  return chained(product_of(a.value, a.value), a.value + a.value, a);
}

// 1/a
fn reciprocal_grade(a: Grade) -> Grade {
  let value = reciprocal_of(a.value);
  return chained(value, -product_of(value, value), a);
}

// The square root of a.
fn root_grade(a: Grade, beyond: f32) -> Grade {
  let value = root_of(a.value);
  return chained(value, reciprocal_of(value + value), a);
}

// |a|
fn magnitude_grade(a: Grade) -> Grade {
  return either_grade(a.value < f4(0.0), negated_grade(a), a);
}

// The greater of a and b.
fn greatest_grade(a: Grade, b: Grade) -> Grade {
  return either_grade(a.value < b.value, b, a);
}

// The lesser of a and b.
fn least_grade(a: Grade, b: Grade) -> Grade {
  return either_grade(b.value < a.value, b, a);
}

// sin(a)
fn sine_grade(a: Grade) -> Grade {
  return chained(sine_of(a.value), cosine_of(a.value), a);
}

// cos(a)
fn cosine_grade(a: Grade) -> Grade {
  return chained(cosine_of(a.value), -sine_of(a.value), a);
}

// e^a
fn exponential_grade(a: Grade) -> Grade {
  let value = exponential_of(a.value);
  return chained(value, value, a);
}

// log(a)
fn logarithm_grade(a: Grade) -> Grade {
  return chained(logarithm_of(a.value), reciprocal_of(a.value), a);
}
