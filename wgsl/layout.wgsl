// Records and constants that host and device share, as `make layout` writes them.

const TILE: u32 = 16u;
const LANES: u32 = 4u;
const FLAG_EYE_INSIDE: u32 = 1u;
const FLAG_STARTS_AT_EYE: u32 = 2u;
const FLAG_EYE_OUTSIDE_QUADRIC: u32 = 4u;
const FLAG_NEAR_CUT: u32 = 8u;
const FLAG_EYE_SURE: u32 = 16u;
const FLAG_RECHECKED: u32 = 32u;
const SHADE_CASTS: u32 = 1u;
const SHADE_AT_LAMP: u32 = 2u;
const SHADE_ENCLOSES: u32 = 4u;
const SHADE_FLAT: u32 = 8u;
const SHADE_CONVEX: u32 = 16u;
const SHADE_SELF: u32 = 32u;
const ROW_BITS: u32 = 22u;
const PIECE_BITS: u32 = 5u;
const PIECES: u32 = 32u;
const SLAB_BITS: u32 = 16u;

// Values that all pixels of a band share.
struct Frame {
  @align(32) first_ray: vec4<f32>,  // world direction through pixel (0, 0), or its start
  right: vec4<f32>,  // change of first_ray to the next pixel on the right
  down: vec4<f32>,  // change of first_ray to the next row
  ambient: vec4<f32>,  // linear RGB
  background: vec4<f32>,  // linear RGB
  first_row: i32,  // first picture row of the band
  row_quads: u32,  // groups of four pixels in a row of the band
  plane_quads: u32,  // groups of four pixels in the whole band
  forward: vec4<f32>,  // direction of all rays, if they are parallel
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
  spare: u32,  // bits of the key below a last step
  flags: u32,  // FLAG_… bits
  surface: u32,  // number of its first surface in the scene, from 1
  plane_start: u32,  // its first half-space
  plane_count: u32,  // number of its half-spaces
  color: array<f32, 3>,  // color of its material, linear RGB
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

// An excerpt: the part of a copy of a group that some tiles see; grid points are 0 to 2^n.
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
  surfaces: u32,  // surfaces of its group, planes first
  planes: u32,  // planes among them
  flat_start: u32,  // its first plane
  curved_start: u32,  // its first quadric
  looks_start: u32,  // appearance of its first cell; its surfaces follow
  cells: u32,  // cells that its group shows
  list_start: u32,  // its list: numbers of planes, of quadrics, of cells
  flat_count: u32,  // planes in the list
  curved_count: u32,  // quadrics in the list
  cell_count: u32,  // cells in the list
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

// The appearance of a cell, or of a face that a surface cuts.
struct Appearance {
  @align(32) color: array<f32, 3>,  // linear RGB
  specular: f32,  // weight of the highlight
  shininess: u32,  // exponent of the highlight
  reflection: f32,  // share of what it mirrors
  is_own: u32,  // 0 for a surface with the appearance of the cell, else 1
}

// The polynomial of a solid or of a surface: F = Σ term (u - middle)^j x^a y^b.
struct Polynomial {
  @align(32) host_error: f32,  // error of F from the set-up, in its units; in integers, all
  rounding: f32,  // error of F from rounding, of the sum of all |terms|
  middle: f32,  // u about which F is expanded
  scale: f32,  // scale of pixel offsets, so that |x| and |y| are at most 1
  shift: u32,  // it is 2^-shift
  left: i32,  // least offset of its rectangle
  right: i32,  // greatest offset
  top: i32,  // least offset down
  bottom: i32,  // greatest offset down
  sheet: u32,  // 1 if F = 0 is shown from both sides, else 0
  ball: u32,  // number of the ball that bounds it, behind planes; 0 for none
  axes: array<f32, 9>,  // unit vectors of the camera, world: right, down, forward
  tangents: array<f32, 3>,  // tangents: right and down at x = y = 0; of x or y = 1
  stretch: array<f32, 2>,  // width of x = 1 in halves of the interval: in the middle; per u
  terms: array<Length, TERMS>,  // as gpu/contract/powers.py orders them
}

// A surface of a region whose order is above two; its form has a record of its own.
struct Higher {
  @align(32) form: u32,  // its row among the polynomials, or among the formulas
  pairs: u32,  // the most intervals of grid points in which F <= 0
  center_x: i32,  // pixel where its x = 0
  center_y: i32,  // pixel where its y = 0
  first: i32,  // the first leaf in which a ray may cross it
  start: f32,  // u where that leaf begins
  stop: f32,  // u behind which it is not crossed
  eye: u32,  // EYE_…: what is known of F at the eye
  is_formula: u32,  // 1 if its form is a formula that is no polynomial, else 0
  low: array<f32, 3>,  // least local coordinates within the bounds of such a formula
  high: array<f32, 3>,  // greatest local coordinates
}

// The formula of a solid or surface. A ray's points are level + u along, in local coordinates.
struct Expression {
  @align(32) host_error: f32,  // error of points from the set-up
  scale: f32,  // scale of pixel offsets, so that |x| and |y| are at most 1
  left: i32,  // least offset of its rectangle
  right: i32,  // greatest offset
  top: i32,  // least offset down
  bottom: i32,  // greatest offset down
  sheet: u32,  // 1 if F = 0 is shown from both sides, else 0
  ball: u32,  // number of the ball that bounds it, behind planes; 0 for none
  formula: u32,  // number of its formula in the scene
  value_error: f32,  // error of the values of arcs, if its formula is tame
  slope_error: f32,  // error of their slopes, for each half width of a cell
  bend_error: f32,  // error of their bends, for its square
  level_x: array<f32, 3>,  // local coordinate at u = 0: coefficients of 1, x, y
  level_y: array<f32, 3>,  // the same
  level_z: array<f32, 3>,  // the same
  along_x: array<f32, 3>,  // its change to u = 1, likewise
  along_y: array<f32, 3>,  // the same
  along_z: array<f32, 3>,  // the same
  axes: array<f32, 9>,  // world from local
  numbers: array<f32, NUMBERS>,  // numbers of the formula, in the order of operations
}

// Positions of the points of a visible solid on the grid of the world, before a shift.
struct Location {
  @align(32) level: array<Length, 9>,  // the point at u = 0, from the anchor: [1, x, y][axis]
  along: array<Length, 9>,  // its change to u = 1: [1, x, y][axis]
  anchor: array<i32, 3>,  // the anchor, on the grid
  shift: u32,  // bits of the integers below a unit of the grid
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

// A light with shadows: axes along its rays, or its position; and its occluders.
struct LightView {
  @align(32) bit: u32,  // its bit in the output shadow
  axis: u32,  // the axis of the world closest to its rays
  sign: i32,  // 1 if the axis points to a far light or away from a lamp, else -1
  shear_x: i32,  // how far rays go along the next axis, in 2^-30
  shear_y: i32,  // the same along the axis after the next
  origin: array<i32, 3>,  // position of a lamp on the grid
  first: u32,  // its first occluder
  end: u32,  // the occluder behind its last
  groups: u32,  // box of its first group of occluders
  far_groups: u32,  // box of its first group of groups
  sides: u32,  // how many sides there are
}

// An occluder, a solid that may hide a light: F and half-spaces along rays to the light.
struct Occluder {
  @align(32) a: array<Value, 6>,  // A as coefficients of tz, tx, ty, x², xy, y²; for A, t is z
  g: array<Value, 6>,  // G
  c: array<Value, 6>,  // C; for C, z is t
  end: Value,  // 1/v where the ray ends: at a lamp, or behind the solid
  unit: f32,  // one over the radius, in units of the grid
  level: u32,  // the radius is 2^level units
  center: array<i32, 3>,  // on the grid
  axis: u32,  // the axis of the world closest to rays to the light; as LightView
  sign: i32,  // the same
  shear_x: i32,  // the same
  shear_y: i32,  // the same
  reach: i32,  // how far a lamp is along the axis, in units of the grid, or 0
  weight: f32,  // 1/reach
  factor: i32,  // the same as factor 2^-factor_shift, in 2^-28
  factor_shift: u32,  // see factor
  flags: u32,  // SHADE_… bits
  bit: u32,  // bit of the light in the output shadow
  curve: u32,  // number of the quadric among surfaces; 0 if it has none
  caster: u32,  // row of its form among casters, from 1; 0 if it has none
  first: u32,  // number of its first surface in the scene, from 1
  count: u32,  // how many surfaces it has
  slab_start: u32,  // its first slab
  slab_count: u32,  // how many it has
}

// A surface: bits of the lights that do not reach it whatever stands before them.
struct Side {
  @align(32) front: u32,  // seen from outside
  back: u32,  // seen from inside
  opened: u32,  // seen from inside, which a base plane opens
  curve: u32,  // number of its solid among occluders, from 1, if it is quadric
}

// A surface that several solids may share.
struct Shared {
  @align(32) side: u32,  // its side with F > 0, if something else has that too; else 0
  count: u32,  // how many of these records there are
}

// Half-spaces of an occluder along rays to a light: where c + b v <= 0, and >= -width t.
struct Slab {
  @align(32) c: array<Value, 3>,  // coefficients of t, x, y
  b: array<Value, 3>,  // coefficients of z, x, y
  width: Value,  // distance of the two half-spaces, as a coefficient of t
  numbers: u32,  // the numbers of its two surfaces, SLAB_BITS each
}

// The form of an occluder or a body of an order above two, and its coordinates along rays.
struct Caster {
  @align(32) level: array<f32, 3>,  // of the middle, or of a lamp that is near; the box is -1 to 1
  by_x: array<f32, 3>,  // their changes for a radius: first axis across rays to a light, or x
  by_y: array<f32, 3>,  // the same: second axis, or y
  by_v: array<f32, 3>,  // the same: along the rays, or z
  shrink: f32,  // 1/v where the rays meet, at a lamp; else 0
  rounding: f32,  // error of F from rounding, of the sum of all |terms|
  sheet: u32,  // 1 if F = 0 is shown from both sides, else 0
  ball: u32,  // 1 if its quadric is a ball that bounds it, else 0
  formula: u32,  // row of its formula, from 1; 0 if it is a polynomial
  center: array<f32, 3>,  // middle of the box in its own coordinates, of a formula
  size: array<f32, 3>,  // half the box, likewise
  pairs: u32,  // of a surface of a copy: the most stretches in which F <= 0
  off: array<f32, 3>,  // error of F from the terms of each coordinate, over `rounding`
  terms: array<f32, CASTER_TERMS>,  // as gpu/contract/powers.py orders them
}

// The veils of a light with shadows.
struct VeilView {
  @align(32) first: u32,  // its first veil
  end: u32,  // the one behind its last
}

// A veil: the part of a copy of a group that a bundle of rays to a light may hit.
struct Veil {
  @align(32) low: array<f32, 2>,  // their least a and b over h, in radii
  high: array<f32, 2>,  // their greatest
  copy: u32,  // its row among the copies that hide lights
  first: i32,  // grid point before which it has nothing
  last: i32,  // grid point behind which it has nothing
  flat_start: u32,  // the first plane of the copy along rays to the light
  curved_start: u32,  // its first quadric
  planes: u32,  // planes of its group
  list_start: u32,  // its list: numbers of planes, of quadrics, of others
  flat_count: u32,  // planes in the list
  curved_count: u32,  // quadrics in the list
  first_group: u32,  // where its program begins, in groups of words
  end_group: u32,  // where it ends
  higher_start: u32,  // the first form of the copy's surfaces of a higher order
  lower: u32,  // surfaces of its group before these
  higher_count: u32,  // surfaces of a higher order in the list
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

// Values that all rays from mirrors share.
struct Mirrors {
  @align(32) middle: array<f32, 3>,  // of the grid of the world, from the eye
  unit: f32,  // of the grid
  count: u32,  // boxes
}

// A solid or copy of a group that mirrors show, about its middle, along world axes, in radii.
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
  reflection: f32,  // weight of the mirror image
  curve: u32,  // number of the quadric among surfaces; 0 if it has none
  caster: u32,  // row of its form, from 1; 0 if its order is two or less
  copy: u32,  // row of its cells, from 1; 0 if it is a solid
}

// A half-space of a body: n.x + beyond <= 0.
struct Face {
  @align(32) normal: array<f32, 3>,  // n, unit
  beyond: f32,  // distance of the middle outside it
}

// The cells of a body that is a copy of a group: their program and their surfaces.
struct Reflected {
  @align(32) count: u32,  // how many numbers of surfaces the body has: cells times surfaces
  surfaces: u32,  // surfaces of its group, planes first
  planes: u32,  // planes among them
  flat_start: u32,  // its first plane, among the half-spaces of bodies
  curved_start: u32,  // its first quadric
  looks_start: u32,  // appearance of its first cell; its surfaces follow
  cells: u32,  // cells of its program
  list_start: u32,  // its list: numbers of planes, of quadrics, of others
  flat_count: u32,  // planes in the list
  curved_count: u32,  // quadrics in the list
  higher_count: u32,  // surfaces in the list of an order above two
  higher_start: u32,  // the first form of such a surface, among those of bodies
  lower: u32,  // surfaces of its group before these
  first_group: u32,  // where its program begins, in groups of words
  end_group: u32,  // where it ends
}

// A quadric of a copy of a group, about the middle of its body, as F of a body.
struct Bowl {
  @align(32) second: array<f32, 6>,  // half the second derivative of F: xx, yy, zz, xy, xz, yz
  slope: array<f32, 3>,  // half the gradient of F in the middle
  value: f32,  // F in the middle
  error: f32,  // error of F from rounding, along a ray
}

// A box around a body, or around the boxes that follow, up to `next`.
struct Hull {
  @align(32) center: array<f32, 3>,  // on the grid
  half: array<f32, 3>,  // from there to its sides, in units of the grid
  next: u32,  // the box to look at after this one if no ray meets this one
  body: u32,  // number of the body, from 1; 0 for a box around boxes
}

// The box of points that an occluder may hide from a light, in the light's axes.
struct Box {
  @align(32) low: array<f32, 3>,  // least coordinates on the grid
  high: array<f32, 3>,  // greatest
  first: u32,  // first surface from whose points it does not hide the light
  count: u32,  // how many such surfaces there are
  lit: array<f32, 4>,  // where this affine function is positive, it hides nothing
}
