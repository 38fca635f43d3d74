// The nearest points of a block -> the colours that mirrors among them show, bounce after bounce.

// What a ray from a mirror meets first, of the bodies tried so far.
struct Spotted {
  distance: f4,  // in units of the grid
  surface: u4,  // its number in the scene, from 1; 0 is none
  body: u4,  // that of the body
  turned: u4,  // which side of it is seen, as of `other_side`
  root: Root,
  place: f4,  // u of it  //? placed
  side: i4,  // of a surface of a copy of a group, as of `Met`  //? body_cells
  doubt: f4,  // distance from which on it is not certain  //? placed
}

// Beyond all distances.
const NO_DOUBT: f32 = 3.2e38;

const NOTHING_SPOTTED: Spotted = Spotted(
  f4(3e38),
  u4(0u),
  u4(0u),
  u4(0u),
  Root(b4(false), i4(0), f4(0.0), f4(0.0), f4(0.0), b4(false)),
  f4(0.0),  //? placed
  i4(0),  //? body_cells
  f4(NO_DOUBT),  //? placed
);

// What is seen of it.
struct Caught {
  point: Point,
  slope: Vector,  // along the normal
  material: Finish,
  reflection: f4,
}

// No point.
const NOTHING_CAUGHT: Caught = Caught(
  NO_POINT,
  NO_VECTOR,
  Finish(NO_VECTOR, f4(0.0), u4(0u)),
  f4(0.0),
);

// The way from the mirror to u, at least that to the box of the body.
fn distance_of(body: Body, glance: Glance, u: f4, stay: Stay) -> f4 {
  let way = (u - glance.start) * (1.0 / body.unit);
  return select(way, stay.enters, stay.enters > way);
}

// What a ray meets first, and a body, which it meets at a root, at u.
fn spot_first(
  old: Spotted,
  number: u32,
  body: Body,
  glance: Glance,
  stay: Stay,
  root: Root,
  u: f4,
  inside: b4,
  side: i4,  //? body_cells
) -> Spotted {
  let distance = distance_of(body, glance, u, stay);
  let is_flat = b4((body.flags & SHADE_FLAT) != 0u);
  let face = u4(root.surface);
  let surface = u4(body.surface) + select(face, u4(1u), is_flat);
  let nearer = root.hit
    & may_meet(stay)
    & ((distance < old.distance) | ((distance == old.distance) & (surface < old.surface)));
  let other = inside | (is_flat & (face == u4(2u)));
  return Spotted(
    select(old.distance, distance, nearer),
    select(old.surface, surface, nearer),
    select(old.body, u4(number), nearer),
    select(old.turned, select(u4(0u), u4(1u), other), nearer),
    Root(
      old.root.hit | nearer,
      i4(0),
      select(old.root.a, root.a, nearer),
      select(old.root.g, root.g, nearer),
      select(old.root.c, root.c, nearer),
      select(old.root.flipped, root.flipped, nearer),
    ),
    select(old.place, u, nearer),  //? placed
    select(old.side, side, nearer),  //? body_cells
    old.doubt,  //? placed
  );
}

// `chosen` in some pixels, else `other`.
fn either_piece(some: b4, chosen: Piece, other: Piece) -> Piece {
  return Piece(
    select(other.c_in, chosen.c_in, some),
    select(other.b_in, chosen.b_in, some),
    select(other.id_in, chosen.id_in, some),
    select(other.c_out, chosen.c_out, some),
    select(other.b_out, chosen.b_out, some),
    select(other.id_out, chosen.id_out, some),
  );
}

