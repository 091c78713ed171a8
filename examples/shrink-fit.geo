// A hub of 80 mm across and 40 mm wide on a shaft of 40 mm; z is the axis. Drawn apart, so that Gmsh makes two meshes
// that need not match; lengths in mm.
// gmsh -3 shrink-fit.geo -o shrink-fit.msh -format msh41
SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, -20, 0, 0, 80, 20};
Cylinder(2) = {0, 0, 0, 0, 0, 40, 40};
Cylinder(3) = {0, 0, -1, 0, 0, 42, 20};
BooleanDifference(4) = { Volume{2}; Delete; }{ Volume{3}; Delete; };
e = 1e-3;
Physical Volume("shaft") = {1};
Physical Volume("hub") = {4};
shaft() = Boundary{ Volume{1}; };
hub() = Boundary{ Volume{4}; };
// The bore reaches less far than the rim.
bore() = Surface In BoundingBox{-20 - e, -20 - e, -e, 20 + e, 20 + e, 40 + e};
ends() = Surface In BoundingBox{-20 - e, -20 - e, -20 - e, 20 + e, 20 + e, -20 + e};
far() = Surface In BoundingBox{-20 - e, -20 - e, 60 - e, 20 + e, 20 + e, 60 + e};
Physical Surface("bore") = { bore() };
Physical Surface("drive") = { far() };
seat() = shaft(); seat() -= { ends(), far() };
Physical Surface("seat") = { seat() };
sides() = Surface In BoundingBox{-41, -41, -e, 41, 41, e};
sides() += Surface In BoundingBox{-41, -41, 40 - e, 41, 41, 40 + e};
rim() = hub(); rim() -= { bore(), sides() };
Physical Surface("rim") = { rim() };
Mesh.MeshSizeMax = 5.5;
Mesh.MeshSizeFromCurvature = 28;
Mesh.Algorithm3D = 1;
