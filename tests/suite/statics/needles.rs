//! Needles, thinner and thinner, driven into one facet of a block or bearing it: whatever part of the facet they cover, each
//! bears the force that balances.

use super::common_area::{Point, depth};
use super::scene::{
    Body, MU, STRAIN, Scene, Solid, Tally, YOUNG, end, options, path, plan, turned,
};
use crate::common::Random;
use crate::common::draw::generator;
use crate::common::models::Answer;
use signorini::engine::Stiffness;
use signorini::mesh::ElementKind;
use signorini::model::Pair;
use signorini::ssnm::Status;

/// Widths as parts of a facet.
const WIDTHS: [f64; 7] = [0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// How far a needle is driven, in m. It strains the thinnest ones by a hundred and more, which a linear theory does not
/// mind.
const DRIVEN: f64 = 1e-3;
/// The block is so much stiffer that it sinks by 1e-3 of that at most: a few times p w/E, compared with 4 p w/E of the
/// needle.
const STIFFER: f64 = 1e4;
const SUNK: f64 = 1e-3;
/// The block's lowest corner, so that no needle is in the middle of a facet or symmetric to another; facets of 1.
const CORNER: Point = [-1.43, -1.57];

/// A block of four facets a side with its top or its bottom at 0.
fn slab<const D: usize>(above: bool, random: &mut Random) -> Body<D>
where
    ElementKind: Solid<D>,
{
    let base = if above { 0.0 } else { -1.0 };
    let low = std::array::from_fn(|c| if c == D - 1 { base } else { CORNER[c] });
    let size = std::array::from_fn(|c| if c == D - 1 { 1.0 } else { 4.0 });
    let mut slab = Body::new("slab", low, size, 1.0);
    slab.shape = random.below(<ElementKind as Solid<D>>::SHAPES);
    slab
}

/// A needle with its middle at this point, four times as high as it is wide, with its end at 0.
fn needle<const D: usize>(
    name: &str,
    middle: Point,
    width: f64,
    above: bool,
    random: &mut Random,
) -> Body<D>
where
    ElementKind: Solid<D>,
{
    let high = 4.0 * width;
    let base = if above { 0.0 } else { -high };
    let low = std::array::from_fn(|c| match c {
        c if c == D - 1 => base,
        c => middle[c] - 0.5 * width,
    });
    let size = std::array::from_fn(|c| if c == D - 1 { high } else { width });
    let mut needle = Body::new(name, low, size, width);
    let across = 1 + random.below(3);
    needle.cells = std::array::from_fn(|c| if c == D - 1 { 4 } else { across });
    needle.shape = random.below(<ElementKind as Solid<D>>::SHAPES);
    // Without Poisson's effect its pressure is the same everywhere.
    needle.poisson = 0.0;
    needle
}

/// The force of the contacts inside a needle, and their area. The sign of each force is not checked: a needle of one
/// element with five places determines only their sum.
fn borne<const D: usize>(scene: &Scene<D>, answer: &Answer<D>, needle: &Body<D>) -> [f64; 2]
where
    ElementKind: Solid<D>,
{
    let (section, rounding) = (needle.area(), 1e-9 * needle.size[0] + 1e-12);
    let (mut force, mut area) = (0.0, 0.0);
    for i in 0..answer.m() {
        let (place, _) = scene.contact(answer, i);
        let pressed = answer.solution.lambda[i];
        if depth(&section, plan(place)) >= -rounding {
            force += pressed;
            area += answer.area(i);
        }
    }
    [force, area]
}

fn near(what: &str, found: f64, wanted: f64, part: f64) -> Result<(), String> {
    match (found - wanted).abs() <= part * wanted.abs() {
        true => Ok(()),
        false => Err(format!("{what} is {found:e}, not {wanted:e}")),
    }
}

/// E A δ/l, uniformly on the needle's section.
fn driven<const D: usize>(
    width: f64,
    slab_first: bool,
    overlaps: bool,
    random: &mut Random,
) -> Result<(), String>
where
    ElementKind: Solid<D>,
{
    let mut slab = slab::<D>(false, random);
    slab.young *= STIFFER;
    let needle = needle::<D>("needle", [0.0; 2], width, true, random);
    let section = width.powi(D as i32 - 1);
    let pressure = YOUNG * DRIVEN / needle.size[D - 1];
    let names = ["slab-top", "needle-bottom"];
    let [first, second] = if slab_first {
        names
    } else {
        [names[1], names[0]]
    };
    let mut pair = Pair::new(first, second);
    let mut down = [0.0; D];
    match overlaps {
        true => pair = pair.interference(DRIVEN),
        false => down[D - 1] = -DRIVEN,
    }
    let scene = Scene {
        bodies: vec![slab, needle.clone()],
        frame: <ElementKind as Solid<D>>::frames()[random.below(2)],
        loads: Vec::new(),
        guided: Vec::new(),
        pairs: vec![pair],
        held: vec![
            ("slab-bottom".to_owned(), [0.0; D]),
            ("needle-top".to_owned(), down),
        ],
    };
    let (status, answer) = end(scene.model(), &options(way(width, random)))?;
    if status != Status::Converged {
        return Err(format!("{status:?}"));
    }
    let [force, area] = borne(&scene, &answer, &needle);
    let all: f64 = answer.solution.lambda[..answer.m()].iter().sum();
    near("the force in the section", force, all, 1e-6)?;
    near("the force", force, pressure * section, SUNK)?;
    near("the area in contact", area, section, 1e-6)?;
    // If an end has more places than nodes, only their sum is known.
    let nodes = (needle.cells[0] + 1).pow(D as u32 - 1);
    (0..answer.m())
        .filter(|&i| answer.m() <= nodes && answer.solution.lambda[i] > 0.0)
        .try_for_each(|i| {
            near(
                "a nodal pressure",
                answer.pressure(i),
                pressure,
                10.0 * SUNK,
            )
        })
}

/// Iterations cannot resolve such unlike sizes of bodies as well.
fn way(width: f64, random: &mut Random) -> Stiffness {
    if width < 1e-3 {
        Stiffness::Cholesky
    } else {
        path(random)
    }
}

fn all_driven<const D: usize>(seed: u64)
where
    ElementKind: Solid<D>,
{
    let (mut random, mut tally) = (generator(seed), Tally::default());
    for width in WIDTHS {
        for slab_first in [true, false] {
            for overlaps in [true, false] {
                let name =
                    format!("needle of {width:e}, slab first: {slab_first}, overlap: {overlaps}");
                let result = driven::<D>(width, slab_first, overlaps, &mut random);
                tally.add(&name, result);
            }
        }
    }
    tally.end();
}

#[test]
fn needles_driven_into_a_facet() {
    all_driven::<2>(21);
}

#[test]
fn needles_driven_into_a_facet_in_space() {
    all_driven::<3>(22);
}

/// The positions of two needles under one facet, from −0.43 to 0.57 (across it at −0.57 … 0.43), and of the weight
/// between them.
const TWO: [Point; 2] = [[-0.25, 0.0], [0.33, 0.0]];
const BETWEEN: Point = [0.0, 0.0];

/// A slab on two needles of unequal height under one facet of it: the law of the lever, up to the offset of the
/// resultant on each needle from its middle; and none of the force between the needles.
fn on_two<const D: usize>(width: f64, slab_first: bool, random: &mut Random) -> Result<(), String>
where
    ElementKind: Solid<D>,
{
    let slab = slab::<D>(true, random);
    let [a, b] = ["a", "b"];
    let needles = [(a, TWO[0]), (b, TWO[1])]
        .map(|(name, middle)| needle::<D>(name, middle, width, false, random));
    let load = STRAIN * YOUNG * width.powi(D as i32 - 1);
    let frame = <ElementKind as Solid<D>>::frames()[random.below(2)];
    // Along the axis from needle to needle, after the turn.
    let mut across = [0.0; D];
    across[0] = 1.0;
    let across = turned(&frame, across);
    let higher = random.below(2) == 0;
    let overlap = move |x: [f64; D]| {
        let along: f64 = (0..D).map(|c| across[c] * x[c]).sum();
        if (along > 0.0) == higher {
            0.0
        } else {
            STRAIN * width
        }
    };
    let tops = ["a-top", "b-top"];
    let pair = match slab_first {
        true => Pair::new("slab-bottom", tops),
        false => Pair::new(tops, "slab-bottom"),
    };
    let [first, second] = needles.clone();
    let scene = Scene {
        bodies: vec![slab, first, second],
        frame,
        loads: vec![(0, load, BETWEEN)],
        guided: Vec::new(),
        pairs: vec![pair.interference(overlap).coulomb(MU)],
        held: ["a-bottom", "b-bottom"]
            .map(|name| (name.to_owned(), [0.0; D]))
            .to_vec(),
    };
    let (status, answer) = end(scene.model(), &options(way(width, random)))?;
    if status != Status::Converged {
        return Err(format!("{status:?}"));
    }
    let forces = [0, 1].map(|k| borne(&scene, &answer, &needles[k])[0]);
    near("the force on both", forces[0] + forces[1], load, 1e-6)?;
    let apart = TWO[1][0] - TWO[0][0];
    for (k, other) in [(0, 1), (1, 0)] {
        let share = (TWO[other][0] - BETWEEN[0]).abs() / apart;
        let off = (forces[k] / load - share).abs();
        // The resultants may be half a width off the middle of either needle.
        if !(off <= width / apart + 1e-6) {
            return Err(format!(
                "needle {k} bears {} of the load, not {share}",
                forces[k] / load
            ));
        }
    }
    Ok(())
}

fn all_on_two<const D: usize>(seed: u64, widths: &[f64])
where
    ElementKind: Solid<D>,
{
    let (mut random, mut tally) = (generator(seed), Tally::default());
    for &width in widths {
        for slab_first in [true, false] {
            for _ in 0..2 {
                let name = format!("on two needles of {width:e}, slab first: {slab_first}");
                tally.add(&name, on_two::<D>(width, slab_first, &mut random));
            }
        }
    }
    tally.end();
}

#[test]
fn a_slab_on_two_needles_under_one_facet() {
    all_on_two::<2>(23, &[0.3, 0.1, 1e-2, 1e-3, 1e-4, 1e-5]);
}

#[test]
fn a_slab_on_two_needles_under_one_facet_in_space() {
    // Thinner ones have almost no moment perpendicular to the line between them, compared with the slab's size.
    all_on_two::<3>(24, &[0.3, 0.1, 1e-2, 1e-3]);
}
