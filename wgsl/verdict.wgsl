// What integers say of a ray and a solid.

// 0 if nothing is certain, 1 if the ray surely misses the solid, else 2 and the number of the
// surface that it surely meets first.
fn verdict_of(certificate: Certificate, sight: Sight) -> u4 {
  let met = u4(sight.surface) + 2u;
  let known = select(u4(1u), met, sight.hit);
  return select(u4(0u), known, confirms(certificate, sight.hit, sight.surface));
}
