//! Blocks on two others: statics leaves open how much each of these bears. Whether all blocks are held is decided by forces at
//! the corners of the common areas, which are not negative and balance each block, from a separate least-squares problem.
//! Friction may help where pillars lean outwards like an arch: the structure is held if vertical forces alone balance all, and
//! it falls if not even friction without a bound does.

use super::common_area::{Area, Point, common, middle, size};
use super::scene::{Body, Fate, Interface, STRAIN, Scene, Solid, Tally, YOUNG, judge, pair, path};
use crate::common::Random;
use crate::common::draw::{chance, generator, number};
use crate::common::space::cross;
use signorini::mesh::ElementKind;
use signorini::model::Pair;

/// The areas are smaller or larger by this much where it must be clear that all blocks are held or fall.
const CLEAR: f64 = 0.02;
/// The least part of the forces that is left if they do not balance, compared with rounding.
const LEFT: f64 = 1e-6;
const MU: f64 = 0.5;
/// Common areas smaller than this are not asked for.
const AREA: f64 = 0.1;

/// The upper and the lower body of a contact, None for the table, their common area, and its height.
struct Joint {
    upper: usize,
    lower: Option<usize>,
    area: Area,
    height: f64,
}

/// The least |A x − b| with x ≥ 0, relative to |b| (Lawson and Hanson); A by columns.
fn least(columns: &[Vec<f64>], b: &[f64]) -> f64 {
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let n = columns.len();
    let (mut x, mut free) = (vec![0.0; n], Vec::<usize>::new());
    let residual = |x: &[f64]| {
        let mut left = b.to_vec();
        for (column, &x) in columns.iter().zip(x) {
            left.iter_mut()
                .zip(column)
                .for_each(|(left, a)| *left -= a * x);
        }
        left
    };
    // Each pass frees one; none is freed twice in a row in exact arithmetic.
    for _ in 0..10 * n {
        let left = residual(&x);
        let slope = |k: usize| dot(&columns[k], &left) / dot(&columns[k], &columns[k]).sqrt();
        let steepest = (0..n)
            .filter(|k| !free.contains(k))
            .max_by(|&k, &l| slope(k).total_cmp(&slope(l)));
        match steepest {
            Some(k) if slope(k) > 1e-10 * dot(b, b).sqrt() => free.push(k),
            _ => break,
        }
        loop {
            let wanted = solved(columns, &free, b);
            // As far as all stay positive.
            let step = (free.iter().zip(&wanted))
                .filter(|(_, wanted)| **wanted <= 0.0)
                .map(|(&k, wanted)| x[k] / (x[k] - wanted))
                .fold(1.0, f64::min);
            for (&k, wanted) in free.iter().zip(&wanted) {
                x[k] += step * (wanted - x[k]);
            }
            if step == 1.0 {
                break;
            }
            let before = free.len();
            free.retain(|&k| x[k] > 1e-13);
            (0..n)
                .filter(|k| !free.contains(k))
                .for_each(|k| x[k] = 0.0);
            if free.len() == before || free.is_empty() {
                break;
            }
        }
    }
    let left = residual(&x);
    (dot(&left, &left) / dot(b, b)).sqrt()
}

/// The least-squares solution in some columns, by Gram and Schmidt twice over.
fn solved(columns: &[Vec<f64>], free: &[usize], b: &[f64]) -> Vec<f64> {
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let m = free.len();
    let (mut q, mut r) = (Vec::<Vec<f64>>::new(), vec![vec![0.0; m]; m]);
    for (j, &k) in free.iter().enumerate() {
        let mut column = columns[k].clone();
        for _ in 0..2 {
            for (i, direction) in q.iter().enumerate() {
                let part = dot(direction, &column);
                r[i][j] += part;
                column
                    .iter_mut()
                    .zip(direction)
                    .for_each(|(c, d)| *c -= part * d);
            }
        }
        r[j][j] = dot(&column, &column).sqrt();
        // A dependent one has no part.
        let scale = if r[j][j] > 1e-12 { 1.0 / r[j][j] } else { 0.0 };
        q.push(column.iter().map(|c| c * scale).collect());
    }
    let mut x = vec![0.0; m];
    for j in (0..m).rev() {
        let rest: f64 = (j + 1..m).map(|k| r[j][k] * x[k]).sum();
        x[j] = if r[j][j] > 1e-12 {
            (dot(&q[j], b) - rest) / r[j][j]
        } else {
            0.0
        };
    }
    x
}

