// A surface along the rays -> its crossings, on one grid for all surfaces of a region.
//
// The interval of a region has 2^n cells between 2^n + 1 grid points, q from 0 (u = -1) to 2^n
// (u = 1). Only at grid points is F <= 0 asked. A root in the cell between q and q + 1 changes the
// answer at q + 1, in the same way for all regions that share the surface.

// What the host knows of F at the eye, where rays start.
const EYE_UNKNOWN: u32 = 0u;
const EYE_INSIDE: u32 = 1u;
const EYE_OUTSIDE: u32 = 2u;

// F <= 0 at the grid points low <= q < high. If both are complements, ~low and ~high, F <= 0 holds
// at the grid points outside of them.
struct Crossing {
  low: i4,
  high: i4,
}

// Whether F <= 0 outside of the two grid points, not between them.
fn is_outside(crossing: Crossing) -> b4 {
  return crossing.low < i4(0);
}

// The crossing with F <= 0 outside of two grid points, or between them.
fn turned_if(outside: b4, low: i4, high: i4) -> Crossing {
  return Crossing(select(low, ~low, outside), select(high, ~high, outside));
}

// The two grid points of a crossing, in order.
fn ends_of(crossing: Crossing) -> Crossing {
  return turned_if(is_outside(crossing), crossing.low, crossing.high);
}

// F, or -F where F is concave.
fn convex(form: Form) -> Form {
  let turned = form.a < v4(0);
  return Form(
    select(form.a, -form.a, turned),
    select(form.g, -form.g, turned),
    select(form.c, -form.c, turned),
  );
}

// The first crossing from + to - of a convex F.
fn way_in(form: Form) -> Root {
  return Root(b4(true), i4(0), form.a, form.g, form.c, b4(false));
}

// The last crossing of a convex F, from - to +, as the first crossing of F(-u).
fn way_out(form: Form) -> Root {
  return Root(b4(true), i4(0), form.a, -form.g, form.c, b4(true));
}

// The root of a plane, entered or left.
fn line_way(line: Line) -> Root {
  let rises = line.b > v4(0);
  return Root(b4(true), i4(0), v4(0), select(line.b, -line.b, rises), line.c, rises);
}

// The grid point at the end of the cell whose middle is the position.
fn point_after(position: i4, steps: u32) -> i4 {
  return ((position + i4((1i << steps) - 1)) >> u4(1u)) + i4(1);
}

// Whether F <= 0, or -F <= 0 if turned, where rays start; the host knows it at the eye.
fn begins(at_first: b4, eye: u32, turned: b4) -> b4 {
  let known = select(b4(eye == EYE_INSIDE), b4(eye == EYE_OUTSIDE), turned);
  return select(known, at_first, eye == EYE_UNKNOWN);
}

// The crossing of a quadric. `enters` and `leaves` are the positions of `way_in` and `way_out` of
// its convex form.
fn crossing(form: Form, enters: i4, leaves: i4, steps: u32, eye: u32) -> Crossing {
  let turned = form.a < v4(0);
  let bowl = convex(form);
  let bend = bowl.a + bowl.a;
  let first = begins((bowl.a - bowl.g) + bowl.c <= v4(0), eye, turned);
  let last = (bowl.a + bowl.g) + bowl.c <= v4(0);
  // F' < 0 at u = -1 and F' > 0 at u = 1.
  let turns = (bend > bowl.g) & (bowl.g > -bend) & has_root(bowl);
  let meets = first | last | turns;
  let never = i4((1i << steps) + 1);
  let low = select(point_after(enters, steps), i4(0), first);
  let high = select(point_after(leaves, steps), never, last);
  return turned_if(turned, select(never, low, meets), select(never, high, meets));
}

// The crossing of a plane; `position` is that of `line_way`.
fn line_crossing(line: Line, position: i4, steps: u32, eye: u32) -> Crossing {
  let rises = line.b > v4(0);
  let first = begins(line.c - line.b <= v4(0), eye, b4(false));
  let last = line.c + line.b <= v4(0);
  let never = i4((1i << steps) + 1);
  let after = point_after(position, steps);
  let falls_low = select(select(never, after, last), i4(0), first);
  let rises_high = select(select(never, after, first), never, last);
  return Crossing(
    select(falls_low, select(never, i4(0), first), rises),
    select(never, rises_high, rises),
  );
}

// Cells in place of the grid points where F <= 0. A cell counts if F <= 0 at one of its ends, if
// touched, else if F <= 0 at both.
fn in_cells(crossing: Crossing, touched: bool) -> Crossing {
  let outside = is_outside(crossing);
  let ends = ends_of(crossing);
  let earlier = b4(touched) != outside;
  let low = max(ends.low - select(i4(0), i4(1), earlier), i4(0));
  return turned_if(outside, low, ends.high - select(i4(1), i4(0), earlier));
}
