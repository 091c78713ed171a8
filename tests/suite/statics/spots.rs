//! Spots of contact within one facet: a small foot on a large body, and a large body that is balanced on a small foot.
//! Either bears a force whose line of action goes through the foot, and no other.

use super::common_area::common;
use super::scene::{
    Body, Fate, Interface, MU, STRAIN, Scene, Solid, Tally, YOUNG, judge, pair, path,
};
use crate::common::Random;
use crate::common::draw::generator;
use signorini::engine::Stiffness;
use signorini::mesh::ElementKind;

/// Widths of the foot as parts of a facet.
const WIDTHS: [f64; 7] = [0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// Where the force acts, from the middle of the foot to its border.
const INSIDE: f64 = 0.98;
const OUTSIDE: f64 = 1.02;

/// A foot of this width on top of a slab of four facets a side, or below it; somewhere in one facet.
fn spot<const D: usize>(width: f64, below: bool, random: &mut Random, tally: &mut Tally)
where
    ElementKind: Solid<D>,
{
    let side = |long: f64, high: f64| {
        let mut size = [long; D];
        size[D - 1] = high;
        size
    };
    let at = |place: [f64; 2], high: f64| {
        std::array::from_fn(|c| if c == D - 1 { high } else { place[c] })
    };
    let slab_low = at([-1.43, -1.57], if below { 0.0 } else { -1.0 });
    let foot_low = at([-0.5 * width; 2], if below { -width } else { 0.0 });
    // Through a side, and in space through a corner.
    let directions: &[[f64; 2]] = match D {
        2 => &[[1.0, 0.0], [-1.0, 0.0]],
        _ => &[[1.0, 0.3], [-1.0, 1.0]],
    };
    for &direction in directions {
        for (part, fate) in [(INSIDE, Fate::Stands), (OUTSIDE, Fate::Falls)] {
            for upper_first in [true, false] {
                let mut slab = Body::new("slab", slab_low, side(4.0, 1.0), 1.0);
                let mut foot = Body::new("foot", foot_low, side(width, width), 0.5 * width);
                slab.shape = random.below(<ElementKind as Solid<D>>::SHAPES);
                foot.shape = random.below(<ElementKind as Solid<D>>::SHAPES);
                let area = common(&foot.area(), &slab.area());
                let place = direction.map(|d| 0.5 * width * part * d);
                let force = STRAIN * YOUNG * width.powi(D as i32 - 1);
                let [upper, lower] = if below { [slab, foot] } else { [foot, slab] };
                // Iterations cannot resolve such unlike sizes of bodies as well.
                let stiffness = if width < 1e-3 {
                    Stiffness::Cholesky
                } else {
                    path(random)
                };
                let name = format!(
                    "{D} dimensions, foot of {width:e} {} the slab, {upper_first}, {stiffness:?}, force at {part} along \
                     {direction:?}",
                    if below { "below" } else { "on" },
                );
                let scene = Scene {
                    frame: <ElementKind as Solid<D>>::frames()[random.below(2)],
                    loads: vec![(1, force, place)],
                    pairs: vec![pair(&upper.name, &lower.name, upper_first, MU)],
                    held: vec![(format!("{}-bottom", lower.name), [0.0; D])],
                    guided: Vec::new(),
                    bodies: vec![lower, upper],
                };
                let interface = Interface {
                    upper_first,
                    areas: vec![area],
                    force,
                    at: Some(place),
                };
                tally.add(&name, judge(&scene, &[interface], fate, stiffness));
            }
        }
    }
}

fn spots<const D: usize>(below: bool, seed: u64, widths: &[f64])
where
    ElementKind: Solid<D>,
{
    let (mut random, mut tally) = (generator(seed), Tally::default());
    for &width in widths {
        spot::<D>(width, below, &mut random, &mut tally);
    }
    tally.end();
}

#[test]
fn feet_on_a_facet() {
    spots::<2>(false, 11, &WIDTHS);
}

#[test]
fn feet_on_a_facet_in_space() {
    spots::<3>(false, 12, &WIDTHS);
}

#[test]
fn slabs_balanced_on_a_foot() {
    // On narrower ones in and out differ by less of the slab than multipliers are known to.
    spots::<2>(true, 13, &WIDTHS[..5]);
}

#[test]
fn slabs_balanced_on_a_foot_in_space() {
    // On a millionth, inside and outside differ by 1e-8 of the slab: less than the factors of K resolve.
    spots::<3>(true, 14, &WIDTHS[..6]);
}