/// Whether forces at the corners of the areas, made larger by a factor about their middles, balance all loads.
fn balances(joints: &[Joint], loads: &[(f64, Point)], factor: f64, friction: bool) -> bool {
    let total: f64 = loads.iter().map(|load| load.0).sum();
    // Force and moment about the origin of each body, in six rows.
    let wrench = |place: [f64; 3], force: [f64; 3]| {
        let moment = cross(place, force);
        [
            force[0], force[1], force[2], moment[0], moment[1], moment[2],
        ]
    };
    let mut columns = Vec::new();
    for joint in joints {
        let centre = middle(&joint.area);
        for corner in &joint.area {
            let [x, y] = [0, 1].map(|c| centre[c] + factor * (corner[c] - centre[c]));
            let along = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
            let mut directions = vec![[0.0, 0.0, 1.0]];
            if friction {
                directions.extend(along.map(|[x, y]| [x, y, 0.0]));
            }
            for direction in directions {
                let acts = wrench([x, y, joint.height], direction);
                let mut column = vec![0.0; 6 * loads.len()];
                for c in 0..6 {
                    column[6 * joint.upper + c] += acts[c];
                    if let Some(lower) = joint.lower {
                        column[6 * lower + c] -= acts[c];
                    }
                }
                columns.push(column);
            }
        }
    }
    let needed: Vec<f64> = (loads.iter())
        .flat_map(|&(load, [x, y])| wrench([x, y, 0.0], [0.0, 0.0, load / total]))
        .collect();
    least(&columns, &needed) < LEFT
}

/// Two pillars on the table and a bridge on them, which carries another block now and then.
fn bridge<const D: usize>(random: &mut Random) -> Option<(Scene<D>, Vec<Interface>, Fate)>
where
    ElementKind: Solid<D>,
{
    let cell = if D == 2 { [0.06, 0.4] } else { [0.2, 0.5] };
    let body = |name: &str, middle: Point, base: f64, size: [f64; D], random: &mut Random| {
        let low = std::array::from_fn(|c| match c {
            c if c == D - 1 => base,
            c => middle[c] - 0.5 * size[c],
        });
        let mut body = Body::new(name, low, size, random.between(cell[0], cell[1]));
        body.shape = random.below(<ElementKind as Solid<D>>::SHAPES);
        if D == 3 && chance(random, 0.5) && name != "table" {
            body.angle = random.between(-0.5, 0.5);
        }
        body
    };
    let sized = |long: f64, deep: f64, high: f64| {
        let mut size = [deep; D];
        (size[0], size[D - 1]) = (long, high);
        size
    };
    let around =
        |x: f64, random: &mut Random| [x + random.between(-0.2, 0.2), random.between(-0.2, 0.2)];
    let high = random.between(0.3, 0.6);
    let table = body("table", [0.0; 2], -0.4, sized(2.0, 1.2, 0.4), random);
    let mut bodies = vec![table];
    for (name, x) in [("a", -0.7), ("b", 0.7)] {
        let size = sized(random.between(0.4, 0.8), random.between(0.5, 0.9), high);
        let middle = around(x, random);
        bodies.push(body(name, middle, 0.0, size, random));
    }
    let size = sized(random.between(1.3, 2.4), random.between(0.5, 1.0), 0.3);
    let place = around(0.0, random);
    bodies.push(body("bridge", place, high, size, random));
    let loads: Vec<(f64, Point)> = (bodies[1..].iter())
        .map(|body| {
            let middle = body.middle();
            let off = |c: usize, random: &mut Random| random.between(-0.45, 0.45) * body.size[c];
            let mut at = [middle[0], if D == 3 { middle[1] } else { 0.0 }];
            at[0] += off(0, random);
            if D == 3 {
                at[1] += 0.5 * off(1, random);
            }
            (STRAIN * YOUNG * random.between(0.1, 1.0), at)
        })
        .collect();
    // Bodies of joints count without the table.
    let joint = |upper: usize, lower: usize, height: f64| Joint {
        upper: upper - 1,
        lower: lower.checked_sub(1),
        area: common(&bodies[upper].area(), &bodies[lower].area()),
        height,
    };
    let joints = [
        joint(1, 0, 0.0),
        joint(2, 0, 0.0),
        joint(3, 1, high),
        joint(3, 2, high),
    ];
    if joints.iter().any(|joint| !(size_of(joint) > AREA)) {
        return None;
    }
    let fate = if balances(&joints, &loads, 1.0 - CLEAR, false) {
        Fate::Stands
    } else if !balances(&joints, &loads, 1.0 + CLEAR, true) {
        Fate::Falls
    } else {
        return None;
    };
    let first = [0; 3].map(|_| chance(random, 0.5));
    let tops = ["a-top", "b-top"];
    let on_both = match first[2] {
        true => Pair::new("bridge-bottom", tops),
        false => Pair::new(tops, "bridge-bottom"),
    };
    let total: f64 = loads.iter().map(|load| load.0).sum();
    let [on_a, on_b, to_a, to_b] = joints.map(|joint| joint.area);
    let open = |upper_first: bool, area: Area| Interface {
        upper_first,
        areas: vec![area],
        force: total,
        at: None,
    };
    let interfaces = vec![
        open(first[0], on_a),
        open(first[1], on_b),
        Interface {
            upper_first: first[2],
            areas: vec![to_a, to_b],
            force: loads[2].0,
            at: Some(loads[2].1),
        },
    ];
    let scene = Scene {
        frame: <ElementKind as Solid<D>>::frames()[random.below(2)],
        loads: (loads.iter().enumerate())
            .map(|(k, &(force, at))| (k + 1, force, at))
            .collect(),
        pairs: vec![
            pair("a", "table", first[0], MU),
            pair("b", "table", first[1], MU),
            on_both.coulomb(MU),
        ],
        held: vec![("table-bottom".to_owned(), [0.0; D])],
        guided: Vec::new(),
        bodies,
    };
    Some((scene, interfaces, fate))
}

