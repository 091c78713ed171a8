//! Many rigid bodies in contact with each other: more contacts than motions, so that forces depend on each other.
//!
//! Every packing follows from its seed: spheres and rods of two or three of them on a lattice that is pushed out of shape, between
//! a floor and four walls, with the velocities that a time step finds before there are impulses. Each is solved as u = W r + q and
//! as the bodies themselves, with their masses as K. The result is judged by the natural map of Siconos and FCLIB, ‖r − P(r − (u +
//! μ‖u_t‖n))‖ / ‖q‖, on a W that is made here.
//!
//! `cargo test --release --test suite -- --ignored --nocapture packings::` solves larger ones beside projected Gauss–Seidel.
//! `PACKINGS_SEED` is the first seed, `PACKINGS` how many.

use crate::common::draw::{decade, generator, number};
use crate::common::or_panic::OrPanic as _;
use crate::common::runs::Way;
use signorini::dual::DelassusDual;
use signorini::problem::{ContactProblem, Matrices, SparseRef};
use signorini::sparse::Csr;
use signorini::ssnm::{self, NewtonSettings, Status};
use std::ops::ControlFlow;
use std::time::Instant;

type Vector = [f64; 3];

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn unit(a: Vector) -> Vector {
    let length = dot(&a, &a).sqrt();
    a.map(|v| v / length)
}

/// Bodies with six velocities each, v and ω about their centre, and their contacts.
struct Packing {
    /// The diagonal of M.
    mass: Vec<f64>,
    /// Velocities without impulses.
    free: Vec<f64>,
    /// Three rows a contact, normal first: (unknown, entry), of how fast it parts and slides.
    rows: Vec<Vec<(usize, f64)>>,
    mu: Vec<f64>,
}

impl Packing {
    fn new(seed: u64, size: [usize; 3]) -> Self {
        let mut random = generator(seed);
        let mut packing = Self {
            mass: Vec::new(),
            free: Vec::new(),
            rows: Vec::new(),
            mu: Vec::new(),
        };
        // Centre and radius of each sphere, its body, and the centre of that.
        let mut spheres: Vec<(Vector, f64, usize, Vector)> = Vec::new();
        let mu = random.between(0.1, 0.9);
        for k in 0..size.iter().product() {
            let cell = [k % size[0], k / size[0] % size[1], k / (size[0] * size[1])];
            let centre = cell.map(|c| c as f64 + random.between(-0.06, 0.06));
            let body = packing.mass.len() / 6;
            let along = unit([0; 3].map(|_| random.between(-1.0, 1.0)));
            let count = 1 + random.below(3);
            for number in 0..count {
                let off = 0.3 * (number as f64 - 0.5 * (count - 1) as f64);
                let at = [0, 1, 2].map(|a| centre[a] + off * along[a]);
                spheres.push((at, random.between(0.41, 0.52), body, centre));
            }
            let mass = decade(&mut random, -0.5, 0.5);
            packing.mass.extend([mass; 3]);
            packing.mass.extend([0.1 * mass * count as f64; 3]);
            let mut velocity = [0.0; 6].map(|_| random.between(-0.3, 0.3));
            velocity[2] -= 1.0;
            packing.free.extend(velocity);
        }
        for (k, &(a, r, body, centre)) in spheres.iter().enumerate() {
            for &(b, s, other, of_other) in &spheres[..k] {
                let apart = [0, 1, 2].map(|i| b[i] - a[i]);
                if body != other && dot(&apart, &apart).sqrt() < r + s {
                    let normal = unit(apart);
                    let at = [0, 1, 2].map(|i| a[i] + r * normal[i]);
                    packing.touch(at, normal, [(body, centre), (other, of_other)], mu);
                }
            }
            for (axis, &cells) in size.iter().enumerate() {
                for (side, wall) in [(-1.0, -0.5), (1.0, cells as f64 - 0.5)] {
                    let reach = side * (wall - a[axis]);
                    if reach < r && (axis < 2 || side < 0.0) {
                        let mut normal = [0.0; 3];
                        normal[axis] = side;
                        let at = [0, 1, 2].map(|i| a[i] + reach * normal[i]);
                        let mu = random.between(0.0, mu);
                        packing.touch(at, normal, [(body, centre), (usize::MAX, at)], mu);
                    }
                }
            }
        }
        packing
    }

