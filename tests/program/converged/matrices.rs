//! Matrices of one's own: an assembly of bilinear quadrilaterals, with a kernel that coordinates explain or not.

use super::cases::{coulomb, floor, material, part, traction, tresca};
use super::reference::{nodes_apart, wrong_by};
use super::run::{DEFAULT, FORCE, Failures, How, NODAL, Node, PATHS, length, solve, solve_with};

/// Bilinear quadrilaterals in plane strain, as an algebraic case.
pub struct Grid {
    pub nodes: Vec<[f64; 2]>,
    /// Corners, counter-clockwise.
    pub cells: Vec<[usize; 4]>,
    /// Nodes on a floor, with their lengths of boundary.
    pub base: Vec<(usize, f64)>,
    pub load: Vec<f64>,
}

pub const ALGEBRAIC_SIZE: [f64; 2] = [1.0, 0.4];

pub const ALGEBRAIC_CELLS: [usize; 2] = [10, 4];

pub const ALGEBRAIC_YOUNG: f64 = 1e9;

impl Grid {
    /// A free block that is pressed on a floor and pushed sideways at its top, by these tractions.
    pub fn block(press: f64, push: f64) -> Self {
        let ([w, h], [nx, ny]) = (ALGEBRAIC_SIZE, ALGEBRAIC_CELLS);
        let number = |i: usize, j: usize| j * (nx + 1) + i;
        let mut nodes = Vec::new();
        for j in 0..=ny {
            for i in 0..=nx {
                nodes.push([w * i as f64 / nx as f64, h * j as f64 / ny as f64]);
            }
        }
        let cells = (0..nx * ny)
            .map(|cell| {
                let (i, j) = (cell % nx, cell / nx);
                [
                    number(i, j),
                    number(i + 1, j),
                    number(i + 1, j + 1),
                    number(i, j + 1),
                ]
            })
            .collect();
        let share = |i: usize| w / nx as f64 * if i == 0 || i == nx { 0.5 } else { 1.0 };
        let mut load = vec![0.0; 2 * nodes.len()];
        for i in 0..=nx {
            load[2 * number(i, ny)] = push * share(i);
            load[2 * number(i, ny) + 1] = -press * share(i);
        }
        Self {
            nodes,
            cells,
            base: (0..=nx).map(|i| (number(i, 0), share(i))).collect(),
            load,
        }
    }

    /// Two square cells side by side that share their common upper corner only, so that they can turn against
    /// each other about it, pressed on a floor.
    pub fn hinged() -> Self {
        let nodes = vec![
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
        ];
        let mut load = vec![0.0; 2 * nodes.len()];
        for node in [2, 3, 6] {
            load[2 * node + 1] = -1e5;
        }
        Self {
            nodes,
            cells: vec![[0, 1, 2, 3], [4, 5, 6, 2]],
            base: [0, 1, 4, 5].map(|node| (node, 0.5)).to_vec(),
            load,
        }
    }

