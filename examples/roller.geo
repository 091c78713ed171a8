// A roller of radius 10 mm on a plate, under another plate; lengths in mm (scale = 1e-3 in the case).
// gmsh -2 -format msh41 roller.geo -o roller.msh
//
// The bodies touch in (0, 0) and (0, 20) but share no points, so that Gmsh makes three meshes.
R = 10;
fine = 0.056;                        // at the contacts, whose half-widths are about 0.15 and 0.21
coarse = 2;

// The roller.
c = R*Cos(2.5*Pi/180);
d = R*Sin(2.5*Pi/180);
Point(1) = {0, R, 0};                // the centre
Point(2) = {0, 0, 0};                // a node in the middle of each contact
Point(3) = {d, R - c, 0};            // 2.5 degrees on, 0.44: beyond the contacts
Point(4) = {d, R + c, 0};
Point(5) = {0, 2*R, 0};
Point(6) = {-d, R + c, 0};
Point(7) = {-d, R - c, 0};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Circle(3) = {4, 1, 5};
Circle(4) = {5, 1, 6};
Circle(5) = {6, 1, 7};
Circle(6) = {7, 1, 2};
Curve Loop(1) = {1:6};
Plane Surface(1) = {1};

// The plates, 20 x 8.
Point(11) = {-10, -8, 0};
Point(12) = {10, -8, 0};
Point(13) = {10, 0, 0};
Point(14) = {-10, 0, 0};
Line(11) = {11, 12};
Line(12) = {12, 13};
Line(13) = {13, 14};
Line(14) = {14, 11};
Curve Loop(2) = {11:14};
Plane Surface(2) = {2};
Point(21) = {-10, 20, 0};
Point(22) = {10, 20, 0};
Point(23) = {10, 28, 0};
Point(24) = {-10, 28, 0};
Line(21) = {21, 22};
Line(22) = {22, 23};
Line(23) = {23, 24};
Line(24) = {24, 21};
Curve Loop(3) = {21:24};
Plane Surface(3) = {3};

Physical Surface("roller") = {1};
Physical Surface("lower") = {2};
Physical Surface("upper") = {3};
Physical Curve("roller-foot") = {6, 1};
Physical Curve("roller-head") = {3, 4};
Physical Curve("lower-top") = {13};
Physical Curve("lower-bottom") = {11};
Physical Curve("upper-bottom") = {21};
Physical Curve("upper-top") = {23};
Physical Curve("upper-sides") = {22, 24};

// Elements of one size over both contacts, then growing with the distance.
Field[1] = Box;
Field[1].XMin = -0.26;
Field[1].XMax = 0.26;
Field[1].YMin = -0.03;
Field[1].YMax = 0.03;
Field[1].VIn = fine;
Field[1].VOut = coarse;
Field[1].Thickness = 9;
Field[2] = Box;
Field[2].XMin = -0.26;
Field[2].XMax = 0.26;
Field[2].YMin = 2*R - 0.03;
Field[2].YMax = 2*R + 0.03;
Field[2].VIn = fine;
Field[2].VOut = coarse;
Field[2].Thickness = 9;
Field[3] = Min;
Field[3].FieldsList = {1, 2};
Background Field = 3;
Mesh.MeshSizeFromPoints = 0;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.ElementOrder = 2;
Mesh.Algorithm = 6;
Mesh.Binary = 0;