    /// A contact at a point, with the normal from the first body to the second.
    fn touch(&mut self, at: Vector, normal: Vector, bodies: [(usize, Vector); 2], mu: f64) {
        // Any axis that is not along the normal.
        let mut axis = [0.0; 3];
        axis[usize::from(normal[0].abs() > 0.5)] = 1.0;
        let first = unit(cross(normal, axis));
        for direction in [normal, first, cross(normal, first)] {
            let mut row = Vec::new();
            for ((body, centre), sign) in bodies.into_iter().zip([-1.0, 1.0]) {
                if body < self.mass.len() / 6 {
                    let arm = [0, 1, 2].map(|i| at[i] - centre[i]);
                    let entries = direction.into_iter().chain(cross(arm, direction));
                    row.extend((6 * body..).zip(entries.map(|v| sign * v)));
                }
            }
            self.rows.push(row);
        }
        self.mu.push(mu);
    }

    /// q.
    fn velocities(&self) -> Vec<f64> {
        let moved = |row: &Vec<(usize, f64)>| row.iter().map(|&(i, v)| v * self.free[i]).sum();
        self.rows.iter().map(moved).collect()
    }

    /// W = H M⁻¹ Hᵀ, and its diagonal.
    fn delassus(&self) -> (Csr, Vec<f64>) {
        let n = self.rows.len();
        let mut meet = vec![Vec::new(); self.mass.len()];
        for (i, row) in self.rows.iter().enumerate() {
            row.iter().for_each(|&(k, v)| meet[k].push((i, v)));
        }
        let all = meet.iter().zip(&self.mass).flat_map(|(meet, mass)| {
            let pairs = meet
                .iter()
                .flat_map(move |a| meet.iter().map(move |b| (a, b)));
            pairs.map(move |(&(i, v), &(j, w))| (i, j, v * w / mass))
        });
        let matrix = Csr::from_triplets(n, n, all);
        let diagonal = matrix.diagonal();
        (matrix, diagonal)
    }

    /// K = M, f = M v, N and T.
    fn of_bodies(&self) -> ContactProblem<3> {
        let (n, m) = (self.mass.len(), self.mu.len());
        let momentum: Vec<f64> = self
            .mass
            .iter()
            .zip(&self.free)
            .map(|(m, v)| m * v)
            .collect();
        // Rows of closing and sliding, in compressed form.
        let rows = |wanted: bool| {
            let (mut starts, mut cols, mut values) = (vec![0_usize], Vec::new(), Vec::new());
            for (_, row) in (self.rows.iter().enumerate()).filter(|(i, _)| (i % 3 == 0) == wanted) {
                cols.extend(row.iter().map(|&(k, _)| k));
                values.extend(row.iter().map(|&(_, v)| -v));
                starts.push(cols.len());
            }
            (starts, cols, values)
        };
        let ([normal, tangential], all) = ([rows(true), rows(false)], Vec::from_iter(0..=n));
        ContactProblem::from_matrices(Matrices {
            stiffness: SparseRef::from_rows(n, n, &all, &all[..n], &self.mass),
            load: &momentum,
            normal: SparseRef::from_rows(m, n, &normal.0, &normal.1, &normal.2),
            tangential: SparseRef::from_rows(2 * m, n, &tangential.0, &tangential.1, &tangential.2),
            gap: &vec![0.0; m],
            friction_coefficient: &self.mu,
            dependent_rows: true,
            ..Matrices::default()
        })
        .or_panic()
    }

    /// ‖r − P(r − (u + μ‖u_t‖n))‖ / ‖q‖.
    fn natural_map(&self, matrix: &Csr, r: &[f64]) -> f64 {
        let q = self.velocities();
        let mut u = vec![0.0; q.len()];
        matrix.mul(r, &mut u);
        u.iter_mut().zip(&q).for_each(|(u, q)| *u += q);
        let mut sum = 0.0;
        for (i, &mu) in self.mu.iter().enumerate() {
            let (r, u) = (&r[3 * i..3 * i + 3], &u[3 * i..3 * i + 3]);
            let slid = u[0] + mu * u[1].hypot(u[2]);
            let near = on_cone([r[0] - slid, r[1] - u[1], r[2] - u[2]], mu);
            sum += (0..3).map(|a| (r[a] - near[a]).powi(2)).sum::<f64>();
        }
        (sum / dot(&q, &q)).sqrt()
    }

