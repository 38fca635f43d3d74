// Records and constants that host and device share, as `make layout` writes them.

const TILE: u32 = 16u;
const LANES: u32 = 4u;
const FLAG_EYE_INSIDE: u32 = 1u;
const FLAG_STARTS_AT_EYE: u32 = 2u;
const FLAG_EYE_OUTSIDE_QUADRIC: u32 = 4u;
const FLAG_NEAR_CUT: u32 = 8u;
const FLAG_EYE_SURE: u32 = 16u;
const SHADE_CASTS: u32 = 1u;
const SHADE_AT_LAMP: u32 = 2u;
const SHADE_ENCLOSES: u32 = 4u;
const SHADE_FLAT: u32 = 8u;
const SHADE_CONVEX: u32 = 16u;
const SLAB_BITS: u32 = 15u;
const SLAB_LIT: u32 = 1073741824u;

// What all pixels of a band share.
struct Frame {
  @align(32) first_ray: vec4<f32>,  // world direction through pixel (0, 0), or its start
  right: vec4<f32>,  // its change from one pixel to the next on the right
  down: vec4<f32>,  // its change from one row to the next
  ambient: vec4<f32>,  // linear RGB
  background: vec4<f32>,  // linear RGB
  first_row: i32,  // first picture row of the band
  row_quads: u32,  // groups of four pixels in a row of the band
  plane_quads: u32,  // the same in the whole band
  forward: vec4<f32>,  // direction of all rays that start in different places
}

// A visible solid: F = A u² + G u + C over its own interval of depth, u from -1 to 1.
struct Solid {
  @align(32) a: array<Coefficient, 6>,  // A as coefficients of 1, x, y, x², xy, y²
  g: array<Coefficient, 6>,  // G
  c: array<Coefficient, 6>,  // C
  host_error: f32,  // error of A, G and C from the set-up, in their units
  gradient: array<f32, 18>,  // half the gradient of F, world: [1, u][1, x, y][axis]
  center_x: i32,  // pixel where x = 0
  center_y: i32,  // pixel where y = 0
  near_u: Value,  // u of the near base plane, -ONE where it does not cut the solid
  far_u: Value,  // u of the far base plane, ONE where it does not cut the solid
  depth_middle: f32,  // planar depth at u = 0
  depth_half: f32,  // depth = depth_middle + u depth_half
  last_step: f32,  // 2^-n
  steps: u32,  // n
  key_high: u32,  // depth key at u = -1, high word
  key_low: u32,  // low word
  key_shift: u32,  // a last step is 2^key_shift units of the key
  spare: u32,  // the key has so many bits below a last step
  flags: u32,  // FLAG_… bits
  surface: u32,  // number of its first surface in the scene, from 1
  plane_start: u32,  // its first half-space
  plane_count: u32,  // how many it has
  color: array<f32, 3>,  // of its material, linear RGB
  specular: f32,  // weight of the highlight
  shininess: u32,  // exponent of the highlight
  polynomial: u32,  // its row among the polynomials, if it has one
}

// A half-space along a ray: inside where c + b u <= 0.
struct HalfSpace {
  @align(32) c: array<Coefficient, 3>,  // coefficients of 1, x, y
  b: array<Coefficient, 3>,  // the same
  normal: array<f32, 3>,  // outward unit normal, world
  host_error: f32,  // error of c and b from the set-up, in their units
}

// A light, relative to the eye.
struct Light {
  @align(32) vector: vec4<f32>,  // direction to it (w = 0) or w times its position
  color: vec4<f32>,  // linear RGB
}

// What some tiles see of a copy of a group of cells; grid points count from 0 to 2^n.
struct Region {
  @align(32) left: i32,  // first column of its rectangle
  right: i32,  // last column
  top: i32,  // first row
  bottom: i32,  // last row
  near_high: u32,  // depth key where rays start, high word
  near_low: u32,  // low word
  first: i32,  // grid point where rays start
  start_end: i32,  // last cell that may lie before the near base plane, or -1
  last: i32,  // last grid point before the far base plane
  last_sure: i32,  // the same, surely
  solid: u32,  // its row among the solids
  surfaces: u32,  // how many its group has, planes first
  planes: u32,  // how many of them are planes
  flat_start: u32,  // its first plane
  curved_start: u32,  // its first quadric
  looks_start: u32,  // appearance of its first cell; its surfaces follow
  cells: u32,  // how many its group shows
  list_start: u32,  // numbers of what counts: planes, quadrics, cells
  flat_count: u32,  // planes that count
  curved_count: u32,  // quadrics that count
  cell_count: u32,  // cells that count
  first_group: u32,  // where its program begins, in groups of words
  end_group: u32,  // where it ends
}

// A plane of a region along a ray: F = c + b u.
struct Flat {
  @align(32) c: array<Coefficient, 3>,  // coefficients of 1, x, y
  b: array<Coefficient, 3>,  // the same
  normal: array<f32, 3>,  // gradient of F, world, of unit length
  host_error: f32,  // error of c and b from the set-up, in their units
  eye: u32,  // EYE_…: what is known of F at the eye
}

