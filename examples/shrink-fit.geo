// A hub of 80 mm across and 40 mm wide on a shaft of 40 mm; z is the axis. Drawn apart, so that Gmsh makes two meshes
// that need not match. Both are extruded: wedges and, in the hub, hexahedra. Lengths in mm.
// gmsh -3 shrink-fit.geo -o shrink-fit.msh -format msh41
seat = 20; rim = 40; width = 40; before = 20; behind = 20;

// A circle about the axis: points p .. p + 3 and curves p .. p + 3, with n elements on each quarter.
Macro Circle4
  For k In {0:3}
    Point(p + k) = {r * Cos(k * Pi / 2), r * Sin(k * Pi / 2), z, size};
  EndFor
  Point(p + 4) = {0, 0, z};
  For k In {0:3}
    Circle(p + k) = {p + k, p + 4, p + (k + 1) % 4};
  EndFor
  Transfinite Curve {p:p + 3} = n + 1;
Return

p = 1; r = seat; z = -before; size = 5; n = 9; Call Circle4;
Curve Loop(1) = {1:4};
Plane Surface(1) = {1};
shaft[] = Extrude {0, 0, before + width + behind} { Surface{1}; Layers{ {4, 8, 4}, {0.25, 0.75, 1} }; Recombine; };
Physical Volume("shaft") = {shaft[1]};
Physical Surface("seat") = {shaft[2], shaft[3], shaft[4], shaft[5]};
Physical Surface("drive") = {shaft[0]};

// The hub by quarters, with n elements around and 5 across, smaller towards the bore.
n = 7;
p = 1001; r = seat; z = 0; Call Circle4;
p = 1011; r = rim; Call Circle4;
For k In {0:3}
  Line(1021 + k) = {1001 + k, 1011 + k};
EndFor
Transfinite Curve {1021:1024} = 6 Using Progression 1.25;
hub[] = {}; bore[] = {}; around[] = {};
For k In {0:3}
  l = newcl; Curve Loop(l) = {1021 + k, 1011 + k, -(1021 + (k + 1) % 4), -(1001 + k)};
  s = news; Plane Surface(s) = {l};
  Transfinite Surface{s}; Recombine Surface{s};
  part[] = Extrude {0, 0, width} { Surface{s}; Layers{7}; Recombine; };
  hub[] += part[1]; around[] += part[3]; bore[] += part[5];
EndFor
Physical Volume("hub") = hub[];
Physical Surface("bore") = bore[];
Physical Surface("rim") = around[];
