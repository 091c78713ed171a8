// The lower quarter of a cylinder of radius 50 mm, x >= 0; it touches the plane y = 0 in (0, 0).
// gmsh -2 -format msh41 cylinder.geo -o cylinder.msh
mm = 1e-3;
R = 50*mm;
fine = 0.08*mm;       // at the contact: about 13 elements over the expected half-width of 1.04 mm
coarse = 5*mm;
Point(1) = {0, 0, 0, fine};
Point(2) = {R*Sin(4*Pi/180), R - R*Cos(4*Pi/180), 0, 0.3*mm};  // 4 degrees: 3.5 mm, beyond the contact
Point(3) = {R, R, 0, coarse};
Point(4) = {0, R, 0, coarse};
Point(5) = {0, R, 0};                       // the centre, for the arcs only
Circle(1) = {1, 5, 2};
Circle(2) = {2, 5, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1:4};
Plane Surface(1) = {1};
Physical Surface("steel") = {1};
Physical Curve("tread") = {1};              // what may come into contact
Physical Curve("load") = {3};
Physical Curve("axis") = {4};
// Elements as small as at the tip over the whole contact, then growing with the distance.
Field[1] = Box;
Field[1].XMin = 0;
Field[1].XMax = 1.4*mm;
Field[1].YMin = 0;
Field[1].YMax = 0.15*mm;
Field[1].VIn = fine;
Field[1].VOut = coarse;
Field[1].Thickness = 40*mm;
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
Mesh.Algorithm = 6;
Mesh.Binary = 0;