// A quadric of a region along a ray: F = A u² + G u + C.
struct Curved {
  @align(32) a: array<Coefficient, 6>,  // A as coefficients of 1, x, y, x², xy, y²
  g: array<Coefficient, 6>,  // G
  c: array<Coefficient, 6>,  // C
  host_error: f32,  // error of A, G and C from the set-up, in their units
  eye: u32,  // EYE_…: what is known of F at the eye
  gradient: array<f32, 18>,  // half the gradient of F, world: [1, u][1, x, y][axis]
}

// How a cell, or a face that a surface cuts, looks.
struct Appearance {
  @align(32) color: array<f32, 3>,  // linear RGB
  specular: f32,  // weight of the highlight
  shininess: u32,  // exponent of the highlight
  is_own: u32,  // 0 of a surface that looks as the cell does, else 1
}

// What a solid that a polynomial bounds has besides: F = Σ term (u - middle)^j x^a y^b.
struct Polynomial {
  @align(32) host_error: f32,  // error of F from the set-up, in its units
  rounding: f32,  // error of F from rounding, of the sum of all |terms|
  middle: f32,  // u about which F is expanded: u - middle is taken to powers
  scale: f32,  // of pixel offsets: x and y, which are at most 1
  left: i32,  // least offset of its rectangle
  right: i32,  // greatest offset
  top: i32,  // least offset down
  bottom: i32,  // greatest offset down
  sheet: u32,  // 1 if F = 0 is shown from both sides, else 0
  ball: u32,  // number of the ball that bounds it, behind planes; 0 for none
  axes: array<f32, 9>,  // unit vectors of the camera, world: right, down, forward
  tangents: array<f32, 3>,  // of the ray at x = y = 0, right and down; of x or y = 1
  stretch: array<f32, 2>,  // width of x = 1 in halves of the interval: in the middle; per u
  terms: array<f32, TERMS>,  // as gpu/contract/powers.py orders them
}

// What a surface of a region of an order above two has besides its polynomial.
struct Higher {
  @align(32) polynomial: u32,  // its row among the polynomials
  pairs: u32,  // of grid points between which F <= 0 holds, at most
  center_x: i32,  // pixel where its x = 0
  center_y: i32,  // pixel where its y = 0
  first: i32,  // the leaf where it may be crossed first
  start: f32,  // u where that begins
  stop: f32,  // u behind which it is not crossed
  eye: u32,  // EYE_…: what is known of F at the eye
}

// What a solid that a formula bounds has besides: points of rays are level + u along.
struct Expression {
  @align(32) host_error: f32,  // error of points from the set-up
  scale: f32,  // of pixel offsets: x and y, which are at most 1
  left: i32,  // least offset of its rectangle
  right: i32,  // greatest offset
  top: i32,  // least offset down
  bottom: i32,  // greatest offset down
  sheet: u32,  // 1 if F = 0 is shown from both sides, else 0
  ball: u32,  // number of the ball that bounds it, behind planes; 0 for none
  formula: u32,  // which of the scene's
  level_x: array<f32, 3>,  // local coordinate at u = 0: coefficients of 1, x, y
  level_y: array<f32, 3>,  // the same
  level_z: array<f32, 3>,  // the same
  along_x: array<f32, 3>,  // its change to u = 1, likewise
  along_y: array<f32, 3>,  // the same
  along_z: array<f32, 3>,  // the same
  axes: array<f32, 9>,  // world from local
  numbers: array<f32, NUMBERS>,  // of the formula, in the order of its operations
}

// Where the points of a visible solid are on the grid of the world, before a shift.
struct Location {
  @align(32) level: array<Length, 9>,  // the point at u = 0, from the anchor: [1, x, y][axis]
  along: array<Length, 9>,  // its change to u = 1: [1, x, y][axis]
  anchor: array<i32, 3>,  // on the grid
  shift: u32,  // integers have so many bits below a unit of the grid
  center_x: i32,  // pixel where x = 0
  center_y: i32,  // pixel where y = 0
  steps: u32,  // n
  last_step: f32,  // 2^-n
  surface: u32,  // number of the solid's first surface in the scene, from 1
  count: u32,  // how many surfaces it has
  reflection: f32,  // share of what it mirrors
  body: u32,  // number of the solid among bodies, from 1
  flags: u32,  // SHADE_… bits
}

// A light with shadows: axes along its rays, or its place; and what may hide it.
struct LightView {
  @align(32) bit: u32,  // of the light in the output shadow
  axis: u32,  // axis of the world that is most along its rays
  sign: i32,  // 1 if that points to a light far away, or from a lamp, else -1
  shear_x: i32,  // how far rays go along the next axis, in 2^-30
  shear_y: i32,  // and along the one after that
  origin: array<i32, 3>,  // where a lamp is on the grid
  first: u32,  // its first occluder
  end: u32,  // the one behind its last
  groups: u32,  // box of its first group of occluders
  far_groups: u32,  // box of its first group of groups
}

