//! A body in space made of springs: data for tests of code that knows no elements.

use crate::sparse::BlockCsr;

/// A lattice of springs in space to the 26 neighbours of each node, held at x = 0 by its nodes there.
pub(crate) fn lattice(cells: [usize; 3]) -> (BlockCsr<3>, Vec<[f64; 3]>) {
    let [nx, ny, nz] = cells.map(|c| c as i64 + 1);
    let number = |[i, j, k]: [i64; 3]| ((k * ny + j) * nx + i) as usize;
    let (mut triplets, mut points) = (Vec::new(), Vec::new());
    let all = |n: i64| 0..n;
    for (k, j, i) in
        all(nz).flat_map(|k| all(ny).flat_map(move |j| all(nx).map(move |i| (k, j, i))))
    {
        points.push([i as f64, j as f64, k as f64]);
        let own = number([i, j, k]);
        if i == 0 {
            triplets.extend((0..3).map(|c| (3 * own + c, 3 * own + c, 1.0)));
        }
        for (a, b, c) in
            (-1..2).flat_map(|a| (-1..2).flat_map(move |b| (-1..2).map(move |c| (a, b, c))))
        {
            let [x, y, z] = [i + a, j + b, k + c];
            let inside = (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z);
            let square = (a * a + b * b + c * c) as f64;
            if !inside || square == 0.0 {
                continue;
            }
            let (other, way) = (number([x, y, z]), [a, b, c].map(|v| v as f64));
            for (p, q) in (0..3).flat_map(|p| (0..3).map(move |q| (p, q))) {
                let value = way[p] * way[q] / square;
                triplets.push((3 * own + p, 3 * own + q, value));
                triplets.push((3 * own + p, 3 * other + q, -value));
            }
        }
    }
    let n = 3 * points.len();
    (BlockCsr::from_triplets(n, n, triplets), points)
}
