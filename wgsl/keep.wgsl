// What was seen of a solid -> the nearest visible point so far.

// The nearest visible point so far.
struct Nearest {
  key: NearestKey,  // its depth
  surface: u4,  // its number in the scene, from 1; 0 is none
  leaves: Key,  // depth where the ray leaves the solid  //? exit
  low: Key,  // the least depth of what is certain  //? error
  doubt: Key,  // where begins what is not certain  //? error
  bound: f4,  // how far the root may be from the position, in u  //? error
  slope: Vector,  // along the normal  //? normal
  color: Vector,  // of the material  //? color
  specular: f4,  // weight of its highlight  //? gloss
  shininess: u4,  // exponent of its highlight  //? gloss
  depth: f4,  // along the view axis  //? point_lights
  position: i4,  // on its ray, of the solid that shows it  //? places
  turned: u4,  // which side of that is seen, as of `other_side`  //? places
  dark: u4,  // bits of lights that do not reach it  //? shadows
}

// No point yet.
const NOTHING: Nearest = Nearest(
  NO_KEY,
  u4(0u),
  FAR,  //? exit
  FAR,  //? error
  FAR,  //? error
  f4(0.0),  //? error
  NO_VECTOR,  //? normal
  NO_VECTOR,  //? color
  f4(0.0),  //? gloss
  u4(0u),  //? gloss
  f4(0.0),  //? point_lights
  i4(0),  //? places
  u4(0u),  //? places
  u4(0u),  //? shadows
);

// The sight if it is nearer than the nearest point so far, else that.
fn keep(
  old: Nearest,
  solid: Solid,
  sight: Sight,
  slope: Vector,  //? normal
  certificate: Certificate,  //? error
  paint: Paint,  //? regions & color
  turned: u4,  //? places
) -> Nearest {
  let key = key_at(sight.position, solid);
  let surface = u4(solid.surface) + u4(sight.surface);
  let nearer = sight.hit & is_nearer(key, surface, old.key, old.surface);
  let start = Key(u4(solid.key_high), u4(solid.key_low));  //? error
  let left_at = depth_key(  //? exit
    sight.exit_position, solid.steps, solid.key_high, solid.key_low, solid.key_shift
  );
  let leaves = either_key(sight.left, left_at, FAR);  //? exit
  let confirmed = confirms(certificate, sight.hit, sight.surface);  //? error
  let low = least_key(  //? error
    key, certificate.bound, solid.steps, solid.spare, solid.key_shift
  );
  let u = f4(sight.position) * solid.last_step;  //? point_lights
  var color = Vector(  //? color
    f4(solid.color[0]),
    f4(solid.color[1]),
    f4(solid.color[2]),
  );
  color = paint.color;  //? regions & color
  var specular = f4(solid.specular);  //? gloss
  specular = paint.specular;  //? regions & gloss
  var shininess = u4(solid.shininess);  //? gloss
  shininess = paint.shininess;  //? regions & gloss
  return Nearest(
    either_nearest(nearer, key, old.key),
    select(old.surface, surface, nearer),
    either_key(nearer, leaves, old.leaves),  //? exit
    lesser_key(confirmed & sight.hit, low, old.low),  //? error
    lesser_key(!confirmed, start, old.doubt),  //? error
    select(old.bound, certificate.bound, nearer),  //? error
    either(nearer, slope, old.slope),  //? normal
    either(nearer, color, old.color),  //? color
    select(old.specular, specular, nearer),  //? gloss
    select(old.shininess, shininess, nearer),  //? gloss
    select(old.depth, solid.depth_middle + u * solid.depth_half, nearer),  //? point_lights
    select(old.position, sight.position, nearer),  //? places
    select(old.turned, turned, nearer),  //? places
    old.dark,  //? shadows
  );
}