// Tries a body on the rays from the mirrors of a block.
fn try_body(number: u32, body: Body) {
  let last = i32(body.face_count) + 1;
  // each quad
  let glance_0 = glance_at(body, point_0, ray_0);
  // each quad
  var piece_0 = piece_of(glance_0);
  // each quad
  var is_behind_0 = b4(false);  //? flush
  for (var k = 0u; k < body.face_count; k++) {
    let face = face_at(body.face_start + k);
    // each quad
    {
      // A ray from a face leaves it, or is inside it all along.
      let on = nearest_0.surface == u4(body.surface + k + 1u);
      let line = face_of(face, glance_0);
      let beyond = Line(select(line.c, f4(-1.0), on), select(line.b, f4(0.0), on));
      piece_0 = clip(piece_0, beyond, i32(k) + 1);
    }
    {  //? flush
      // A solid behind the surface that mirrors a ray is not met.
      var side = side_of(body.surface + k + 1u);
      side = select(side, 0u, body.copy > 0u);  //? body_cells
      // each quad
      is_behind_0 = is_behind_0 | is_same_side(side_0, side);
    }
  }
  // each quad
  var meeting_0 = NO_MEETING;  //? body_casters
  for (var once = 0u; once < min(body.caster, 1u); once++) {  //? body_casters
    let caster = body_caster_at(body.caster - 1u);
    // each quad
    {
      var asked = glance_0.near & (gone_0 != u4(number)) & (weight_0 > f4(0.0));
      asked = asked & !is_behind_0;  //? flush
      let surface = nearest_0.surface;
      var turned = nearest_0.turned;
      var flush = b4(false);
      {  //? flush
        // What a ball ends lies behind it.
        asked = asked & !is_same_side(side_0, side_of(body.curve));
        let side = side_of(body.surface);
        flush = is_flush_with(side_0, side, b4(caster.sheet != 0u));
        flush = flush & (surface != u4(body.surface));
        turned = select(turned, turned_to(side_0, side), flush);
      }
      let passage = passage_of(caster, body, glance_0, piece_0, asked, surface, flush);
      for (var polynomial = caster.formula; polynomial < 1u; polynomial++) {  //? body_polynomials
        meeting_0 = meeting_of(caster, passage, turned);
      }
      for (var one = 0u; one < min(caster.formula, 1u); one++) {  //? body_formulas
        let form = body_formula_at(caster.formula - 1u);
        meeting_0 = meeting_of_formula(form, caster, passage, turned);
      }
      let doubt = distance_of(body, glance_0, meeting_0.begin, stay_0);
      let sure = meeting_0.sure | !may_meet(stay_0);
      spotted_0.doubt = min(spotted_0.doubt, select(doubt, f4(NO_DOUBT), sure));
    }
  }
  var copies = min(body.copy, 1u);  //? body_cells
  copies = select(copies, 0u, rounds_left < 0);  //? counted & body_cells
  for (var once = 0u; once < copies; once++) {  //? body_cells
    meet_copy(body);
  }
  // each quad
  {
    // If the ray starts on F, the root there is divided out, and a half-space is left.
    let whole = curve_of(body.second, body.slope, body.value, glance_0);
    var on_curve = nearest_0.surface == u4(body.curve);
    on_curve = on_curve | is_same_side(side_0, side_of(body.curve));  //? flush
    let rest = clip(piece_0, Line(whole.a * glance_0.start + whole.g, whole.a), last);
    let piece = either_piece(on_curve, rest, piece_0);
    let form = Form(
      select(whole.a, f4(0.0), on_curve),
      select(whole.g, f4(0.0), on_curve),
      select(whole.c, f4(-1.0), on_curve),
    );
    let outside = outside_at_entry(form, piece);
    var inside = (piece.id_in == i4(0)) & !outside;
    var root = choose(
      inside, quadric_entry(form, piece, outside), quadric_exit(form, piece, !outside)
    );
    root.hit = root.hit & glance_0.near & (gone_0 != u4(number));
    root.hit = root.hit & !is_behind_0;  //? flush
    root.surface = select(root.surface, i4(0), root.surface >= i4(last));
    var place = place_of_root(root);
    {  //? body_casters
      let has_caster = b4(body.caster > 0u);
      root.hit = select(root.hit, meeting_0.hit, has_caster);
      root.surface = select(root.surface, meeting_0.face, has_caster);
      place = select(place, meeting_0.u, has_caster);
      inside = select(inside, meeting_0.inside, has_caster);
    }
    var side = i4(0);  //? body_cells
    for (var once = 0u; once < min(body.copy, 1u); once++) {  //? body_cells
      let copy = reflected_at(body.copy - 1u);
      let seen = encounter_0;
      root.hit = seen.hit;
      root.surface = seen.cell * i4(i32(copy.surfaces)) + (seen.side >> u4(1u));
      place = seen.u;
      inside = seen.inside;
      side = seen.side;
      let doubt = distance_of(body, glance_0, seen.begin, stay_0);  //? error
      let sure = seen.sure | !may_meet(stay_0);  //? error
      let begins = select(doubt, f4(NO_DOUBT), sure);  //? error
      spotted_0.doubt = min(spotted_0.doubt, begins);  //? error
    }
    spotted_0 = spot_first(
      spotted_0,
      number,
      body,
      glance_0,
      stay_0,
      root,
      place,
      inside,
      side,  //? body_cells
    );
  }
}

