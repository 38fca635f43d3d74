// Pixel index -> the projection ray, (2), per unit of depth.

// World point on the rays of the centres of pixels (i, j) at depth 1, relative to the eye; for
// parallel rays the point where they start.
fn ray_direction(i: f4, j: f32) -> Vector {
  return Vector(
    (frame.first_ray.x + i * frame.right.x) + j * frame.down.x,
    (frame.first_ray.y + i * frame.right.y) + j * frame.down.y,
    (frame.first_ray.z + i * frame.right.z) + j * frame.down.z,
  );
}