    /// How fast contacts close after the impulses r at most, as a part of how fast they part or close before.
    fn closing(&self, matrix: &Csr, r: &[f64]) -> f64 {
        let q = self.velocities();
        let mut u = vec![0.0; q.len()];
        matrix.mul(r, &mut u);
        let closing = (u.iter().zip(&q).step_by(3)).fold(0.0_f64, |most, (u, q)| most.max(-u - q));
        closing / q.iter().fold(0.0_f64, |most, q| most.max(q.abs()))
    }

    /// Sweeps of projected Gauss–Seidel until the natural map is at most this.
    fn by_sweeps(&self, matrix: &Csr, wanted: f64, most: usize) -> (f64, usize) {
        let q = self.velocities();
        let mut r = vec![0.0; q.len()];
        for sweep in 1..=most {
            for (c, &mu) in self.mu.iter().enumerate() {
                let mut own = [[0.0; 3]; 3];
                let mut rest = [0, 1, 2].map(|a| q[3 * c + a]);
                for a in 0..3 {
                    let (cols, values) = matrix.row(3 * c + a);
                    for (&j, [[value]]) in cols.iter().zip(values) {
                        match (j as usize).checked_sub(3 * c) {
                            Some(b) if b < 3 => own[a][b] = *value,
                            _ => rest[a] += value * r[j as usize],
                        }
                    }
                }
                let rho = 1.0 / (own[0][0] + own[1][1] + own[2][2]);
                let mut x = [0, 1, 2].map(|a| r[3 * c + a]);
                for _ in 0..200 {
                    let u = [0, 1, 2].map(|a| dot(&own[a], &x) + rest[a]);
                    let slid = u[0] + mu * u[1].hypot(u[2]);
                    let moved = [x[0] - rho * slid, x[1] - rho * u[1], x[2] - rho * u[2]];
                    let next = on_cone(moved, mu);
                    let change = (0..3).map(|a| (next[a] - x[a]).powi(2)).sum::<f64>();
                    x = next;
                    if change <= 1e-26 * dot(&x, &x) {
                        break;
                    }
                }
                r[3 * c..3 * c + 3].copy_from_slice(&x);
            }
            let off = (sweep % 10 == 0).then(|| self.natural_map(matrix, &r));
            if let Some(off) = off.filter(|&off| off <= wanted || sweep == most) {
                return (off, sweep);
            }
        }
        (f64::INFINITY, most)
    }
}

/// The nearest point of the cone ‖z_t‖ ≤ μ z_n.
fn on_cone(z: Vector, mu: f64) -> Vector {
    let along = z[1].hypot(z[2]);
    let edge = (z[0] + mu * along) / (1.0 + mu * mu);
    match (along <= mu * z[0], edge > 0.0) {
        (true, _) => z,
        (false, true) => [edge, mu * edge * z[1] / along, mu * edge * z[2] / along],
        (false, false) => [0.0; 3],
    }
}

/// The result of a solve.
struct Found {
    status: Status,
    steps: usize,
    off: f64,
    closing: f64,
    seconds: f64,
}

/// Both ways to solve a packing.
fn all_of(packing: &Packing, tolerance: f64) -> [Found; 2] {
    let (matrix, diagonal) = packing.delassus();
    let settings = NewtonSettings {
        tolerance,
        ..NewtonSettings::default()
    };
    let go_on = |_: &ssnm::Step| ControlFlow::Continue(());
    let found = |solution: ssnm::Solution<3>, r: Vec<f64>, begin: Instant| Found {
        status: solution.status,
        steps: solution.info.iter,
        off: packing.natural_map(&matrix, &r),
        closing: packing.closing(&matrix, &r),
        seconds: begin.elapsed().as_secs_f64(),
    };
    let begin = Instant::now();
    let (q, mu) = (packing.velocities(), &packing.mu);
    let problem = ContactProblem::<3>::from_delassus(&diagonal, &q, mu).or_panic();
    let product = |x: &[f64], y: &mut [f64]| {
        matrix.mul(x, y);
        Ok(())
    };
    let mut dual = DelassusDual::new(&problem, product).with_matrix(matrix.clone());
    let solution = ssnm::solve(&problem, &mut dual, &settings, go_on).or_panic();
    let r = dual.impulses(&solution.lambda);
    let by_operator = found(solution, r, begin);
    let begin = Instant::now();
    let problem = packing.of_bodies();
    let mut dual = Way::Cholesky.dual(&problem).or_panic();
    let solution = ssnm::solve(&problem, &mut *dual, &settings, go_on).or_panic();
    let (normal, tangents) = solution.lambda.split_at(mu.len());
    let contacts = normal.iter().zip(tangents.chunks_exact(2));
    let r = contacts.flat_map(|(n, t)| [*n, t[0], t[1]]).collect();
    [by_operator, found(solution, r, begin)]
}