fn size_of(joint: &Joint) -> f64 {
    size(&joint.area)
}

fn bridges<const D: usize>(seed: u64, cases: usize, tally: &mut Tally)
where
    ElementKind: Solid<D>,
{
    let mut random = generator(seed);
    let mut tried = [0; 2];
    while tried.iter().sum::<usize>() < cases {
        let Some((scene, interfaces, fate)) = bridge::<D>(&mut random) else {
            continue;
        };
        // Half of each.
        let count = &mut tried[usize::from(fate == Fate::Falls)];
        if 2 * *count >= cases {
            continue;
        }
        *count += 1;
        let stiffness = path(&mut random);
        let name =
            format!("{D} dimensions, seed {seed}, bridge {tried:?}, {fate:?}, {stiffness:?}");
        tally.add(&name, judge(&scene, &interfaces, fate, stiffness));
    }
}

#[test]
fn bridges_hold_and_fall() {
    let mut tally = Tally::default();
    bridges::<2>(41, 10, &mut tally);
    bridges::<3>(42, 10, &mut tally);
    tally.end();
}

#[test]
#[ignore = "takes some minutes"]
fn two_hundred_bridges_hold_and_fall() {
    let seed = number("STATICS_SEED").unwrap_or(1000);
    let mut tally = Tally::default();
    bridges::<2>(seed, 100, &mut tally);
    bridges::<3>(seed, 100, &mut tally);
    tally.end();
}

#[test]
fn forces_at_corners_balance_as_known() {
    // A beam on two points bears a load between them, and none beyond.
    let at = |x: f64| vec![1.0, x];
    let columns = [at(0.0), at(1.0), at(0.5)];
    for (x, left) in [(0.3, 0.0), (1.0, 0.0), (1.5, 1.0 / 26f64.sqrt())] {
        let found = least(&columns, &at(x));
        assert!((found - left).abs() < 1e-9, "{x}: {found}");
    }
}
