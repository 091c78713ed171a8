// A bolted angle bracket: two legs 80 mm long, 60 mm wide and 16 mm thick, a fillet between them, two holes for M10
// bolts in the upright leg, the print of a machine's foot on the lying one, and below it a pad that stands on the floor.
// gmsh -3 bracket-3d.geo -o bracket-3d.msh -format msh41
SetFactory("OpenCASCADE");
length = 80; width = 60; thick = 16; fillet = 12; pad = 30; step = 3;
Point(1) = {0, 0, 0};
Point(9) = {length - pad, 0, 0};
Point(10) = {length - pad, 0, -step};
Point(2) = {length, 0, -step};
Point(3) = {length, 0, thick};
Point(4) = {thick + fillet, 0, thick};
Point(5) = {thick + fillet, 0, thick + fillet};
Point(6) = {thick, 0, thick + fillet};
Point(7) = {thick, 0, length};
Point(8) = {0, 0, length};
Line(1) = {1, 9};
Line(8) = {9, 10};
Line(9) = {10, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Circle(4) = {4, 5, 6};
Line(5) = {6, 7};
Line(6) = {7, 8};
Line(7) = {8, 1};
Curve Loop(1) = {1, 8, 9, 2:7};
Plane Surface(1) = {1};
Extrude {0, width, 0} { Surface{1}; }
Cylinder(11) = {-1, 15, 55, thick + 2, 0, 0, 5.5};
Cylinder(12) = {-1, width - 15, 55, thick + 2, 0, 0, 5.5};
BooleanDifference(2) = { Volume{1}; Delete; }{ Volume{11, 12}; Delete; };
Disk(100) = {length - pad / 2, width / 2, thick, 14};
BooleanFragments{ Volume{2}; Delete; }{ Surface{100}; Delete; }
e = 1e-3;
Physical Volume("steel") = Volume{:};
Physical Surface("pad") = Surface In BoundingBox{length - pad - e, -e, -step - e, length + e, width + e, -step + e};
Physical Surface("back") = Surface In BoundingBox{-e, -e, -e, e, width + e, length + e};
Physical Surface("holes") = { Surface In BoundingBox{-e, 9, 49, thick + e, 21, 61},
                              Surface In BoundingBox{-e, width - 21, 49, thick + e, width - 9, 61} };
Physical Surface("print") = Surface In BoundingBox{length - pad / 2 - 14.1, width / 2 - 14.1, thick - e, length - pad / 2 + 14.1, width / 2 + 14.1, thick + e};
Mesh.MeshSizeMax = 3.8;
Mesh.MeshSizeFromCurvature = 16;
Mesh.Algorithm3D = 1;