// The first box from one on around a body that a ray may meet first, or else the end. A loop is
// what invocations side by side skip code by.
fn next_hull(first: u32, end: u32) -> u32 {
  var number = first;
  loop {
    // The loop is left at the end of its body: what is looked at behind the last does not matter.
    let hull = hull_at(min(number, end - 1u));
    var wanted = b4(false);
    // each quad
    {
      let c = hull.center;
      let from_middle = Vector(from_0.x - c[0], from_0.y - c[1], from_0.z - c[2]);
      stay_0 = stay_in(hull, from_middle, over_0);
      let near = may_meet(stay_0) & (stay_0.enters <= spotted_0.distance);
      wanted = wanted | (near & (gone_0 != u4(hull.body)));
    }
    let is_wanted = anywhere(wanted);
    let found = is_wanted & (hull.body > 0u);
    number = select(select(hull.next, number + 1u, is_wanted), number, found | (number >= end));
    if found | (number >= end) {
      break;
    }
  }
  return number;
}

// What the rays from the mirrors of a block meet first.
fn find_bodies() {
  let end = mirrors_at(0u).count;
  // each quad
  over_0 = over_slopes(ray_0);
  let first = next_hull(0u, end);
  for (var number = first; number < end; number++) {
    let body = hull_at(number).body;
    try_body(body, tried_at(body - 1u));
    number = next_hull(number + 1u, end) - 1u;
  }
}

// The least number above another one of a body that is met.
fn next_body(number: u32) -> u32 {
  var least = u4(NO_BODY);
  // each quad
  least = min(least, select(u4(NO_BODY), spotted_0.body, spotted_0.body > u4(number)));
  return least_number(least);
}

// Halves the roots of what was found, and looks at it.
fn catch_bodies() {
  // each quad
  root_0 = spotted_0.root;
  conveyor(MIRROR_STEPS);
  // each quad
  caught_0 = NOTHING_CAUGHT;
  // each quad
  gone_0 = u4(NO_BODY);
  // each quad
  let u_0 = f4(sight_0.position) * (1.0 / f32(1u << MIRROR_STEPS));
  let first = next_body(0u);
  for (var number = first; number < NO_BODY; number++) {
    let body = body_at(number - 1u);
    let is_flat = b4((body.flags & SHADE_FLAT) != 0u);
    // each quad
    var slope_0 = NO_VECTOR;
    for (var k = 0u; k < body.face_count; k++) {
      let normal = normal_of_face(face_at(body.face_start + k));
      // each quad
      slope_0 = either(spotted_0.surface == u4(body.surface + k + 1u), normal, slope_0);
    }
    // each quad
    let glance_0 = glance_at(body, point_0, ray_0);
    // each quad
    var at_0 = further(glance_0.base, glance_0.along, u_0);
    // each quad
    at_0 = further(  //? body_cells
      glance_0.base, glance_0.along, select(u_0, spotted_0.place, b4(body.copy > 0u))
    );
    for (var once = 0u; once < min(body.caster, 1u); once++) {  //? body_casters
      let caster = body_caster_at(body.caster - 1u);
      // each quad
      {
        at_0 = further(glance_0.base, glance_0.along, spotted_0.place);
        let on_f = spotted_0.surface == u4(body.surface);
        for (var polynomial = caster.formula; polynomial < 1u; polynomial++) {  //? body_polynomials
          slope_0 = either(on_f, bend_at(caster, at_0), slope_0);
        }
        for (var one = 0u; one < min(caster.formula, 1u); one++) {  //? body_formulas
          let form = body_formula_at(caster.formula - 1u);
          slope_0 = either(on_f, slope_in_body(form, caster, at_0), slope_0);
        }
      }
    }
    // each quad
    {
      let mine = spotted_0.body == u4(number);
      let on_curve = spotted_0.surface == u4(body.curve);
      let on_f = spotted_0.surface == u4(body.surface);
      let bend = gradient_of(body.second, body.slope, at_0);
      var left = is_left(body.flags, on_f, spotted_0.turned);
      left = left & b4(body.copy == 0u);  //? body_cells
      gone_0 = select(gone_0, select(u4(NO_BODY), u4(number), left), mine);
      let color = Vector(f4(body.color[0]), f4(body.color[1]), f4(body.color[2]));
      caught_0 = Caught(
        either_point(mine, point_on(body, at_0), caught_0.point),
        either(mine, either(on_curve, bend, slope_0), caught_0.slope),
        Finish(
          either(mine, color, caught_0.material.color),
          select(caught_0.material.specular, f4(body.specular), mine),
          select(caught_0.material.shininess, u4(body.shininess), mine),
        ),
        select(caught_0.reflection, f4(body.reflection), mine),
      );
    }
    var copies = min(body.copy, 1u);  //? body_cells
    copies = select(copies, 0u, rounds_left < 0);  //? counted & body_cells
    for (var once = 0u; once < copies; once++) {  //? body_cells
      look_at_copy(number, body);
    }
    number = next_body(number) - 1u;
  }
}