    /// K by 2 × 2 Gauss points, E = 1e9, ν = 0.3.
    pub fn stiffness(&self) -> Vec<Vec<f64>> {
        let n = 2 * self.nodes.len();
        let mut k = vec![vec![0.0; n]; n];
        let (young, nu) = (ALGEBRAIC_YOUNG, 0.3);
        let lambda = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
        let shear = young / (2.0 * (1.0 + nu));
        let c = lambda + 2.0 * shear;
        let point = 1.0 / 3f64.sqrt();
        for cell in &self.cells {
            for (a, b) in [
                (-point, -point),
                (point, -point),
                (point, point),
                (-point, point),
            ] {
                // Derivatives of the shape functions (1 ± a)(1 ± b) / 4 along the sides of the unit cell.
                let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let local = signs
                    .map(|(s, t): (f64, f64)| [s * (1.0 + t * b) / 4.0, t * (1.0 + s * a) / 4.0]);
                let mut jacobian = [[0.0; 2]; 2];
                for (corner, &node) in cell.iter().enumerate() {
                    for r in 0..2 {
                        for s in 0..2 {
                            jacobian[r][s] += local[corner][r] * self.nodes[node][s];
                        }
                    }
                }
                let [[ja, jb], [jc, jd]] = jacobian;
                let det = ja * jd - jb * jc;
                let gradient =
                    local.map(|[s, t]| [(jd * s - jb * t) / det, (ja * t - jc * s) / det]);
                for (i, &p) in cell.iter().enumerate() {
                    for (j, &q) in cell.iter().enumerate() {
                        let ([px, py], [qx, qy]) = (gradient[i], gradient[j]);
                        k[2 * p][2 * q] += det * (c * px * qx + shear * py * qy);
                        k[2 * p][2 * q + 1] += det * (lambda * px * qy + shear * py * qx);
                        k[2 * p + 1][2 * q] += det * (lambda * py * qx + shear * px * qy);
                        k[2 * p + 1][2 * q + 1] += det * (c * py * qy + shear * px * qx);
                    }
                }
            }
        }
        k
    }

    /// The files of the case. `limit` is the slip bound in Pa, or the coefficient of friction.
    pub fn files(&self, limit: f64, coulomb: bool) -> Vec<(&'static str, String)> {
        let n = 2 * self.nodes.len();
        let k = self.stiffness();
        let mut entries = Vec::new();
        for i in 0..n {
            for j in 0..=i {
                if k[i][j] != 0.0 {
                    // Symmetric to the last digit: only the lower half is written.
                    entries.push(format!("{} {} {:e}", i + 1, j + 1, k[i][j]));
                }
            }
        }
        let stiffness = format!(
            "%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n{}\n",
            entries.len(),
            entries.join("\n")
        );
        // Towards the floor is −y; that turned counter-clockwise is +x.
        let rows = |component: usize, sign: f64| {
            let m = self.base.len();
            let rows: Vec<String> = (self.base.iter().enumerate())
                .map(|(row, &(node, _))| {
                    format!("{} {} {sign:e}", row + 1, 2 * node + component + 1)
                })
                .collect();
            format!(
                "%%MatrixMarket matrix coordinate real general\n{m} {n} {m}\n{}\n",
                rows.join("\n")
            )
        };
        let limits: Vec<f64> = (self.base.iter())
            .map(|&(_, length)| if coulomb { limit } else { limit * length })
            .collect();
        let coordinates: Vec<f64> = (0..2)
            .flat_map(|c| self.nodes.iter().map(move |x| x[c]))
            .collect();
        vec![
            ("K.mtx", stiffness),
            ("f.mtx", array(&self.load, 1)),
            ("N.mtx", rows(1, -1.0)),
            ("T.mtx", rows(0, 1.0)),
            ("d.mtx", array(&vec![0.0; self.base.len()], 1)),
            ("limit.mtx", array(&limits, 1)),
            ("x.mtx", array(&coordinates, 2)),
        ]
    }
}

/// A dense matrix, column by column, as a Matrix Market file.
pub fn array(values: &[f64], columns: usize) -> String {
    let lines: Vec<String> = values.iter().map(|v| format!("{v:e}")).collect();
    format!(
        "%%MatrixMarket matrix array real general\n{} {columns}\n{}\n",
        values.len() / columns,
        lines.join("\n")
    )
}

pub fn algebraic(coulomb: bool, coordinates: bool) -> String {
    let limit = if coulomb {
        "friction_coefficient"
    } else {
        "slip_bound"
    };
    let coordinates = if coordinates {
        "coordinates = \"x.mtx\"\n"
    } else {
        ""
    };
    format!(
        "[algebraic]\nstiffness = \"K.mtx\"\nload = \"f.mtx\"\nnormal = \"N.mtx\"\n\
         tangential = \"T.mtx\"\ngap = \"d.mtx\"\n{limit} = \"limit.mtx\"\n{coordinates}"
    )
}

