// Pixel index -> the projection ray, (2), per unit of depth.

// World direction through the centres of pixels (i, j), relative to the eye at depth 1; or where
// parallel rays start.
fn ray_direction(i: f4, j: f32) -> Vector {
  return Vector(
    (frame.first_ray.x + i * frame.right.x) + j * frame.down.x,
    (frame.first_ray.y + i * frame.right.y) + j * frame.down.y,
    (frame.first_ray.z + i * frame.right.z) + j * frame.down.z,
  );
}
