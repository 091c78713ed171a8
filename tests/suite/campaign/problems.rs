//! Random problems of any units, some with a known answer: each follows from its seed alone.

mod known;
mod matrices;

use crate::common::Random;
use crate::common::cases::{Laws, Range, Trial, Written, elastic, half_plane, one_body, stack};
use crate::common::draw::{chance, decade, generator, pick};
use known::{Known, known};
use matrices::matrices;

/// A problem of a family, with the known data of its answer.
pub struct Problem<const D: usize = 2> {
    pub family: &'static str,
    pub trial: Trial<D>,
    pub known: Option<Known>,
    /// Whether forces can balance the loads, by statics.
    pub held: Option<bool>,
}

/// The problem of a seed, or why it could not be built.
pub fn problem(seed: u64) -> Result<Problem, String> {
    let mut random = generator(seed ^ 0x00ca_4d41_6000_0000);
    let random = &mut random;
    let plain = |family, trial| Problem {
        family,
        trial,
        known: None,
        held: None,
    };
    Ok(match random.below(20) {
        0..=5 => known(random),
        6..=9 => plain("matrices", matrices(random)),
        10..=14 => plain("block", elastic(block(random))?),
        15..=17 => plain("stack", elastic(pile(random))?),
        _ => {
            let (written, held) = edge(random);
            Problem {
                held,
                ..plain("edge", elastic(written)?)
            }
        }
    })
}

/// Any units; mostly small.
pub fn range(random: &mut Random) -> Range {
    Range {
        young: [-6.0, 12.0],
        length: [-6.0, 3.0],
        nodes: match random.below(20) {
            0..=9 => 20,
            10..=15 => 80,
            16..=18 => 250,
            _ => 900,
        },
        laws: pick(random, &[Laws::Any, Laws::Any, Laws::Given, Laws::Coulomb]),
    }
}

pub fn block(random: &mut Random) -> Written {
    let range = range(random);
    one_body(random, range)
}

pub fn pile(random: &mut Random) -> Written {
    let mut range = range(random);
    range.nodes = range.nodes.min(400);
    stack(random, range)
}

/// A block on a floor that is pushed nearly to its limit of sliding or tipping. All tractions are uniform, so that
/// statics gives the limit.
pub fn edge(random: &mut Random) -> (Written, Option<bool>) {
    let young = decade(random, -4.0, 12.0);
    let scale = decade(random, -5.0, 3.0);
    let (w, h) = (
        scale * random.between(0.5, 3.0),
        scale * random.between(0.3, 2.0),
    );
    let (nx, ny) = (1 + random.below(10), 1 + random.below(6));
    let p = young * decade(random, -6.0, -2.0);
    let part = match random.below(9) {
        0 => 0.0,
        k => 10f64.powi(-(k as i32)),
    };
    let factor = 1.0 + if chance(random, 0.5) { part } else { -part };
    // The push acts in the middle of the height: it tips where more than w/h of the load.
    let tips = chance(random, 0.3);
    let most = w / h;
    let (law, push, what) = if tips {
        let mu = most * random.between(1.1, 2.0);
        (
            format!("{{ coulomb = {mu:e} }}"),
            most * p,
            "tips, coulomb".to_owned(),
        )
    } else if chance(random, 0.5) {
        let mu = most * random.between(0.05, 0.9);
        (
            format!("{{ coulomb = {mu:e} }}"),
            mu * p,
            format!("slides, coulomb {mu:.2}"),
        )
    } else {
        let bound = p * most * random.between(0.05, 0.9);
        (
            format!("{{ tresca = {bound:e} }}"),
            bound,
            "slides, tresca".to_owned(),
        )
    };
    let push = factor * push * pick(random, &[-1.0, 1.0]);
    // As a body force: its sum is push·w, its arm h/2.
    let text = format!(
        "[mesh.rectangle]\norigin = [{:e}, 0]\nsize = [{w:e}, {h:e}]\ncells = [{nx}, {ny}]\n\
         [[material]]\nyoung = {young:e}\npoisson = 0.3\n\
         [[traction]]\nboundary = \"top\"\npressure = {p:e}\n\
         [[body_force]]\nx = {:e}\n{}",
        -0.5 * w,
        push / h,
        half_plane("bottom", [0.0; 2], [0.0, 1.0], &law)
    );
    (
        Written {
            name: format!("edge: block {nx}x{ny}, {what}, pushed {factor:.9}"),
            text,
        },
        (part > 0.0).then_some(factor < 1.0),
    )
}
