//! Triangular solves with one dense trapezoidal panel of a Cholesky factor, for one right-hand side.
//!
//! A panel is column-major with `rows ≥ cols`: its top `cols × cols` part is lower triangular (entries above the
//! diagonal are never read). Four columns are processed together, so that the vector is read and written once for four
//! columns of the panel. The panel itself is read once, which is the lower limit.

/// Columns taken together.
const GROUP: usize = 4;

/// x ← the result of forward elimination with the first `cols` columns: the leading `cols` entries of x
/// become L⁻¹x there, and the rest receives −L_bottom times them.
pub(super) fn forward(panel: &[f64], rows: usize, cols: usize, x: &mut [f64]) {
    let x = &mut x[..rows];
    let mut j = 0;
    while j + GROUP <= cols {
        let c: [&[f64]; GROUP] = std::array::from_fn(|k| &panel[(j + k) * rows..][..rows]);
        for k in 0..GROUP {
            let value = x[j + k] / c[k][j + k];
            x[j + k] = value;
            for l in k + 1..GROUP {
                x[j + l] -= c[k][j + l] * value;
            }
        }
        let [x0, x1, x2, x3] = [x[j], x[j + 1], x[j + 2], x[j + 3]];
        let [c0, c1, c2, c3] = c.map(|column| &column[j + GROUP..]);
        for ((((x, c0), c1), c2), c3) in x[j + GROUP..].iter_mut().zip(c0).zip(c1).zip(c2).zip(c3) {
            *x -= (c0 * x0 + c1 * x1) + (c2 * x2 + c3 * x3);
        }
        j += GROUP;
    }
    for j in j..cols {
        let column = &panel[j * rows..][..rows];
        let value = x[j] / column[j];
        x[j] = value;
        for (x, c) in x[j + 1..].iter_mut().zip(&column[j + 1..]) {
            *x -= c * value;
        }
    }
}

/// The transposed step: the leading `cols` entries of x become L_top⁻ᵀ(x_top − L_bottomᵀ x_bottom).
pub(super) fn backward(panel: &[f64], rows: usize, cols: usize, x: &mut [f64]) {
    let x = &mut x[..rows];
    let grouped = cols - cols % GROUP;
    for j in (grouped..cols).rev() {
        let column = &panel[j * rows..][..rows];
        let [sum, ..] = dots([&column[j + 1..]; GROUP], &x[j + 1..]);
        x[j] = (x[j] - sum) / column[j];
    }
    for j in (0..grouped).step_by(GROUP).rev() {
        let c: [&[f64]; GROUP] = std::array::from_fn(|k| &panel[(j + k) * rows..][..rows]);
        let mut sums = dots(c.map(|column| &column[j + GROUP..]), &x[j + GROUP..]);
        for k in (0..GROUP).rev() {
            for l in k + 1..GROUP {
                sums[k] += c[k][j + l] * x[j + l];
            }
            x[j + k] = (x[j + k] - sums[k]) / c[k][j + k];
        }
    }
}

/// The products of four columns with x, each summed in four lanes so that the compiler may use vectors.
fn dots(columns: [&[f64]; GROUP], x: &[f64]) -> [f64; GROUP] {
    const LANES: usize = 4;
    let n = x.len();
    let whole = n - n % LANES;
    let c = columns.map(|column| &column[..n]);
    let mut lanes = [[0.0; LANES]; GROUP];
    for i in (0..whole).step_by(LANES) {
        let x: &[f64; LANES] = x[i..i + LANES].try_into().expect("LANES long");
        for (lanes, c) in lanes.iter_mut().zip(&c) {
            let c: &[f64; LANES] = c[i..i + LANES].try_into().expect("LANES long");
            for l in 0..LANES {
                lanes[l] += c[l] * x[l];
            }
        }
    }
    let mut sums = lanes.map(|l| (l[0] + l[1]) + (l[2] + l[3]));
    for i in whole..n {
        for (sum, c) in sums.iter_mut().zip(&c) {
            *sum += c[i] * x[i];
        }
    }
    sums
}
