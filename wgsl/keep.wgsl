// The sight of a solid -> the nearest visible point so far.

// The nearest visible point so far.
struct Nearest {
  key: NearestKey,  // its depth
  surface: u4,  // number of the surface in the scene, from 1; 0 for no hit
  leaves: Key,  // depth of the exit from the solid  //? exit
  low: Key,  // the least depth that a certain point may have  //? error
  doubt: Key,  // the depth from which on nothing is certain  //? error
  vague: Key,  // the same by solids that integers are asked about  //? recheck
  bound: f4,  // bound of the distance of the root from the position, in u  //? error
  slope: Vector,  // along the normal  //? normal
  color: Vector,  // of the material  //? color
  specular: f4,  // weight of its highlight  //? gloss
  shininess: u4,  // exponent of its highlight  //? gloss
  depth: f4,  // along the view axis  //? point_lights
  met: Met,  // the point of a region; none if the solid is no region  //? regions
  overlap: Key,  // depth of a point in two cells of a region  //? overlap
  gap: Key,  // depth of a point in no cell, between two cells  //? gap
  position: i4,  // position of the point on its ray  //? position
  turned: u4,  // which side of the surface is seen, as `other_side` has it  //? places
  dark: u4,  // bits of the lights that do not reach the point  //? shadows
  reflection: f4,  // what a point of a region mirrors; 1 of no region  //? regions & mirrors
}

// No point yet.
const NOTHING: Nearest = Nearest(
  NO_KEY,
  u4(0u),
  FAR,  //? exit
  FAR,  //? error
  FAR,  //? error
  FAR,  //? recheck
  f4(0.0),  //? error
  NO_VECTOR,  //? normal
  NO_VECTOR,  //? color
  f4(0.0),  //? gloss
  u4(0u),  //? gloss
  f4(0.0),  //? point_lights
  NOTHING_MET,  //? regions
  FAR,  //? overlap
  FAR,  //? gap
  i4(0),  //? position
  u4(0u),  //? places
  u4(0u),  //? shadows
  f4(1.0),  //? regions & mirrors
);

// The nearer of a sight and the nearest point so far.
fn keep(
  old: Nearest,
  solid: Solid,
  sight: Sight,
  slope: Vector,  //? normal
  certificate: Certificate,  //? error
  met: Met,  //? regions
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
  var asked = b4(false);  //? error
  asked = b4(is_rechecked(solid));  //? recheck
  let low = least_key(  //? error
    key, certificate.bound, solid.steps, solid.spare, solid.key_shift
  );
  let u = f4(sight.position) * solid.last_step;  //? point_lights
  var color = Vector(  //? color
    f4(solid.color[0]),
    f4(solid.color[1]),
    f4(solid.color[2]),
  );
  var specular = f4(solid.specular);  //? gloss
  var shininess = u4(solid.shininess);  //? gloss
  return Nearest(
    either_nearest(nearer, key, old.key),
    select(old.surface, surface, nearer),
    either_key(nearer, leaves, old.leaves),  //? exit
    lesser_key(confirmed & sight.hit, low, old.low),  //? error
    lesser_key(!confirmed & !asked, start, old.doubt),  //? error
    lesser_key(!confirmed & asked, start, old.vague),  //? recheck
    select(old.bound, certificate.bound, nearer),  //? error
    either(nearer, slope, old.slope),  //? normal
    either(nearer, color, old.color),  //? color
    select(old.specular, specular, nearer),  //? gloss
    select(old.shininess, shininess, nearer),  //? gloss
    select(old.depth, solid.depth_middle + u * solid.depth_half, nearer),  //? point_lights
    either_met(nearer, met, old.met),  //? regions
    old.overlap,  //? overlap
    old.gap,  //? gap
    select(old.position, sight.position, nearer),  //? position
    select(old.turned, turned, nearer),  //? places
    old.dark,  //? shadows
    old.reflection,  //? regions & mirrors
  );
}

// The lesser of the old key and that of a grid point of a region, if it is on the ray.
fn sooner_key(old: Key, q: i4, region: Region, solid: Solid) -> Key {
  let position = position_before(max(q, i4(1)), solid.steps);
  let key = depth_key(position, solid.steps, solid.key_high, solid.key_low, solid.key_shift);
  return lesser_key(q <= i4(region.last), key, old);
}