#[test]
fn bodies_that_more_contacts_hold_than_they_have_motions() {
    let (mut excess, mut solved) = (0, 0);
    for seed in 1..=12 {
        let packing = Packing::new(seed, [3, 2, 2]);
        excess += packing.rows.len() - packing.mass.len().min(packing.rows.len());
        for tolerance in [1e-6, 1e-8] {
            for Found {
                status, steps, off, ..
            } in all_of(&packing, tolerance)
            {
                let what = format!("seed {seed}: {status:?} after {steps} steps, off by {off:e}");
                if status == Status::Converged {
                    assert!(off <= 10.0 * tolerance, "{what}");
                    solved += 1;
                } else {
                    println!("{what}");
                }
            }
        }
    }
    assert!(excess > 300, "{excess} rows more than motions");
    assert_eq!(solved, 48);
}

/// The effect of an impulse on a light body between heavy ones is far larger than any velocity: it must not measure them.
#[test]
fn bodies_of_very_different_masses() {
    let mut solved = 0;
    for seed in 1..=10 {
        let mut packing = Packing::new(seed, [3, 2, 2]);
        let mut random = generator(100 + seed);
        for mass in packing.mass.chunks_mut(6) {
            let factor = decade(&mut random, -7.0, 0.0);
            mass.iter_mut().for_each(|mass| *mass *= factor);
        }
        let [of_operator, _] = all_of(&packing, 1e-6);
        let (status, closing) = (of_operator.status, of_operator.closing);
        println!(
            "seed {seed}: {status:?} after {} steps, closing by {closing:e}",
            of_operator.steps
        );
        if status == Status::Converged {
            assert!(closing < 1e-4, "seed {seed}");
            solved += 1;
        }
    }
    assert!(solved >= 9, "{solved} of 10");
}

/// A node of a body in space that is listed several times, pressed and pushed: its forces add up to that of one contact.
#[test]
fn a_node_that_is_listed_twice() {
    let count = 2;
    for push in [[0.1, 0.05], [1.0, 0.5], [0.5, 0.0], [0.3, 0.3]] {
        let rows = |columns: &[usize]| {
            let all: Vec<usize> = columns.repeat(count);
            let starts: Vec<usize> = (0..=all.len()).collect();
            (starts, all)
        };
        let (normal, tangential) = (rows(&[2]), rows(&[0, 1]));
        for mu in [0.0, 0.3] {
            let bound = if mu > 0.0 { 0.0 } else { 0.2 };
            let problem = ContactProblem::<3>::from_matrices(Matrices {
                stiffness: SparseRef::from_rows(3, 3, &[0, 1, 2, 3], &[0, 1, 2], &[1.0; 3]),
                load: &[push[0], push[1], 1.0],
                normal: SparseRef::from_rows(count, 3, &normal.0, &normal.1, &vec![1.0; count]),
                tangential: SparseRef::from_rows(
                    2 * count,
                    3,
                    &tangential.0,
                    &tangential.1,
                    &vec![1.0; 2 * count],
                ),
                slip_bound: &vec![bound; count],
                friction_coefficient: if mu > 0.0 { &[0.3, 0.3] } else { &[] },
                gap: &vec![0.0; count],
                dependent_rows: true,
                ..Matrices::default()
            })
            .or_panic();
            let mut dual = Way::Cholesky.dual(&problem).or_panic();
            let go_on = |_: &ssnm::Step| ControlFlow::Continue(());
            let found =
                ssnm::solve(&problem, &mut *dual, &NewtonSettings::default(), go_on).or_panic();
            assert_eq!(found.status, Status::Converged, "{push:?} {mu}");
            let size = push[0].hypot(push[1]);
            let limit = if mu > 0.0 { mu } else { count as f64 * bound };
            let slip = (1.0 - limit / size).max(0.0);
            for c in 0..2 {
                assert!(
                    (found.u[c] - slip * push[c]).abs() < 1e-5,
                    "{push:?} {mu}: {:?}",
                    found.u
                );
            }
        }
    }
}

