// The variables of an invocation for its block: quads of four pixels of a row, side by side.
//
// The code for the quads shares these variables, so that functions can work on all quads at once.
// Unlike variables of functions, they are not cleared at each call.

// Indices of the quads in the block.
const QUAD_0: u32 = 0u;
const QUAD_1: u32 = 1u;
const QUAD_2: u32 = 2u;
const QUAD_3: u32 = 3u;

// The index of the invocation among those that fetch records together.
var<private> lane: u32;
// each quad
var<private> i_0: i4;  // columns of the picture
// each quad
var<private> x_0: i4;  // columns from the middle of the solid's rectangle
// each quad
var<private> root_0: Root;  // the root that the solid shows
// each quad
var<private> leaving_0: Root;  // the exit from the solid
// each quad
var<private> sight_0: Sight;  // the sight of the solid
// each quad
var<private> slope_0: Vector;  // along the normal of the solid at the sight
// each quad
var<private> normal_in_0: Vector;  // normal of the plane where the ray enters the solid
// each quad
var<private> normal_out_0: Vector;  // normal of the plane where it leaves the solid
// each quad
var<private> certificate_0: Certificate;  // the certificate of the solid
// each quad
var<private> met_0: Met;  // of a region, nothing where the solid is none  //? regions
// each quad
var<private> turned_0: u4;  // 1 or 2 where the solid shows its other side  //? places
// each quad
var<private> nearest_0: Nearest;  // the nearest point of all solids so far
// each quad
var<private> point_0: Point;  // the same on the grid of the world  //? places
// each quad
var<private> unsure_0: b4;  // it is uncertain whether something hides a light  //? shadow_doubts
// each quad
var<private> ray_0: Vector;  // along which it is seen  //? mirrors
// each quad
var<private> from_0: Vector;  // where that begins  //? mirrors
// each quad
var<private> over_0: Vector;  // one over each component of it  //? mirrors
// each quad
var<private> stay_0: Stay;  // its way in a box  //? mirrors
// each quad
var<private> gone_0: u4;  // number of the body that it has left for good  //? mirrors
// each quad
var<private> spotted_0: Spotted;  // what it meets first so far  //? mirrors
// each quad
var<private> caught_0: Caught;  // what a mirror shows there  //? mirrors
// each quad
var<private> weight_0: f4;  // how much it adds to the colour  //? mirrors
// each quad
var<private> light_0: Vector;  // the colour so far  //? mirrors
// each quad
var<private> vague_0: b4;  // it is not certain what a mirror shows  //? placed

// Which block of its tile an invocation has, in rows, where those that skip what none of them needs
// stand together: in blocks of four pixels, eight invocations have eight pixels by four.
var<private> local: u32;  //? regions

// Finds the block of an invocation.
fn stand_together(index: u32) {
  let column = (index & 1u) + ((index >> 2u) & 2u);
  let row = ((index >> 1u) & 3u) + ((index >> 4u) << 2u);
  local = row * 4u + column;
}
