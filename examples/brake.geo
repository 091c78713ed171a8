// A brake disc, a ring of 60 and 120 mm radius and 10 mm thick about the axis z, between two pads that cover 50 degrees of
// it: a lining of 12 mm on a steel back of 5 mm. Disc and pads are drawn apart, their meshes need not match. All of them
// are extruded: wedges. Lengths in mm.
// gmsh -3 brake.geo -o brake.msh -format msh41
inside = 60; outside = 120; half = 5; low = 78; high = 114; lining = 12; back = 5;
turn = 25 * Pi / 180;
disc = 6.5; pad = 5.5;              // lengths of elements

Point(1) = {0, 0, -half};
For k In {0:3}
  Point(2 + k) = {inside * Cos(k * Pi / 2), inside * Sin(k * Pi / 2), -half, disc};
  Point(6 + k) = {outside * Cos(k * Pi / 2), outside * Sin(k * Pi / 2), -half, disc};
EndFor
For k In {0:3}
  Circle(1 + k) = {2 + k, 1, 2 + (k + 1) % 4};
  Circle(5 + k) = {6 + k, 1, 6 + (k + 1) % 4};
EndFor
Curve Loop(1) = {5:8};
Curve Loop(2) = {1:4};
Plane Surface(1) = {1, 2};
ring[] = Extrude {0, 0, 2 * half} { Surface{1}; Layers{3}; Recombine; };
Physical Volume("disc") = {ring[1]};
Physical Surface("face-lower") = {1};
Physical Surface("face-upper") = {ring[0]};
Physical Surface("hub") = {ring[6], ring[7], ring[8], ring[9]};

linings[] = {}; backs[] = {};
For side In {0:1}
  up = 2 * side - 1;                // the lower pad, then the upper one
  c = newp; Point(c) = {0, 0, up * half};
  p = newp;
  Point(p) = {low * Sin(turn), low * Cos(turn), up * half, pad};
  Point(p + 1) = {high * Sin(turn), high * Cos(turn), up * half, pad};
  Point(p + 2) = {-high * Sin(turn), high * Cos(turn), up * half, pad};
  Point(p + 3) = {-low * Sin(turn), low * Cos(turn), up * half, pad};
  k = newc;
  Line(k) = {p, p + 1};
  Circle(k + 1) = {p + 1, c, p + 2};
  Line(k + 2) = {p + 2, p + 3};
  Circle(k + 3) = {p + 3, c, p};
  l = newcl; Curve Loop(l) = {k:k + 3};
  s = news; Plane Surface(s) = {l};
  first[] = Extrude {0, 0, up * lining} { Surface{s}; Layers{3}; Recombine; };
  second[] = Extrude {0, 0, up * back} { Surface{first[0]}; Layers{1}; Recombine; };
  linings[] += first[1]; backs[] += second[1];
  If (side)
    Physical Surface("pad-upper") = {s}; Physical Surface("piston-upper") = {second[0]};
  Else
    Physical Surface("pad-lower") = {s}; Physical Surface("piston-lower") = {second[0]};
  EndIf
EndFor
Physical Volume("lining") = linings[];
Physical Volume("back") = backs[];