// A solid before a light: F and half-spaces along rays to the light.
struct Occluder {
  @align(32) a: array<Value, 6>,  // A as coefficients of tz, tx, ty, x², xy, y²; for A, t is z
  g: array<Value, 6>,  // G
  c: array<Value, 6>,  // C; for C, z is t
  end: Value,  // 1/v where the ray ends: at a lamp, or behind the solid
  unit: f32,  // one over the radius, in units of the grid
  level: u32,  // the radius is 2^level units
  center: array<i32, 3>,  // on the grid
  axis: u32,  // of the world, most along rays to the light; as of LightView
  sign: i32,  // the same
  shear_x: i32,  // the same
  shear_y: i32,  // the same
  reach: i32,  // how far a lamp is along the axis, in units of the grid, or 0
  weight: f32,  // 1/reach
  factor: i32,  // the same as factor 2^-factor_shift, in 2^-28
  factor_shift: u32,  // see factor
  flags: u32,  // SHADE_… bits
  surface: u32,  // number of F among surfaces; those of its half-spaces follow
  first: u32,  // number of its first surface in the scene, from 1
  count: u32,  // how many surfaces it has
  slab_start: u32,  // its first slab
  slab_count: u32,  // how many it has
}

// Half-spaces of an occluder along rays to a light: where c + b v <= 0, and >= -width t.
struct Slab {
  @align(32) c: array<Value, 3>,  // coefficients of t, x, y
  b: array<Value, 3>,  // coefficients of z, x, y
  width: Value,  // of what is between the two
  numbers: u32,  // SLAB_… bits: what surfaces they are, and if the light is outside
}

// What hides a light with shadows of copies of groups.
struct VeilView {
  @align(32) first: u32,  // its first veil
  end: u32,  // the one behind its last
}

// What rays to a light that are close together meet of a copy of a group.
struct Veil {
  @align(32) low: array<f32, 2>,  // their least a and b over h, in radii
  high: array<f32, 2>,  // their greatest
  copy: u32,  // its row among the copies before lights
  first: i32,  // grid point before which is nothing of it
  last: i32,  // grid point behind which is nothing
  flat_start: u32,  // the first plane of the copy along rays to the light
  curved_start: u32,  // its first quadric
  planes: u32,  // how many planes its group has
  list_start: u32,  // numbers of what counts: planes, quadrics
  flat_count: u32,  // planes that count
  curved_count: u32,  // quadrics that count
  first_group: u32,  // where its program begins, in groups of words
  end_group: u32,  // where it ends
}

// A plane of a copy along rays to a light: F = c + b v.
struct VeilFlat {
  @align(32) c: array<Value, 3>,  // coefficients of t, x, y
  b: array<Value, 3>,  // coefficients of z, x, y
}

// A quadric of a copy along rays to a light: F = A v² + G v + C.
struct VeilCurved {
  @align(32) a: array<Value, 6>,  // A as coefficients of tz, tx, ty, x², xy, y²; for A, t is z
  g: array<Value, 6>,  // G
  c: array<Value, 6>,  // C; for C, z is t
}

// What all rays from mirrors share.
struct Mirrors {
  @align(32) middle: array<f32, 3>,  // of the grid of the world, from the eye
  unit: f32,  // of the grid
  count: u32,  // balls
}

// A solid as a ray from a mirror meets it, about its middle along the world's axes, in radii.
struct Body {
  @align(32) second: array<f32, 6>,  // half the second derivative of F: xx, yy, zz, xy, xz, yz
  slope: array<f32, 3>,  // half the gradient of F in the middle
  value: f32,  // F in the middle
  flags: u32,  // SHADE_… bits
  surface: u32,  // number of F among surfaces; those of its half-spaces follow
  face_start: u32,  // its first half-space
  face_count: u32,  // how many it has; a bounded plane has two
  center: array<i32, 3>,  // the middle, on the grid
  unit: f32,  // one over the radius, in units of the grid; a power of two
  bound: f32,  // how large its ball is, in that radius; at most 1
  color: array<f32, 3>,  // of its material, linear RGB
  specular: f32,  // weight of the highlight
  shininess: u32,  // exponent of the highlight
  reflection: f32,  // share of what it mirrors
}

// A half-space of a body: n.x + beyond <= 0.
struct Face {
  @align(32) normal: array<f32, 3>,  // n, unit
  beyond: f32,  // how far the middle is outside
}

// A ball around a body, or around the balls that follow, up to `next`.
struct Ball {
  @align(32) center: array<f32, 3>,  // on the grid
  radius: f32,  // in units of the grid
  next: u32,  // the ball to look at after this one if no ray meets this one
  body: u32,  // number of the body, from 1; 0 for a ball around balls
}

// Where an occluder hides a light at most, in its axes; of a lamp, as the lamp sees it.
struct Box {
  @align(32) low: array<f32, 3>,  // least coordinates on the grid
  high: array<f32, 3>,  // greatest
}
