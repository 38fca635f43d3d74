// A visible point -> the outward unit normal of its surface, world axes.

// A vector whose square is below this counts as 0. In a greater square, subnormal terms, which
// devices may flush to 0, change no bit.
const VANISHING: f32 = 0x1p-100;

// Three components for each of four pixels.
struct Vector {
  x: f4,
  y: f4,
  z: f4,
}

const NO_VECTOR: Vector = Vector(f4(0.0), f4(0.0), f4(0.0));

// Scalar product, summed from left to right.
fn dot_product(a: Vector, b: Vector) -> f4 {
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}

// Every component times s.
fn scaled(a: Vector, s: f4) -> Vector {
  return Vector(a.x * s, a.y * s, a.z * s);
}

// The vector, or the other one where it vanishes (the gradient at the apex of a cone).
fn or_else(a: Vector, other: Vector) -> Vector {
  return either(dot_product(a, a) > f4(VANISHING), a, other);
}

// `chosen` in some pixels, else `other`.
fn either(some: b4, chosen: Vector, other: Vector) -> Vector {
  return Vector(
    select(other.x, chosen.x, some),
    select(other.y, chosen.y, some),
    select(other.z, chosen.z, some),
  );
}

// The opposite vector in some pixels.
fn turned(some: b4, a: Vector) -> Vector {
  return Vector(select(a.x, -a.x, some), select(a.y, -a.y, some), select(a.z, -a.z, some));
}

// The unit vector along a vector that does not vanish.
fn normalized(a: Vector) -> Vector {
  return scaled(a, f4(1.0) / sqrt(dot_product(a, a)));
}

// Half the gradient of F; k: [1, u][1, x, y][axis], x and y pixel offsets.
fn gradient(k: array<f32, 18>, x: f4, y: f32, u: f4) -> Vector {
  return Vector(
    ((k[0] + y * k[6]) + x * k[3]) + u * ((k[9] + y * k[15]) + x * k[12]),
    ((k[1] + y * k[7]) + x * k[4]) + u * ((k[10] + y * k[16]) + x * k[13]),
    ((k[2] + y * k[8]) + x * k[5]) + u * ((k[11] + y * k[17]) + x * k[14]),
  );
}
