// A normal, a point and a material -> linear colour: Lambert with a Blinn-Phong highlight.

// Light and cosines below this count as 0. A sum above it has the same bits with and without its
// subnormal terms, which devices may flush to 0.
const FAINT: f32 = 1e-18;

// The material of each of four pixels.
struct Finish {
  color: Vector,
  specular: f4,
  shininess: u4,
}

// base^exponent for a base in [0, 1] by squaring, so that every device gives the same bits.
fn power(base: f4, exponent: u4) -> f4 {
  var result = f4(1.0);
  var square = max(base, f4(FAINT));
  for (var bit = 0u; bit < SHININESS_BITS; bit++) {
    let taken = ((exponent >> u4(bit)) & u4(1u)) == u4(1u);
    result = select(result, max(result * square, f4(FAINT)), taken);
    square = max(square * square, f4(FAINT));
  }
  return result;
}

// `light`, or 0 where it is faint. In an image both are black.
fn seen(light: f4) -> f4 {
  return select(f4(0.0), light, light > f4(FAINT));
}

// Linear colour of a point, seen along a direction; both are relative to the eye.  The normal is
// turned towards the eye, so that the inside of an opened solid is lit too.  `dark` has a bit for
// each of the first lights, which have shadows; it is set if the light does not reach the point.
fn shade(normal: Vector, direction: Vector, point: Vector, finish: Finish, dark: u4) -> Vector {
  let away = dot_product(normal, direction) > f4(FAINT);
  let toward = scaled(normal, select(f4(1.0), f4(-1.0), away));
  let forward = normalized(direction);  //? gloss
  var diffuse = Vector(f4(frame.ambient.x), f4(frame.ambient.y), f4(frame.ambient.z));
  var glossy = NO_VECTOR;
  for (var ix = 0u; ix < LIGHTS; ix++) {
    let light = lights[ix];
    var to_light = Vector(f4(light.vector.x), f4(light.vector.y), f4(light.vector.z));
    let from_point = Vector(  //? point_lights
      light.vector.x - light.vector.w * point.x,
      light.vector.y - light.vector.w * point.y,
      light.vector.z - light.vector.w * point.z,
    );
    to_light = normalized(or_else(from_point, toward));  //? point_lights
    var lambert = max(dot_product(toward, to_light), f4(0.0));
    {  //? shadows
      let is_dark = ((dark >> u4(min(ix, 31u))) & u4(1u)) == u4(1u);
      lambert = select(lambert, f4(0.0), is_dark & b4(ix < SHADOWS));
    }
    diffuse = Vector(
      diffuse.x + light.color.x * lambert,
      diffuse.y + light.color.y * lambert,
      diffuse.z + light.color.z * lambert,
    );
    {  //? gloss
      let between = Vector(to_light.x - forward.x, to_light.y - forward.y, to_light.z - forward.z);
      let halfway = normalized(or_else(between, toward));
      let cosine = min(max(dot_product(toward, halfway), f4(0.0)), f4(1.0));
      let shine = finish.specular * power(cosine, finish.shininess);
      let gloss = select(f4(0.0), shine, lambert > f4(FAINT));
      glossy = Vector(
        glossy.x + light.color.x * gloss,
        glossy.y + light.color.y * gloss,
        glossy.z + light.color.z * gloss,
      );
    }
  }
  return Vector(
    finish.color.x * diffuse.x + glossy.x,
    finish.color.y * diffuse.y + glossy.y,
    finish.color.z * diffuse.z + glossy.z,
  );
}
