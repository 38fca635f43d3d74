// The point of one solid that a ray sees, and the exit.
struct Sight {
  hit: b4,
  surface: i4,  // 0 is F, half-spaces count from 1
  position: i4,  // odd integer: u = position 2^-n
  left: b4,  // through a surface before the far base plane  //? exit
  exit_position: i4,  //? exit
}