#[test]
fn matrices_of_a_free_block() {
    let mut failures = Failures::new();
    let (press, push) = (1e6, 1.5e5);
    let [width, _] = ALGEBRAIC_SIZE;
    for (limit, friction) in [(0.3, true), (2e5, false)] {
        let law = if friction {
            coulomb(limit)
        } else {
            tresca(limit)
        };
        let text = part("block", [0.0; 2], ALGEBRAIC_SIZE, ALGEBRAIC_CELLS)
            + &material("block", ALGEBRAIC_YOUNG, 0.0)
            + &traction("block-top", 'y', -press)
            + &traction("block-top", 'x', push)
            + &floor("block-bottom", 0.0, &law);
        let grid = Grid::block(press, push);
        for path in PATHS {
            let how = How::quiet(path, DEFAULT);
            let mesh = solve(&format!("mesh, friction {law}"), &text, how);
            let mesh_wrong = mesh.unconverged(1);
            let usable = mesh_wrong.is_empty();
            failures.add(&mesh.name, mesh_wrong);
            let run = solve_with(
                &format!("matrices, friction {law}"),
                &algebraic(friction, true),
                &grid.files(limit, friction),
                how,
            );
            let mut wrong = run.unconverged(1);
            if run.status() == "converged" {
                let [_, normal, tangential] = &run.vectors;
                let (down, along): (f64, f64) = (normal.iter().sum(), tangential.iter().sum());
                // λτ acts against the push on the block: Bᵀλ is on the side of K.
                let error = length([down - press * width, along - push * width]) / (press * width);
                if !(error <= FORCE * DEFAULT) {
                    wrong.push(format!(
                        "Σ λν = {down:.6e}, Σ λτ = {along:.6e} for the loads {press:.6e}, {push:.6e}"
                    ));
                }
                let nodes: Vec<Node> = (grid.base.iter().enumerate())
                    .filter(|&(i, _)| i < normal.len() && i < tangential.len())
                    .map(|(i, &(node, share))| Node {
                        x: grid.nodes[node][0],
                        pressure: normal[i] / share,
                        traction: -tangential[i] / share,
                    })
                    .collect();
                if usable {
                    let others = mesh.nodes.first().map_or(&[][..], |nodes| nodes);
                    // Two Coulomb fixed points, each to the default tolerance.
                    wrong.extend(wrong_by(nodes_apart(&nodes, others), NODAL * DEFAULT));
                }
            }
            failures.add(&run.name, wrong);
        }
    }
    failures.finish();
}

#[test]
fn matrices_with_an_unexplained_kernel() {
    let mut failures = Failures::new();
    let block = Grid::block(1e6, 0.0);
    let hinged = Grid::hinged();
    for (name, grid, coordinates) in [
        ("a free block without coordinates", &block, false),
        ("two hinged cells", &hinged, true),
        ("two hinged cells without coordinates", &hinged, false),
    ] {
        for friction in [true, false] {
            for path in PATHS {
                let limit = if friction { 0.3 } else { 1e5 };
                let run = solve_with(
                    &format!("{name}, {}", if friction { "Coulomb" } else { "Tresca" }),
                    &algebraic(friction, coordinates),
                    &grid.files(limit, friction),
                    How::quiet(path, DEFAULT),
                );
                let said = run.stderr.to_lowercase();
                let mut wrong = Vec::new();
                if run.code != Some(1) {
                    wrong.push(format!("exit {:?}, status {}", run.code, run.status()));
                }
                let explained = said.contains("singular") || said.contains("coordinates");
                if !said.starts_with("error: ") || !explained || said.contains("panicked") {
                    wrong.push(format!("it says: {}", run.stderr.trim_end()));
                }
                failures.add(&run.name, wrong);
            }
        }
    }
    failures.finish();
}
