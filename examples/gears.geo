// Five teeth each of two spur gears with 20 teeth, module 2 and an angle of pressure of 20 degrees; lengths in mm (scale = 1e-3 in the case).
// gmsh -2 -order 2 -format msh41 gears.geo -o gears.msh
//
// Flanks are involutes of a circle, with fillets at the root. The teeth are thinner than half a pitch, by the backlash.
z = 20;
rp = 20;                             // radius of pitch, of tip, of root, and of the base circle
ra = 22;
rr = 17.5;
rb = rp*Cos(20*Pi/180);
ri = 13;                             // inside of the rim
backlash = 0.04;
fine = 0.2;                          // at the flanks
coarse = 2;
half = (Pi*rp/z - backlash)/2/rp + Tan(20*Pi/180) - 20*Pi/180;   // half the angle of a tooth on its base circle
relief = 0.03;                       // by which each flank is cut back at its tip, from 1 mm below it on, so that it enters gently
n = 8;                               // points of a flank

For g In {0:1}
  // The first gear has a gap on the line of centres, the second a tooth; it is turned by 180 degrees.
  centre = 2*rp*g;
  way = 1 - 2*g;
  phase = g == 0 ? -Pi/z : 0;
  c = newp; Point(c) = {centre, 0, 0};
  all = {};
  flanks = {};
  before = -1;
  For k In {-2:2}
    middle = phase + 2*Pi/z*k;
    For side In {-1:1:2}
      points = {};
      For i In {0:n + 1}
        // From the root to the tip: two points of the fillet, then the involute.
        r = i == 0 ? rr : (i == 1 ? rr + 0.35 : rb + (ra - rb)*(i - 2)/(n - 1));
        a = r > rb ? Acos(rb/r) : 0;
        psi = half - (Tan(a) - a) + (i == 0 ? 0.035 : (i == 1 ? 0.006 : 0));
        psi -= r > ra - 1 ? relief/r*(r - ra + 1)^2 : 0;
        angle = middle + side*psi;
        p = newp; Point(p) = {centre + way*r*Cos(angle), way*r*Sin(angle), 0};
        points[] += p;
      EndFor
      l = newl; Spline(l) = points[];
      flanks[] += l;
      If (side < 0)
        If (before >= 0)
          a1 = newl; Circle(a1) = {before, c, points[0]};
          all[] += a1;
        EndIf
        If (before < 0)
          first = points[0];
        EndIf
        all[] += l;
        tip = points[n + 1];
      Else
        a2 = newl; Circle(a2) = {tip, c, points[n + 1]};
        flanks[] += a2;
        all[] += {a2, -l};
        before = points[0];
      EndIf
    EndFor
  EndFor
  // Half a root to either side, the cuts, and the inside of the rim.
  from = phase - 5*Pi/z;
  to = phase + 5*Pi/z;
  p1 = newp; Point(p1) = {centre + way*rr*Cos(from), way*rr*Sin(from), 0};
  p2 = newp; Point(p2) = {centre + way*rr*Cos(to), way*rr*Sin(to), 0};
  p3 = newp; Point(p3) = {centre + way*ri*Cos(to), way*ri*Sin(to), 0};
  p4 = newp; Point(p4) = {centre + way*ri*Cos(from), way*ri*Sin(from), 0};
  b = newl; Circle(b) = {p1, c, first};
  e = newl; Circle(e) = {before, c, p2};
  d = newl; Line(d) = {p2, p3};
  rim = newl; Circle(rim) = {p3, c, p4};
  f = newl; Line(f) = {p4, p1};
  loop = newll; Curve Loop(loop) = {b, all[], e, d, rim, f};
  s = news; Plane Surface(s) = {loop};
  If (g == 0)
    Physical Surface("driver") = {s};
    Physical Curve("driver-teeth") = flanks[];
    Physical Curve("driver-hub") = {rim};
    ends0 = flanks[];
  Else
    Physical Surface("driven") = {s};
    Physical Curve("driven-teeth") = flanks[];
    Physical Curve("driven-hub") = {rim};
    ends1 = flanks[];
  EndIf
EndFor

Field[1] = Distance;
Field[1].CurvesList = {ends0[], ends1[]};
Field[2] = Threshold;
Field[2].InField = 1;
Field[2].SizeMin = fine;
Field[2].SizeMax = coarse;
Field[2].DistMin = 0.05;
Field[2].DistMax = 4;
Background Field = 2;
Mesh.MeshSizeFromPoints = 0;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.Algorithm = 6;
Mesh.Binary = 0;
