// Hexahedra, wedges and tetrahedra that share faces: the meshes s*.msh beside this file, for tests.
//   gmsh -3 solid.geo -format msh41 -o s41a.msh    (msh22; -bin for s41b.msh and s22b.msh)
Point(1) = {0, 0, 0, 0.5};
Point(2) = {1, 0, 0, 0.5};
Point(3) = {2, 0, 0, 0.5};
Point(4) = {2, 1, 0, 0.5};
Point(5) = {1, 1, 0, 0.5};
Point(6) = {0, 1, 0, 0.5};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 5};
Line(5) = {5, 6};
Line(6) = {6, 1};
Line(7) = {2, 5};
Curve Loop(1) = {1, 7, 5, 6};
Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, -7};
Plane Surface(2) = {2};
Transfinite Curve {1, 2, 3, 4, 5, 6, 7} = 3;
Transfinite Surface {1};
Recombine Surface {1};
cubes[] = Extrude {0, 0, 1} { Surface{1}; Layers{2}; Recombine; };
prisms[] = Extrude {0, 0, 1} { Surface{2}; Layers{2}; Recombine; };
tower[] = Extrude {0, 0, 1} { Surface{prisms[0]}; };

// Apart from the body.
Point(101) = {5, 5, 5, 1};
Point(102) = {6, 5, 5, 1};
Point(103) = {5, 6, 5, 1};
Line(101) = {101, 102};
Line(102) = {102, 103};
Line(103) = {103, 101};
Curve Loop(101) = {101, 102, 103};
Plane Surface(101) = {101};
Transfinite Curve {101, 102, 103} = 2;

Physical Volume("steel") = {cubes[1]};
Physical Volume("rubber") = {prisms[1], tower[1]};
Physical Volume("all") = {cubes[1], prisms[1], tower[1]};
Physical Surface("bottom") = {1, 2};
Physical Surface("left") = {cubes[5]};
Physical Surface("right") = {prisms[3], tower[3]};
Physical Surface("top") = {tower[0]};
Physical Surface("middle") = {cubes[3]};
Physical Surface("sheet") = {101};
Physical Curve("edge") = {1};
Physical Point("corner") = {1};