// The light that mirrors add to the colours of a block, bounce after bounce.
fn follow_mirrors(
  j: i32,
  place: u32,  // of the block's words  //? continued
) {
  let mirrors = mirrors_at(0u);
  // each quad
  {
    ray_0 = ray_direction(f4(i_0), f32(j));
    ray_0 = Vector(f4(frame.forward.x), f4(frame.forward.y), f4(frame.forward.z));  //? parallel
    caught_0 = NOTHING_CAUGHT;
    caught_0.slope = nearest_0.slope;
    weight_0 = select(f4(0.0), weight_0, nearest_0.surface > u4(0u));
    light_0 = scaled(light_0, f4(1.0) - weight_0);
  }
  for (var bounce = 0u; bounce < BOUNCES; bounce++) {
    // each quad
    {
      let back = Vector(-ray_0.x, -ray_0.y, -ray_0.z);
      ray_0 = mirrored(ray_0, normalized(or_else(caught_0.slope, back)));
      from_0 = Vector(f4(point_0.x), f4(point_0.y), f4(point_0.z));
      spotted_0 = NOTHING_SPOTTED;
      // Nothing is near enough where there is no ray.
      spotted_0.distance = select(f4(-3e38), f4(3e38), weight_0 > f4(0.0));
    }
    find_sides();  //? flush
    find_bodies();
    // each quad
    vague_0 = vague_0 | (spotted_0.doubt <= spotted_0.distance);  //? placed & error
    catch_bodies();
    // each quad
    {
      nearest_0.surface = spotted_0.surface;
      nearest_0.turned = spotted_0.turned;
      nearest_0.met = Met(u4(NO_REGION), spotted_0.side, i4(0));  //? body_cells
      nearest_0.dark = u4(0u);  //? shadows
      nearest_0.dark = stored(PLANE_MIRRORED + bounce, place + QUAD_0);  //? continued
      point_0 = caught_0.point;
    }
    find_shadows();  //? shadows
    // each quad
    {  //? continued
      // Without some cells, mirrors may show other points.
      let old = stored(PLANE_MIRRORED + bounce, place + QUAD_0);
      let dark = select(old, nearest_0.dark, rounds_left >= 0);
      store(PLANE_MIRRORED + bounce, place + QUAD_0, dark);
    }
    // each quad
    {
      let back = Vector(-ray_0.x, -ray_0.y, -ray_0.z);
      let normal = normalized(or_else(caught_0.slope, back));
      let place = Vector(
        mirrors.middle[0] + f4(point_0.x) * mirrors.unit,
        mirrors.middle[1] + f4(point_0.y) * mirrors.unit,
        mirrors.middle[2] + f4(point_0.z) * mirrors.unit,
      );
      var dark = u4(0u);
      dark = nearest_0.dark;  //? shadows
      let lit = shade(normal, ray_0, place, caught_0.material, dark);
      let some = nearest_0.surface > u4(0u);
      let b = frame.background;
      let shown = either(some, lit, Vector(f4(b.x), f4(b.y), f4(b.z)));
      // The last mirror shows only its own colour.
      let share = select(caught_0.reflection, f4(0.0), b4(bounce + 1u >= BOUNCES));
      let passed_on = seen(weight_0 * share);
      let own = scaled(shown, weight_0 - passed_on);
      light_0 = Vector(
        light_0.x + seen(own.x),
        light_0.y + seen(own.y),
        light_0.z + seen(own.z),
      );
      weight_0 = passed_on;
    }
    // A ray without weight ends.
    var left = b4(false);
    // each quad
    left = left | (weight_0 > f4(0.0));
    if !anywhere(left) {
      break;
    }
  }
}