/// The error grows in steps that are solved, which must not make them shorter.
#[test]
fn larger_packings() {
    for seed in [3, 7] {
        let packing = Packing::new(seed, [[4, 3, 3], [5, 4, 4]][seed as usize % 3]);
        for Found {
            status, steps, off, ..
        } in all_of(&packing, 1e-8)
        {
            let what = format!("seed {seed}: {status:?} after {steps} steps, off by {off:e}");
            assert!(status == Status::Converged && off <= 1e-7, "{what}");
        }
    }
}

#[test]
#[ignore = "minutes of Gauss–Seidel"]
fn beside_gauss_seidel() {
    let (first, count) = (
        number("PACKINGS_SEED").unwrap_or(1),
        number("PACKINGS").unwrap_or(10),
    );
    let (mut failed, mut unanswered) = (Vec::new(), 0);
    for seed in first..first + count {
        let size = [[4, 3, 3], [5, 4, 4], [6, 6, 5]][seed as usize % 3];
        let packing = Packing::new(seed, size);
        let (matrix, _) = packing.delassus();
        let begin = Instant::now();
        let (off, sweeps) = packing.by_sweeps(&matrix, 1e-6, 3000);
        println!(
            "seed {seed}: {} contacts, {} motions; {sweeps} sweeps, off by {off:.1e}, {:.2} s",
            packing.mu.len(),
            packing.mass.len(),
            begin.elapsed().as_secs_f64()
        );
        for tolerance in [1e-6, 1e-8] {
            for (found, way) in all_of(&packing, tolerance).iter().zip(["W", "bodies"]) {
                println!(
                    "    {tolerance:e}, {way}: {:?}, {} steps, off by {:.1e}, {:.2} s",
                    found.status, found.steps, found.off, found.seconds
                );
                unanswered += usize::from(found.status != Status::Converged);
                if found.status == Status::Converged && found.off > 10.0 * tolerance {
                    failed.push(format!("seed {seed}, {tolerance:e}, {way}"));
                }
            }
        }
    }
    println!("{unanswered} of {} solves without an answer", 4 * count);
    assert!(failed.is_empty(), "{failed:?}");
}

/// Rows that are multiples of one act as one, however many there are: the sum of their forces has a closed form.
#[test]
fn contacts_that_are_multiples_of_one() {
    for seed in 0..40 {
        let mut random = generator(seed);
        let mut draw = |low, high| random.between(low, high);
        let m = 2 + seed as usize % 20;
        let (k, f) = (
            [draw(0.5, 5.0), draw(0.5, 5.0)],
            [draw(1.0, 4.0), draw(-2.0, 0.0)],
        );
        let row = [1.0, draw(-1.0, -0.2)];
        let arms: Vec<f64> = (0..m).map(|_| draw(0.3, 1.0)).collect();
        let values: Vec<f64> = arms.iter().flat_map(|arm| row.map(|v| arm * v)).collect();
        let starts: Vec<usize> = (0..=m).map(|i| 2 * i).collect();
        let problem = ContactProblem::<2>::from_matrices(Matrices {
            stiffness: SparseRef::from_rows(2, 2, &[0, 1, 2], &[0, 1], &k),
            load: &f,
            normal: SparseRef::from_rows(m, 2, &starts, &[0, 1].repeat(m), &values),
            tangential: SparseRef::from_rows(m, 2, &vec![0; m + 1], &[], &[]),
            slip_bound: &vec![0.0; m],
            gap: &vec![0.0; m],
            dependent_rows: true,
            ..Matrices::default()
        })
        .or_panic();
        let mut dual = Way::Cholesky.dual(&problem).or_panic();
        let settings = NewtonSettings::default();
        let go_on = |_: &ssnm::Step| ControlFlow::Continue(());
        let solution = ssnm::solve(&problem, &mut *dual, &settings, go_on).or_panic();
        assert_eq!(
            solution.status,
            Status::Converged,
            "seed {seed}, {m} contacts"
        );
        let moved: f64 = (0..2).map(|i| row[i] * f[i] / k[i]).sum();
        let force = moved / (0..2).map(|i| row[i] * row[i] / k[i]).sum::<f64>();
        let off = dot(&arms, &solution.lambda[..m]) - force;
        assert!(off.abs() <= 1e-6 * force, "seed {seed}: off by {off:e}");
    }
}
