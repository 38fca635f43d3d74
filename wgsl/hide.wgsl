// An occluder -> the pixels from which it hides the light, or whose quadric turns away from it.
//
// All solids run the same code. A solid without a quadric has F = -1. A bounded plane is the piece
// between two half-spaces.

// The rays from points to the light of an occluder.
fn rays_to_light(occluder: Occluder, point: Point) -> Ray {
  let c = occluder.center;
  let from_center = point_from(point, c[0], c[1], c[2]);
  let beam = beam_of(from_center, occluder.axis, occluder.sign, occluder.shear_x, occluder.shear_y);
  var ray = far_ray(beam, occluder);
  ray = light_ray(beam, occluder);  //? lamps
  return ray;
}

// F along rays to the light.
fn curve_to_light(occluder: Occluder, ray: Ray) -> Form {
  var form = far_curve(occluder, ray);
  form = curve_along(occluder, ray);  //? lamps
  return form;
}

// Sets the bit of the light where the quadric of an occluder shows the side turned away from it.
fn turn_away(occluder: Occluder) {
  let at_lamp = (occluder.flags & SHADE_AT_LAMP) != 0u;
  // each quad
  {
    let ray = rays_to_light(occluder, point_0);
    let rest = rest_of(curve_to_light(occluder, ray), ray, at_lamp);
    let away = is_away(starts_beyond(rest, whole_ray(ray)), nearest_0.turned);
    let on_curve = nearest_0.surface == u4(occluder.curve);
    nearest_0.dark |= select(u4(0u), u4(occluder.bit), on_curve & away);
  }
}

