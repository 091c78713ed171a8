//! Random stacks of blocks that hang over each other and over the table: each interface transfers the weight of everything
//! above it, so a stack is held exactly if at each interface the resultant of that weight is inside the common area.

use super::common_area::{common, depth, size};
use super::scene::{Body, Fate, Interface, STRAIN, Scene, Solid, Tally, YOUNG, judge, pair, path};
use crate::common::Random;
use crate::common::draw::{chance, generator, number};
use signorini::mesh::ElementKind;

/// How far from the border of the common area resultants are at least, as a part of its size.
const CLEAR: f64 = 0.01;
/// Common areas smaller than this, for blocks of about 1, are not required.
const AREA: f64 = 0.1;
/// High enough that nothing slides.
const MU: f64 = 0.5;

/// A stack on a table with its edge at x = 0.
pub struct Stack<const D: usize> {
    pub scene: Scene<D>,
    pub interfaces: Vec<Interface>,
    /// The least distance of a resultant from the border of the common area, as a part of its size; negative outside.
    pub margin: f64,
}

impl<const D: usize> Stack<D>
where
    ElementKind: Solid<D>,
{
    pub fn random(random: &mut Random) -> Self {
        let shapes = <ElementKind as Solid<D>>::SHAPES;
        // The finest meshes have some thousand unknowns.
        let cell = |random: &mut Random| match D {
            2 => random.between(0.05, 0.4),
            _ => random.between(0.2, 0.6),
        };
        let mut low = [-1.5; D];
        low[0] = -3.0;
        low[D - 1] = -0.4;
        let mut extent = [3.0; D];
        extent[D - 1] = 0.4;
        let mut bodies = vec![Body::new("table", low, extent, cell(random))];
        bodies[0].shape = random.below(shapes);
        let (mut middle, mut top) = ([-0.3, 0.0], 0.0);
        let (mut loads, mut pairs, mut uppers) = (Vec::new(), Vec::new(), Vec::new());
        for k in 1..=2 + random.below(3) {
            let mut size: [f64; D] = std::array::from_fn(|_| random.between(0.6, 1.6));
            size[D - 1] = random.between(0.2, 0.5);
            (0..D - 1).for_each(|c| middle[c] += random.between(-0.4, 0.4));
            let low = std::array::from_fn(|c| match c {
                c if c == D - 1 => top,
                c => middle[c] - 0.5 * size[c],
            });
            let mut body = Body::new(&format!("block{k}"), low, size, cell(random));
            body.shape = random.below(shapes);
            if D == 3 && chance(random, 0.6) {
                body.angle = random.between(-3.2, 3.2);
            }
            top += size[D - 1];
            // Some are heavier on one side.
            let mut at = middle;
            if chance(random, 0.5) {
                (0..D - 1).for_each(|c| at[c] += random.between(-0.3, 0.3) * size[c]);
            }
            loads.push((k, STRAIN * YOUNG * random.between(0.1, 1.0), at));
            let upper_first = chance(random, 0.5);
            pairs.push(pair(&body.name, &bodies[k - 1].name, upper_first, MU));
            uppers.push(upper_first);
            bodies.push(body);
        }
        let interfaces: Vec<Interface> = (uppers.into_iter().enumerate())
            .map(|(k, upper_first)| {
                let above = &loads[k..];
                let force: f64 = above.iter().map(|load| load.1).sum();
                let moment = |c: usize| above.iter().map(|load| load.1 * load.2[c]).sum::<f64>();
                Interface {
                    upper_first,
                    areas: vec![common(&bodies[k + 1].area(), &bodies[k].area())],
                    force,
                    at: Some([0, 1].map(|c| moment(c) / force)),
                }
            })
            .collect();
        let margins = interfaces.iter().map(|i| match (size(&i.areas[0]), i.at) {
            (extent, Some(at)) if extent > 0.0 => depth(&i.areas[0], at) / extent,
            _ => f64::NEG_INFINITY,
        });
        let margin = margins.fold(f64::INFINITY, f64::min);
        let scene = Scene {
            bodies,
            frame: <ElementKind as Solid<D>>::frames()[random.below(2)],
            loads,
            pairs,
            held: vec![("table-bottom".to_owned(), [0.0; D])],
            guided: Vec::new(),
        };
        Self {
            scene,
            interfaces,
            margin,
        }
    }

    /// Whether all neighbours have some common area.
    pub fn touches(&self) -> bool {
        self.interfaces.iter().all(|i| size(&i.areas[0]) > AREA)
    }

    /// The next that has this fate, clearly.
    fn of(fate: Fate, random: &mut Random) -> Self {
        loop {
            let stack = Self::random(random);
            let is_it = match fate {
                Fate::Stands => stack.margin > CLEAR,
                Fate::Falls => stack.margin < -CLEAR,
            };
            if is_it && stack.touches() {
                return stack;
            }
        }
    }
}

/// As many stacks as that, half of them held.
fn stacks<const D: usize>(seed: u64, cases: u64, tally: &mut Tally)
where
    ElementKind: Solid<D>,
{
    for case in 0..cases {
        let mut random = generator(seed + case);
        let fate = [Fate::Stands, Fate::Falls][case as usize % 2];
        let Stack {
            scene,
            interfaces,
            margin,
        } = Stack::<D>::of(fate, &mut random);
        let stiffness = path(&mut random);
        let name = format!(
            "{D} dimensions, seed {}, {} blocks, margin {margin:.3}, {stiffness:?}",
            seed + case,
            interfaces.len()
        );
        tally.add(&name, judge(&scene, &interfaces, fate, stiffness));
    }
}

#[test]
fn stacks_hold_and_fall() {
    let mut tally = Tally::default();
    stacks::<2>(0, 20, &mut tally);
    stacks::<3>(0, 20, &mut tally);
    tally.end();
}

#[test]
#[ignore = "takes some minutes"]
fn a_thousand_stacks_hold_and_fall() {
    let seed = number("STATICS_SEED").unwrap_or(1000);
    // Bodies that fall may give up without saying that nothing holds them.
    let mut tally = Tally::default();
    tally.without_answer = 20;
    stacks::<2>(seed, 500, &mut tally);
    stacks::<3>(seed, 500, &mut tally);
    tally.end();
}
