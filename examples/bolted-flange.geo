// A pipe flange on a rigid base, held by four studs with nuts: 160 mm wide, 15 mm thick, holes with 1 mm of clearance.
// gmsh -3 bolted-flange.geo -o bolted-flange.msh -format msh41
SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, 0, 0, 0, 15, 80};
Cylinder(2) = {0, 0, 15, 0, 0, 45, 40};
Cylinder(3) = {0, 0, 0, 0, 0, 60, 30};
BooleanUnion(4) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
cut() = {3};
For i In {0:3}
  x = 60 * Cos(i * Pi / 2);
  y = 60 * Sin(i * Pi / 2);
  Cylinder(10 + i) = {x, y, 0, 0, 0, 15, 9};
  cut() += {10 + i};
  Cylinder(20 + i) = {x, y, 0, 0, 0, 15, 8};
  Cylinder(30 + i) = {x, y, 15, 0, 0, 9, 14};
EndFor
BooleanDifference(5) = { Volume{4}; Delete; }{ Volume{cut()}; Delete; };
For i In {0:3}
  BooleanUnion(40 + i) = { Volume{20 + i}; Delete; }{ Volume{30 + i}; Delete; };
EndFor
Physical Volume("flange") = {5};
Physical Volume("studs") = {40:43};
e = 1e-3;
face() = Surface In BoundingBox {-81, -81, -e, 81, 81, e};
foot() = {};
For i In {0:3}
  x = 60 * Cos(i * Pi / 2);
  y = 60 * Sin(i * Pi / 2);
  foot() += Surface In BoundingBox {x - 8 - e, y - 8 - e, -e, x + 8 + e, y + 8 + e, e};
EndFor
face() -= foot();
Physical Surface("face") = face();
Physical Surface("feet") = foot();
level() = Surface In BoundingBox {-81, -81, 15 - e, 81, 81, 15 + e};
nut() = {};
For i In {0:3}
  x = 60 * Cos(i * Pi / 2);
  y = 60 * Sin(i * Pi / 2);
  nut() += Surface In BoundingBox {x - 14 - e, y - 14 - e, 15 - e, x + 14 + e, y + 14 + e, 15 + e};
EndFor
level() -= nut();
Physical Surface("top") = level();
Physical Surface("nuts") = nut();
Physical Surface("pipe") = Surface In BoundingBox {-81, -81, 60 - e, 81, 81, 60 + e};
Mesh.MeshSizeMax = 9;
Mesh.MeshSizeFromCurvature = 14;
Mesh.MshFileVersion = 4.1;
Mesh.Binary = 1;