// Sets the bit of the light where an occluder hides it.
fn hide(occluder: Occluder) {
  let at_lamp = (occluder.flags & SHADE_AT_LAMP) != 0u;
  let casts = (occluder.flags & SHADE_CASTS) != 0u;
  let is_flat = (occluder.flags & SHADE_FLAT) != 0u;
  // The surface of a bounded plane has the number of its first side.
  let surface = occluder.first - select(0u, 1u, is_flat);
  // each quad
  let ray_0 = rays_to_light(occluder, point_0);
  // each quad
  var piece_0 = whole_ray(ray_0);
  // each quad
  var leaves_0 = b4(false);  //? encloses
  // each quad
  var is_flush_0 = b4(false);  //? flush
  for (var k = 0u; k < occluder.slab_count; k++) {
    let slab = slab_at(occluder.slab_start + k);
    let both = second_number(slab) != 0u;
    var side = 0u;  //? flush
    var opposite = 0u;  //? flush
    {  //? flush
      side = side_of(surface + first_number(slab));
      opposite = side_of(select(0u, surface + second_number(slab), both));
    }
    // each quad
    {
      var line = far_slab(slab, ray_0);
      line = slab_along(slab, ray_0);  //? lamps
      let other = second_along(slab, line, ray_0);
      {  //? encloses
        var on_first = nearest_0.surface == u4(surface + first_number(slab));
        var on_second = nearest_0.surface == u4(surface + second_number(slab));
        on_first = on_first | is_same_surface(side_0, side);  //? flush
        on_second = on_second | is_same_surface(side_0, opposite);  //? flush
        let whole = whole_ray(ray_0);
        let first = (starts_beyond(line, whole) & !on_first) | ends_beyond(line, whole);
        let second = (starts_beyond(other, whole) & !on_second) | ends_beyond(other, whole);
        leaves_0 = leaves_0 | first | (second & b4(both));
      }
      piece_0 = between(piece_0, line, other, both);
      // A solid behind the surface of the point does not hide the light before it.
      is_flush_0 = is_flush_0 | is_same_side(side_0, side);  //? flush
      is_flush_0 = is_flush_0 | is_same_side(side_0, opposite);  //? flush
    }
  }
  // each quad
  var sheet_0 = b4(false);  //? casters
  // each quad
  var cast_0 = Cast(b4(false), b4(true), b4(false), b4(true));  //? casters
  // each quad
  var beside_0 = b4(false);  //? casters & flush
  for (var one = 0u; one < min(occluder.caster, 1u); one++) {  //? casters
    let caster = caster_at(occluder.caster - 1u);
    // each quad
    {
      let own = is_own(nearest_0.surface, occluder.first, occluder.count);
      let on_f = own & (nearest_0.surface == u4(surface));
      let encloses = b4((occluder.flags & SHADE_ENCLOSES) != 0u);
      let asked = (nearest_0.surface > u4(0u)) & (!own | on_f | encloses);
      var flush = b4(false);
      var turned = nearest_0.turned;
      {  //? flush
        let side = side_of(surface);
        flush = !own & is_flush_with(side_0, side, encloses | b4(caster.sheet != 0u));
        turned = select(turned, turned_to(side_0, side), flush);
      }
      let rest = rest_of_ray(caster, occluder, ray_0, piece_0, asked, on_f, flush);
      beside_0 = flush & rest.on_curve;  //? flush
      for (var polynomial = caster.formula; polynomial < 1u; polynomial++) {  //? cast_polynomials
        cast_0 = cast_of(caster, rest, encloses, rest.on_curve, turned);
      }
      for (var once = 0u; once < min(caster.formula, 1u); once++) {  //? cast_formulas
        let form = cast_formula_at(caster.formula - 1u);
        cast_0 = cast_formula_of(form, caster, rest, encloses, rest.on_curve, turned);
      }
      // Both sides of a sheet are outer sides.
      sheet_0 = b4(caster.sheet != 0u);
    }
  }
  // each quad
  {
    let own = is_own(nearest_0.surface, occluder.first, occluder.count);
    var again = b4(false);
    var hidden = remains(piece_0) & ray_0.near;
    {  //? curves
      let form = curve_to_light(occluder, ray_0);
      let rest = rest_of(form, ray_0, at_lamp);
      var on_curve = own & (nearest_0.surface == u4(occluder.curve));
      var begins = on_curve;  //? encloses
      {  //? flush
        let side = side_of(occluder.curve);
        let curved = is_same_side(side_0, side);
        on_curve = on_curve | curved;
        begins = on_curve | is_same_surface(side_0, side);  //? encloses
        is_flush_0 = is_flush_0 | curved;
      }
      let may_meet_again = b4((occluder.flags & SHADE_SELF) != 0u);
      again = on_curve & may_meet_again & is_met_again(rest, piece_0);
      hidden = is_met(form, piece_0) & ray_0.near;
      leaves_0 = leaves_0 | comes_out(form, rest, whole_ray(ray_0), begins);  //? encloses
    }
    var enclosed = b4(!is_flat);
    {  //? casters
      let is_caster = b4(occluder.caster != 0u);
      let on_f = own & is_caster & (nearest_0.surface == u4(surface));
      let away = on_f & is_away(cast_0.faces, nearest_0.turned);
      nearest_0.dark |= select(u4(0u), u4(occluder.bit), away);
      var begins = on_f;
      begins = on_f | beside_0;  //? flush
      again = select(again, cast_0.met, begins);
      is_flush_0 = is_flush_0 | beside_0;  //? flush
      hidden = select(hidden, cast_0.met, is_caster);
      leaves_0 = leaves_0 | cast_0.met;  //? encloses
      unsure_0 = unsure_0 | (!cast_0.sure & b4(casts)) | (on_f & !cast_0.faced);  //? error
      enclosed = select(enclosed, again, sheet_0);
    }
    hidden = select(hidden, again, is_flush_0);  //? flush
    let encloses = b4((occluder.flags & SHADE_ENCLOSES) != 0u);  //? encloses
    hidden = select(hidden, leaves_0, encloses);  //? encloses
    enclosed = enclosed & (leaves_0 | !encloses);  //? encloses
    hidden = select(hidden, is_hidden(nearest_0.turned, again, enclosed), own);
    nearest_0.dark |= select(u4(0u), u4(occluder.bit), hidden & b4(casts));
  }
}
