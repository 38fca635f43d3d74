// The nearest visible point -> the normal and the colour that four pixels show.

// The normals and colours of four pixels.
struct Shown {
  normal: Vector,  // unit, or 0 where nothing is hit  //? store_normal
  color: Vector,  // linear  //? color
}

// The normals and colours of the pixels (i, j) of the picture.
fn finish(nearest: Nearest, i: i4, j: i32) -> Shown {
  let some = nearest.surface > u4(0u);
  let ray = ray_direction(f4(i), f32(j));
  var direction = ray;
  direction = Vector(f4(frame.forward.x), f4(frame.forward.y), f4(frame.forward.z));  //? parallel
  let to_eye = Vector(-direction.x, -direction.y, -direction.z);
  let normal = normalized(or_else(nearest.slope, to_eye));
  var material = Finish(nearest.color, f4(0.0), u4(0u));  //? color
  material = Finish(nearest.color, nearest.specular, nearest.shininess);  //? gloss
  var point = direction;  //? color
  point = scaled(direction, nearest.depth);  //? point_lights
  point = Vector(ray.x + point.x, ray.y + point.y, ray.z + point.z);  //? point_lights & parallel
  let background = Vector(  //? color
    f4(frame.background.x),
    f4(frame.background.y),
    f4(frame.background.z),
  );
  var dark = u4(0u);  //? color
  dark = nearest.dark;  //? color & shadows
  var lit = shade(normal, direction, point, material, dark);  //? color
  lit = Vector(seen(lit.x), seen(lit.y), seen(lit.z));  //? store_color
  return Shown(
    either(some, normal, NO_VECTOR),  //? store_normal
    either(some, lit, background),  //? color
  );
}
