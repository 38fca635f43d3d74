// Points of rays in the coordinates of a solid of an order above two, which is between -1 and 1.
//
// Rays to a light count from the middle of the solid, or from a lamp that is near. The part of a
// ray within the box is counted anew from where it begins.

// Places where the ray is farther than this from the middle, in halves of the box, are left out.
const EDGE: f32 = 0x1.001p0f;
// The least change of a coordinate, of the greatest, that tells where a ray leaves the box.
const LEAST_CHANGE: f32 = 0x1p-16f;

// One coordinate of the points of rays, level + u along, with the magnitudes of its terms.
struct Track {
  level: f4,
  along: f4,
  level_size: f4,
  along_size: f4,
}

// The points of rays.
struct Trace {
  x: Track,
  y: Track,
  z: Track,
}

// Parts of rays.
struct Way {
  begin: f4,
  end: f4,
}

// A coordinate of points of rays that count from the solid.
fn far_track(
  level: f32,
  by_x: f32,
  by_y: f32,
  by_v: f32,
  shrink: f32,
  x: f4,
  y: f4,
) -> Track {
  let right = by_x * x;
  let down = by_y * y;
  let across = right + down;
  let size = abs(right) + abs(down);
  return Track(
    level + across,
    by_v - shrink * across,
    abs(level) + size,
    abs(by_v) + shrink * size,
  );
}

// Rays that count from the solid.
fn far_trace(caster: Caster, ray: Ray) -> Trace {
  let ahead = select(f4(1.0), ray.t, ray.t > f4(0.0));
  let x = ray.x / ahead;
  let y = ray.y / ahead;
  let k = caster;
  return Trace(
    far_track(k.level[0], k.by_x[0], k.by_y[0], k.by_v[0], k.shrink, x, y),
    far_track(k.level[1], k.by_x[1], k.by_y[1], k.by_v[1], k.shrink, x, y),
    far_track(k.level[2], k.by_x[2], k.by_y[2], k.by_v[2], k.shrink, x, y),
  );
}

// A coordinate of points of rays that count from a lamp.
fn lamp_track(level: f32, by_x: f32, by_y: f32, by_v: f32, x: f4, y: f4, z: f4) -> Track {
  let right = by_x * x;
  let down = by_y * y;
  let ahead = by_v * z;
  return Track(
    f4(level),
    -((right + down) + ahead),
    f4(abs(level)),
    (abs(right) + abs(down)) + abs(ahead),
  );
}

// Rays that count from a lamp.
fn lamp_trace(caster: Caster, ray: Ray) -> Trace {
  let k = caster;
  return Trace(
    lamp_track(k.level[0], k.by_x[0], k.by_y[0], k.by_v[0], ray.x, ray.y, ray.z),
    lamp_track(k.level[1], k.by_x[1], k.by_y[1], k.by_v[1], ray.x, ray.y, ray.z),
    lamp_track(k.level[2], k.by_x[2], k.by_y[2], k.by_v[2], ray.x, ray.y, ray.z),
  );
}

// Magnitudes of a coordinate and of its change.
fn size_of_track(track: Track) -> Track {
  return Track(abs(track.level), abs(track.along), track.level_size, track.along_size);
}

// The coordinate if u counts from another place, and a unit of it is longer.
fn moved_track(track: Track, start: f4, stretch: f4) -> Track {
  return Track(
    track.level + start * track.along,
    track.along * stretch,
    track.level_size + abs(start) * track.along_size,
    track.along_size * stretch,
  );
}

// The points if u counts from another place, and a unit of it is longer.
fn moved_trace(trace: Trace, start: f4, stretch: f4) -> Trace {
  return Trace(
    moved_track(trace.x, start, stretch),
    moved_track(trace.y, start, stretch),
    moved_track(trace.z, start, stretch),
  );
}

// The greatest change of a coordinate.
fn longest_change(trace: Trace) -> f4 {
  return max(max(abs(trace.x.along), abs(trace.y.along)), abs(trace.z.along));
}

// The part of a way on which a coordinate is between -1 and 1, and a little more. A coordinate that
// changes by `least` or less does not tell.
fn narrowed_way(track: Track, least: f4, old: Way) -> Way {
  let steep = abs(track.along) > least;
  let inverse = f4(1.0) / select(f4(1.0), track.along, steep);
  let one = (-EDGE - track.level) * inverse;
  let two = (EDGE - track.level) * inverse;
  return Way(
    select(old.begin, max(old.begin, min(one, two)), steep),
    select(old.end, min(old.end, max(one, two)), steep),
  );
}

// The part of a way within the box; it may end before it begins.
fn boxed_way(trace: Trace, old: Way) -> Way {
  let least = LEAST_CHANGE * longest_change(trace);
  let way = narrowed_way(trace.x, least, old);
  return narrowed_way(trace.z, least, narrowed_way(trace.y, least, way));
}
