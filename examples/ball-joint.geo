// The head of a hip joint, a ball of 28 mm across cut off 6 mm above its middle, in a cup that is open upwards: a plastic
// shell between half spheres of 28.2 and 44 mm. The middle of the cup is the origin; the ball lies on its floor.
// Lengths in mm.
// gmsh -3 ball-joint.geo -o ball-joint.msh -format msh41
SetFactory("OpenCASCADE");
r = 14; clearance = 0.1; inner = r + clearance; outer = 22;
Sphere(1) = {0, 0, -clearance, r};
Box(2) = {-20, -20, 6, 40, 40, 20};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Sphere(4) = {0, 0, 0, outer, -Pi/2, 0};
Sphere(5) = {0, 0, 0, inner};
BooleanDifference(6) = { Volume{4}; Delete; }{ Volume{5}; Delete; };
e = 1e-2;
Physical Volume("head") = {3};
Physical Volume("cup") = {6};
top() = Surface In BoundingBox{-r, -r, 6 - e, r, r, 6 + e};
ball() = Boundary{ Volume{3}; }; ball() -= { top() };
rim() = Surface In BoundingBox{-outer - e, -outer - e, -e, outer + e, outer + e, e};
hollow() = Surface In BoundingBox{-inner - e, -inner - e, -inner - e, inner + e, inner + e, e};
hollow() -= { rim(), ball() };
shell() = Boundary{ Volume{6}; }; shell() -= { rim(), hollow() };
Physical Surface("neck") = { top() };
Physical Surface("ball") = { ball() };
Physical Surface("hollow") = { hollow() };
Physical Surface("shell") = { shell() };
Mesh.MeshSizeMax = 4;
Mesh.MeshSizeFromCurvature = 24;
Mesh.ElementOrder = 2;
Mesh.Algorithm3D = 1;
