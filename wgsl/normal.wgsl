// A visible point -> the outward unit normal of its surface, world axes.

// Three components for each of four pixels.
struct Vector {
  x: f4,
  y: f4,
  z: f4,
}

// Scalar product, summed from left to right.
fn dot_product(a: Vector, b: Vector) -> f4 {
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}

// Every component times s.
fn scaled(a: Vector, s: f4) -> Vector {
  return Vector(a.x * s, a.y * s, a.z * s);
}

// Unit vector along a, or the fallback where a vanishes (the apex of a cone).
fn normalized(a: Vector, fallback: Vector) -> Vector {
  let length = sqrt(dot_product(a, a));
  let some = length > f4(0.0);
  let safe = select(f4(1.0), length, some);
  return Vector(
    select(fallback.x, a.x / safe, some),
    select(fallback.y, a.y / safe, some),
    select(fallback.z, a.z / safe, some),
  );
}

// Half the gradient of F; k: [1, u][1, x, y][axis], x and y pixel offsets.
fn gradient(k: array<f32, 18>, x: f4, y: f32, u: f4) -> Vector {
  return Vector(
    ((k[0] + y * k[6]) + x * k[3]) + u * ((k[9] + y * k[15]) + x * k[12]),
    ((k[1] + y * k[7]) + x * k[4]) + u * ((k[10] + y * k[16]) + x * k[13]),
    ((k[2] + y * k[8]) + x * k[5]) + u * ((k[11] + y * k[17]) + x * k[14]),
  );
}
