// A blade root with a dovetail in the slot of a disc, x >= 0 of both; lengths in mm (scale = 1e-3 in the case).
// gmsh -2 -format msh41 dovetail.geo -o dovetail.msh
//
// The flanks of blade and disc lie on the line x + y = 24, at 45 degrees; elsewhere there is clearance. The two
// bodies share no points, so that Gmsh makes two meshes, which need not match.
fine = 0.25;                          // at the flanks
coarse = 3;
t = Tan(Pi/8);                       // tangent length of an arc of radius 1 in a corner of 135 degrees
s = Sqrt(0.5);

// Blade: shank x <= 6, fillet of radius 3 to the flank, corner of radius 2 to the side x = 16, bottom y = 0.
Point(1) = {0, 0, 0};
Point(2) = {14, 0, 0};
Point(3) = {14, 2, 0};               // centre
Point(4) = {16, 2, 0};
Point(5) = {16, 8 - 2*t, 0};
Point(6) = {14, 8 - 2*t, 0};         // centre
Point(7) = {16 - 2*t*s, 8 + 2*t*s, 0};
Point(8) = {6 + 3*t*s, 18 - 3*t*s, 0};
Point(9) = {9, 18 + 3*t, 0};         // centre
Point(10) = {6, 18 + 3*t, 0};
Point(11) = {6, 40, 0};
Point(12) = {0, 40, 0};
Line(1) = {1, 2};
Circle(2) = {2, 3, 4};
Line(3) = {4, 5};
Circle(4) = {5, 6, 7};
Line(5) = {7, 8};
Circle(6) = {8, 9, 10};
Line(7) = {10, 11};
Line(8) = {11, 12};
Line(9) = {12, 1};
Curve Loop(1) = {1:9};
Plane Surface(1) = {1};

// Disc: neck x = 7.5, corner of radius 2 to the flank, fillet of radius 2.5 to the slot wall x = 17, slot bottom
// y = -1.5; x = 26 is the middle of the lug between two slots.
Point(21) = {0, -1.5, 0};
Point(22) = {0, -25, 0};
Point(23) = {26, -25, 0};
Point(24) = {26, 22, 0};
Point(25) = {7.5, 22, 0};
Point(26) = {7.5, 16.5 + 2*t, 0};
Point(27) = {9.5, 16.5 + 2*t, 0};    // centre
Point(28) = {7.5 + 2*t*s, 16.5 - 2*t*s, 0};
Point(29) = {17 - 2.5*t*s, 7 + 2.5*t*s, 0};
Point(30) = {14.5, 7 - 2.5*t, 0};    // centre
Point(31) = {17, 7 - 2.5*t, 0};
Point(32) = {17, 1.5, 0};
Point(33) = {14, 1.5, 0};            // centre
Point(34) = {14, -1.5, 0};
Line(21) = {21, 22};
Line(22) = {22, 23};
Line(23) = {23, 24};
Line(24) = {24, 25};
Line(25) = {25, 26};
Circle(26) = {26, 27, 28};
Line(27) = {28, 29};
Circle(28) = {29, 30, 31};
Line(29) = {31, 32};
Circle(30) = {32, 33, 34};
Line(31) = {34, 21};
Curve Loop(2) = {21:31};
Plane Surface(2) = {2};

Physical Surface("blade") = {1};
Physical Surface("disc") = {2};
Physical Curve("blade-flank") = {4, 5};      // with the corner below, along which the contact ends
Physical Curve("blade-axis") = {9};
Physical Curve("blade-top") = {8};
Physical Curve("disc-flank") = {26, 27, 28}; // with the corner above and the fillet below
Physical Curve("disc-axis") = {21};
Physical Curve("disc-bottom") = {22};
Physical Curve("disc-lug") = {23};

// Small elements at the flanks, somewhat larger ones at the other fillets, growing with the distance.
Field[1] = Distance;
Field[1].CurvesList = {4, 5, 26, 27, 28};
Field[2] = Threshold;
Field[2].InField = 1;
Field[2].SizeMin = fine;
Field[2].SizeMax = coarse;
Field[2].DistMin = 0.4;
Field[2].DistMax = 18;
Field[3] = Distance;
Field[3].CurvesList = {6, 30};
Field[4] = Threshold;
Field[4].InField = 3;
Field[4].SizeMin = 0.3;
Field[4].SizeMax = coarse;
Field[4].DistMin = 0.3;
Field[4].DistMax = 12;
Field[5] = Min;
Field[5].FieldsList = {2, 4};
Background Field = 5;
Mesh.MeshSizeFromPoints = 0;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.Algorithm = 6;
Mesh.Binary = 0;
