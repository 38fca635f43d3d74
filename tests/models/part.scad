// A bracket: everything that is drawn.
difference() {
  union() {
    color("steelblue") cube([40, 30, 6]);
    color("tomato") translate([20, 15, 0]) cylinder(h = 22, r1 = 12, r2 = 9);
    translate([5, 5, 6]) rotate([0, 0, 30]) cylinder(h = 8, r = 4, $fn = 6);
    translate([35, 25, 6]) scale([1, 1.5, 2]) sphere(r = 3);
    multmatrix([[1, 0, 0.4, 5], [0, 1, 0, 22], [0, 0, 1, 6], [0, 0, 0, 1]]) cube([6, 6, 10]);
  }
  translate([20, 15, -1]) cylinder(h = 40, r = 5);
  translate([30, 3, -1]) cube([6, 6, 20]);
  translate([20, 15, 16]) rotate([90, 0, 0]) cylinder(h = 60, d = 5, center = true);
}
translate([50, 5, 0]) linear_extrude(height = 10) difference() { polygon([[0, 0], [12, 0], [9, 12], [2, 10]]); translate([5, 5]) circle(r = 2); }
translate([50, 25, 0]) intersection() { cube(10); sphere(r = 11); }
translate([-12, 5, 5]) sphere(r = 5, $fn = 6);
translate([-12, 20, 0]) polyhedron(points = [[0, 0, 0], [8, 0, 0], [0, 8, 0], [0, 0, 8]], faces = [[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]]);
