// A quarter of a ring with curved elements of second order: the meshes ring-*.msh and .inp beside this file, for tests.
//   gmsh -3 -order 2 ring.geo -setnumber kind 0 -format msh41 -o ring-tet10.msh     (and -format inp)
//   … kind 1: ring-hex27.msh (msh22 -bin), ring-hex20.msh (msh41 -bin)    … kind 2: ring-wedge18.msh, ring-wedge15.msh
//   gmsh -2 … solid 0 … kind 0: ring-tri6.msh (and inp)    … kind 1: ring-quad9.msh (msh41 -bin), ring-quad8.msh
//   hex20, wedge15 and quad8 with -setnumber Mesh.SecondOrderIncomplete 1
DefineConstant[ kind = 0, solid = 1 ];
Mesh.MeshSizeMin = 1.2;
Mesh.MeshSizeMax = 1.2;
Point(1) = {0, 0, 0};
Point(2) = {1, 0, 0};
Point(3) = {2, 0, 0};
Point(4) = {0, 2, 0};
Point(5) = {0, 1, 0};
Line(1) = {2, 3};
Circle(2) = {3, 1, 4};
Line(3) = {4, 5};
Circle(4) = {5, 1, 2};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
If (kind == 1)
  Transfinite Curve {1, 3} = 2;
  Transfinite Curve {2, 4} = 3;
  Transfinite Surface {1};
  Recombine Surface {1};
EndIf
If (solid == 0)
  Physical Surface("ring") = {1};
  Physical Curve("bore") = {4};
  Physical Curve("low") = {1};
Else
  If (kind == 0)
    all[] = Extrude {0, 0, 0.5} { Surface{1}; };
  Else
    all[] = Extrude {0, 0, 0.5} { Surface{1}; Layers{1}; Recombine; };
  EndIf
  Physical Volume("ring") = {all[1]};
  Physical Surface("bore") = {all[5]};
  Physical Surface("low") = {all[2]};
EndIf
