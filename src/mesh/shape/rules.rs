//! Integration rules.

/// 1/√3: the points of Gauss's rule with two on (−1, 1), both with the weight 1.
pub(crate) const GAUSS: f64 = 0.577_350_269_189_625_8;

/// Three Gauss points on (−1, 1) with their weights, which sum to 1.
pub(super) const LINE: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 18.0), // √(3/5)
    (0.0, 8.0 / 18.0),
    (0.774_596_669_241_483_4, 5.0 / 18.0),
];

/// Four Gauss points on (−1, 1) with their weights, which sum to 1.
pub(super) const LINE4: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.173_927_422_568_726_93),
    (-0.339_981_043_584_856_26, 0.326_072_577_431_273_07),
    (0.339_981_043_584_856_26, 0.326_072_577_431_273_07),
    (0.861_136_311_594_052_6, 0.173_927_422_568_726_93),
];

/// Five Gauss points on (−1, 1) with their weights, which sum to 1.
pub(crate) const LINE5: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.118_463_442_528_094_54),
    (-0.538_469_310_105_683, 0.239_314_335_249_683_23),
    (0.0, 64.0 / 225.0),
    (0.538_469_310_105_683, 0.239_314_335_249_683_23),
    (0.906_179_845_938_664, 0.118_463_442_528_094_54),
];

/// Eight Gauss points on (−1, 1) with their weights, which sum to 1 (Abramowitz and Stegun, table 25.4).
pub(crate) const LINE8: [(f64, f64); 8] = [
    (-0.960_289_856_497_536_3, 0.050_614_268_145_188_13),
    (-0.796_666_477_413_626_7, 0.111_190_517_226_687_24),
    (-0.525_532_409_916_329, 0.156_853_322_938_943_65),
    (-0.183_434_642_495_649_8, 0.181_341_891_689_181),
    (0.183_434_642_495_649_8, 0.181_341_891_689_181),
    (0.525_532_409_916_329, 0.156_853_322_938_943_65),
    (0.796_666_477_413_626_7, 0.111_190_517_226_687_24),
    (0.960_289_856_497_536_3, 0.050_614_268_145_188_13),
];

/// (5 − √5)/20: the four points (a, a, a, 1 − 3a) of a tetrahedron in barycentric coordinates integrate quadratics exactly.
pub(super) const NEAR: f64 = 0.138_196_601_125_010_5;

/// Three Gauss points on an edge: place, the shape functions of its two ends, weight (they sum to 1).
pub(crate) fn edge_points(ends: [[f64; 2]; 2]) -> [([f64; 2], [f64; 2], f64); 3] {
    LINE.map(|(s, weight)| {
        let shape = [0.5 * (1.0 - s), 0.5 * (1.0 + s)];
        let place = std::array::from_fn(|c| shape[0] * ends[0][c] + shape[1] * ends[1][c]);
        (place, shape, weight)
    })
}

/// The points of the cube (square) that have a rule's points as coordinates, with their weights times 2ᴰ; `index` counts
/// them, the first coordinate fastest.
#[inline]
pub(super) fn grid<const D: usize, const P: usize>(
    rule: &[(f64, f64); P],
    index: usize,
) -> ([f64; D], f64) {
    let of = |c: usize| rule[index / P.pow(c as u32) % P];
    let weight = (0..D).map(|c| 2.0 * of(c).1).product();
    (std::array::from_fn(|c| of(c).0), weight)
}

/// Six points in a triangle, exact to degree 4: barycentric coordinates and weights, which sum to 1.
pub(crate) fn triangle_points() -> impl Iterator<Item = ([f64; 3], f64)> {
    in_threes(&DEGREE_4)
}

/// Twelve points in a triangle, exact to degree 6: barycentric coordinates and weights, which sum to 1.
pub(super) fn more_triangle_points() -> impl Iterator<Item = ([f64; 3], f64)> {
    let [a, b, c] = OF_SIX;
    let of_six = [
        [a, b, c],
        [a, c, b],
        [b, a, c],
        [b, c, a],
        [c, a, b],
        [c, b, a],
    ];
    in_threes(&DEGREE_6).chain(of_six.map(|at| (at, WEIGHT_OF_SIX)))
}

fn in_threes(rule: &'static [(f64, f64); 2]) -> impl Iterator<Item = ([f64; 3], f64)> {
    rule.iter().flat_map(|&(near, weight)| {
        (0..3).map(move |corner| {
            let mut at = [near; 3];
            at[corner] = 1.0 - 2.0 * near;
            (at, weight)
        })
    })
}

/// Fourteen points in a tetrahedron, exact to degree 5 (Walkington 2000): barycentric coordinates and weights, which
/// sum to 1.
pub(super) fn tetrahedron_points() -> impl Iterator<Item = ([f64; 4], f64)> {
    const CORNERS: [(f64, f64); 2] = [
        (0.310_885_919_263_300_6, 0.112_687_925_718_015_85),
        (0.092_735_250_310_891_23, 0.073_493_043_116_361_95),
    ];
    const EDGE: (f64, f64) = (0.045_503_704_125_649_65, 0.042_546_020_777_081_47);
    let corners = CORNERS.into_iter().flat_map(|(near, weight)| {
        (0..4).map(move |corner| {
            let mut at = [near; 4];
            at[corner] = 1.0 - 3.0 * near;
            (at, weight)
        })
    });
    let edges = (0..4)
        .flat_map(|i| (i + 1..4).map(move |j| [i, j]))
        .map(|[i, j]| {
            let mut at = [0.5 - EDGE.0; 4];
            (at[i], at[j]) = (EDGE.0, EDGE.0);
            (at, EDGE.1)
        });
    corners.chain(edges)
}

/// Dunavant's rules of degrees 4 and 6 for triangles (Int. J. Numer. Meth. Eng. 21, 1985): the two smaller barycentric
/// coordinates of three points each, or the two larger ones, and the weight as a part of the area.
const DEGREE_4: [(f64, f64); 2] = [
    (0.091_576_213_509_770_7, 0.109_951_743_655_321_9),
    (0.445_948_490_915_964_9, 0.223_381_589_678_011_5),
];
const DEGREE_6: [(f64, f64); 2] = [
    (0.249_286_745_170_910_4, 0.116_786_275_726_379_4),
    (0.063_089_014_491_502_2, 0.050_844_906_370_206_8),
];
const OF_SIX: [f64; 3] = [
    0.053_145_049_844_816_9,
    0.310_352_451_033_784_4,
    0.636_502_499_121_398_7,
];
const WEIGHT_OF_SIX: f64 = 0.082_851_075_618_373_6;
