//! Boxes on each other, in the plane and in space alike, with vertical loads whose resultants are known, and the
//! expected results.

use super::common_area::{Area, Point, depth, size};
use crate::common::Random;
use crate::common::models::{Answer, on_the_cpu};
use crate::common::space::{UPRIGHT, rotation};
use signorini::contact::Space;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::model::{BodyForce, Model, Pair, Quantity, Support};
use signorini::solve::SolveOptions;
use signorini::ssnm::Status;

/// The modulus of all bodies that are not softer or stiffer on purpose.
pub const YOUNG: f64 = 1e9;
/// A strain that loads are made to cause: a pressure in the common area is that part of the modulus.
pub const STRAIN: f64 = 1e-4;
/// The default coefficient of friction.
pub const MU: f64 = 0.3;

/// An orthonormal frame: axis c becomes column c.
pub type Frame<const D: usize> = [[f64; D]; D];

pub fn turned<const D: usize>(frame: &Frame<D>, v: [f64; D]) -> [f64; D] {
    std::array::from_fn(|i| (0..D).map(|j| frame[j][i] * v[j]).sum())
}

pub fn back<const D: usize>(frame: &Frame<D>, v: [f64; D]) -> [f64; D] {
    frame.map(|column| (0..D).map(|c| column[c] * v[c]).sum())
}

/// A place seen from above.
pub fn plan<const D: usize>(x: [f64; D]) -> Point {
    match D {
        2 => [x[0], 0.0],
        _ => [x[0], x[1]],
    }
}

/// The differences between the plane and space.
pub trait Solid<const D: usize>: Space<D> {
    /// The shapes of elements that there are, by number.
    const SHAPES: usize;

    /// A box of cells; its boundaries are `name-bottom` …
    fn mesh(shape: usize, low: [f64; D], size: [f64; D], cells: [usize; D], name: &str) -> Mesh<D>
    where
        ElementKind: Topology<D>;

    /// No turn, and by an odd angle.
    fn frames() -> [Frame<D>; 2];

    /// A force in the volume along all axes.
    fn force(within: &str, along: impl Fn(usize) -> Quantity<D>) -> BodyForce<D>;

    /// A displacement that a boundary is given along all axes.
    fn driven(boundary: &str, along: [f64; D]) -> Support<D>;
}

impl Solid<2> for ElementKind {
    const SHAPES: usize = 2;

    fn mesh(shape: usize, low: [f64; 2], size: [f64; 2], cells: [usize; 2], name: &str) -> Mesh {
        let shape = [CellShape::Quad, CellShape::Triangle][shape];
        rectangle(low, size, cells, shape, name, &format!("{name}-"))
    }

    fn frames() -> [Frame<2>; 2] {
        let (sin, cos) = 0.7f64.sin_cos();
        [[[1.0, 0.0], [0.0, 1.0]], [[cos, sin], [-sin, cos]]]
    }

    fn force(within: &str, along: impl Fn(usize) -> Quantity<2>) -> BodyForce<2> {
        BodyForce::within(within).x(along(0)).y(along(1))
    }

    fn driven(boundary: &str, [x, y]: [f64; 2]) -> Support<2> {
        Support::on(boundary).x(x).y(y)
    }
}

impl Solid<3> for ElementKind {
    const SHAPES: usize = 3;

    fn mesh(shape: usize, low: [f64; 3], size: [f64; 3], cells: [usize; 3], name: &str) -> Mesh<3> {
        let shapes = [
            SolidShape::Hexahedron,
            SolidShape::Tetrahedron,
            SolidShape::Wedge,
        ];
        block(low, size, cells, shapes[shape], name, &format!("{name}-"))
    }

    fn frames() -> [Frame<3>; 2] {
        [UPRIGHT, rotation([0.3, 1.0, 0.2], 0.7)]
    }

    fn force(within: &str, along: impl Fn(usize) -> Quantity<3>) -> BodyForce<3> {
        BodyForce::within(within)
            .x(along(0))
            .y(along(1))
            .z(along(2))
    }

    fn driven(boundary: &str, [x, y, z]: [f64; 3]) -> Support<3> {
        Support::on(boundary).x(x).y(y).z(z)
    }
}

/// A box, its last axis upwards.
#[derive(Clone, Debug)]
pub struct Body<const D: usize> {
    pub name: String,
    pub low: [f64; D],
    pub size: [f64; D],
    pub cells: [usize; D],
    pub shape: usize,
    /// The angle about the upright axis through its middle that it is turned by, in space.
    pub angle: f64,
    pub young: f64,
    pub poisson: f64,
    /// The density, under a gravity of 1 m/s².
    pub density: f64,
}

impl<const D: usize> Body<D>
where
    ElementKind: Solid<D>,
{
    /// Of cells about this large, or as many as it takes for one along each axis.
    pub fn new(name: &str, low: [f64; D], size: [f64; D], cell: f64) -> Self {
        Self {
            name: name.to_owned(),
            low,
            size,
            cells: size.map(|length| (length / cell).round().max(1.0) as usize),
            shape: 0,
            angle: 0.0,
            young: YOUNG,
            poisson: 0.2,
            density: 0.0,
        }
    }

    pub fn middle(&self) -> [f64; D] {
        std::array::from_fn(|c| self.low[c] + 0.5 * self.size[c])
    }

    /// A place of the box before it is turned, where it is then.
    fn put(&self, x: [f64; D]) -> [f64; D] {
        self.spun(x, self.angle)
    }

    fn spun(&self, x: [f64; D], angle: f64) -> [f64; D] {
        let (mut x, middle) = (x, self.middle());
        if D == 3 && angle != 0.0 {
            let ((sin, cos), [a, b]) = (angle.sin_cos(), [0, 1].map(|c| x[c] - middle[c]));
            x[0] = middle[0] + cos * a - sin * b;
            x[1] = middle[1] + sin * a + cos * b;
        }
        x
    }

    /// It as seen from above.
    pub fn area(&self) -> Area {
        let corner = |at: [f64; 2]| {
            let mut x = self.low;
            (0..D - 1).for_each(|c| x[c] += at[c] * self.size[c]);
            plan(self.put(x))
        };
        match D {
            2 => [[0.0, 0.0], [1.0, 0.0]].map(corner).to_vec(),
            _ => [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
                .map(corner)
                .to_vec(),
        }
    }

    pub fn volume(&self) -> f64 {
        self.size.iter().product()
    }

    fn mesh(&self) -> Mesh<D> {
        let mut mesh = <ElementKind as Solid<D>>::mesh(
            self.shape, self.low, self.size, self.cells, &self.name,
        );
        mesh.nodes.iter_mut().for_each(|x| *x = self.put(*x));
        mesh
    }

    /// The model in which it neither slides nor turns about the upright axis.
    fn guided(&self, model: Model<D>) -> Model<D> {
        let mut first = self.low;
        first[D - 1] += self.size[D - 1];
        let mut second = first;
        second[0] += self.size[0];
        let [first, second] = [first, second].map(|x| self.put(x));
        let model = model.support(Support::at_point(first).x(0.0));
        match D {
            2 => model,
            // Perpendicular to the line from one corner to the other, whichever axis that is nearer to.
            _ if (second[0] - first[0]).abs() > (second[1] - first[1]).abs() => model
                .support(Support::at_point(first).y(0.0))
                .support(Support::at_point(second).y(0.0)),
            _ => model
                .support(Support::at_point(first).y(0.0))
                .support(Support::at_point(second).x(0.0)),
        }
    }

    /// A downward force in its volume that changes linearly and has this resultant there: with ξ from the middle along an
    /// axis of the box ∫ ξ · 12 d ξ / s² dξ / s is d.
    fn weight(&self, force: f64, at: Point, frame: Frame<D>) -> BodyForce<D> {
        let (body, density) = (self.clone(), force / self.volume());
        let mut target = self.middle();
        (0..D - 1).for_each(|c| target[c] = at[c]);
        let target = self.spun(target, -self.angle);
        let down = move |x: [f64; D]| {
            let local = body.spun(back(&frame, x), -body.angle);
            let along = |c: usize| {
                let middle = body.low[c] + 0.5 * body.size[c];
                12.0 * (target[c] - middle) * (local[c] - middle) / body.size[c].powi(2)
            };
            density * (1.0 + (0..D - 1).map(along).sum::<f64>())
        };
        let up = frame[D - 1];
        <ElementKind as Solid<D>>::force(&self.name, |c| {
            let down = down.clone();
            (move |x: [f64; D]| -up[c] * down(x)).into()
        })
    }
}

/// Some boxes, the contacts of their boundaries, and the loads.
#[derive(Clone)]
pub struct Scene<const D: usize> {
    pub bodies: Vec<Body<D>>,
    pub frame: Frame<D>,
    /// A downward force on a body, and the place of its resultant.
    pub loads: Vec<(usize, f64, Point)>,
    pub pairs: Vec<Pair<D>>,
    /// Boundaries that are held, and where they are moved to.
    pub held: Vec<(String, [f64; D])>,
    /// Bodies that are kept from sliding at corners of their tops, in a scene that is not rotated: because nothing pushes
    /// them, these supports bear neither force nor moment.
    pub guided: Vec<usize>,
}

impl<const D: usize> Scene<D>
where
    ElementKind: Solid<D>,
{
    pub fn model(&self) -> Model<D> {
        let meshes = self.bodies.iter().map(Body::mesh);
        let mut mesh = meshes.reduce(join).expect("there is a body");
        for node in &mut mesh.nodes {
            *node = turned(&self.frame, *node);
        }
        let mut model = Model::on(mesh);
        for body in &self.bodies {
            let material = Material {
                density: body.density,
                ..Material::new(body.young, body.poisson)
            };
            model = model.material_in(&body.name, material);
        }
        for &(body, force, at) in &self.loads {
            model = model.body_force(self.bodies[body].weight(force, at, self.frame));
        }
        if self.bodies.iter().any(|body| body.density > 0.0) {
            model = model.gravity(self.frame[D - 1].map(|c| -c));
        }
        for &body in &self.guided {
            model = self.bodies[body].guided(model);
        }
        for (name, by) in &self.held {
            model = model.support(<ElementKind as Solid<D>>::driven(
                name,
                turned(&self.frame, *by),
            ));
        }
        self.pairs.iter().cloned().fold(model, Model::contact)
    }

    /// The place of contact node i and the force on it, before the turn of the whole.
    pub fn contact(&self, answer: &Answer<D>, i: usize) -> ([f64; D], [f64; D]) {
        let frame = &self.frame;
        (
            back(frame, answer.place(i)),
            back(frame, answer.contact_force(i)),
        )
    }
}

/// The upper body's bottom and the lower one's top, in either order, with friction if there is any.
pub fn pair<const D: usize>(upper: &str, lower: &str, upper_first: bool, mu: f64) -> Pair<D>
where
    ElementKind: Solid<D>,
{
    let names = [format!("{upper}-bottom"), format!("{lower}-top")];
    let [first, second] = match upper_first {
        true => names,
        false => {
            let [a, b] = names;
            [b, a]
        }
    };
    match mu {
        0.0 => Pair::new(first, second),
        _ => Pair::new(first, second).coulomb(mu),
    }
}

/// The variations of a scene, from a stream of random numbers.
pub fn path(random: &mut Random) -> Stiffness {
    [Stiffness::Cholesky, Stiffness::Pcg][random.below(2)]
}

pub fn options(stiffness: Stiffness) -> SolveOptions {
    on_the_cpu(1e-7, stiffness)
}

/// The end of a model with one load step: its result, or the reason why it has none.
pub fn end<const D: usize>(
    model: Model<D>,
    options: &SolveOptions,
) -> Result<(Status, Answer<D>), String>
where
    ElementKind: Space<D>,
{
    let built = model
        .build()
        .map_err(|error| format!("no model: {error}"))?;
    let mut steps = (built.solve(options)).map_err(|error| format!("no solution: {error}"))?;
    let solution = steps.pop().ok_or("no step")?;
    let data = built.step(0).map_err(|error| format!("no load: {error}"))?;
    let answer = Answer {
        built,
        data,
        solution,
        before: Vec::new(),
    };
    Ok((answer.solution.status, answer))
}

/// The expected result of a scene by statics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    Stands,
    Falls,
}

/// A pair of a scene: whether the upper body is named first, the bearing areas, and the transferred resultant.
#[derive(Clone, Debug)]
pub struct Interface {
    pub upper_first: bool,
    /// The common area of the upper body with each of those below it.
    pub areas: Vec<Area>,
    /// In total, or, if statics leaves it open, a force as large as any there.
    pub force: f64,
    /// None where statics leaves the resultant open.
    pub at: Option<Point>,
}

/// Solves a scene, and compares the result.
pub fn judge<const D: usize>(
    scene: &Scene<D>,
    interfaces: &[Interface],
    fate: Fate,
    stiffness: Stiffness,
) -> Result<(), String>
where
    ElementKind: Solid<D>,
{
    let (status, answer) = end(scene.model(), &options(stiffness))?;
    match (fate, status) {
        (Fate::Falls, Status::NotHeld) => Ok(()),
        (Fate::Stands, Status::Converged) => check(scene, &answer, interfaces),
        (Fate::Stands, Status::NotHeld) => Err("it stands, and is said not to be held".to_owned()),
        (Fate::Falls, Status::Converged) => {
            Err("it falls, and forces are given that hold it".to_owned())
        }
        (_, status) => Err(format!("{fate:?} by statics, {NO_ANSWER} {status:?}")),
    }
}

/// A contact force below this part of the load counts as zero, and a resultant may be off by as much.
const SMALL: f64 = 1e-6;
/// A place counts as inside an area up to this part of its size, and up to the rounding of coordinates, which are of the
/// order of one and are turned and projected.
const ON_BORDER: f64 = 1e-9;
const ROUNDING: f64 = 1e-12;

/// That every contact force presses within the common area and within friction's cone, and that they have the resultant
/// that the loads ask for.
fn check<const D: usize>(
    scene: &Scene<D>,
    answer: &Answer<D>,
    interfaces: &[Interface],
) -> Result<(), String>
where
    ElementKind: Solid<D>,
{
    for (number, interface) in interfaces.iter().enumerate() {
        let Interface {
            upper_first,
            areas,
            force: load,
            at,
        } = interface;
        let extent = areas.iter().map(size).fold(0.0, f64::max);
        let about = at.unwrap_or([0.0; 2]);
        // A scene far from the origin, or a small one, has its moment about the position of the resultant.
        let (mut sum, mut moment) = ([0.0; D], [0.0; 2]);
        for i in (0..answer.m()).filter(|&i| answer.built.elastic.pair_of[i] as usize == number) {
            let (place, force) = scene.contact(answer, i);
            let up = match upper_first {
                true => force,
                false => force.map(|f| -f),
            };
            (0..D).for_each(|c| sum[c] += up[c]);
            (0..2).for_each(|c| moment[c] += (plan(place)[c] - about[c]) * up[D - 1]);
            if up[D - 1] < -1e-9 * load {
                return Err(format!("pair {number} pulls at {place:?} with {up:?}"));
            }
            let depths = areas.iter().map(|area| depth(area, plan(place)));
            let inside = depths.fold(f64::NEG_INFINITY, f64::max);
            if up[D - 1] > SMALL * load && inside < -ON_BORDER * extent - ROUNDING {
                return Err(format!(
                    "pair {number}: {:.3e} of the load {:.3e} outside of the common area, which is {extent:.3e} large",
                    up[D - 1] / load,
                    -inside
                ));
            }
        }
        if at.is_none() {
            continue;
        }
        let mut wanted = [0.0; D];
        wanted[D - 1] = *load;
        let off = (0..D)
            .map(|c| (sum[c] - wanted[c]).abs())
            .fold(0.0, f64::max);
        if !(off <= SMALL * load) {
            return Err(format!("pair {number} bears {sum:?}, not {load:e}"));
        }
        let off = moment[0].hypot(moment[1]) / (load * extent);
        if !(off <= SMALL) {
            return Err(format!(
                "pair {number} bears it off its place by {off:e} of the area"
            ));
        }
    }
    Ok(())
}

/// The words for a case without an answer within its time and steps.
const NO_ANSWER: &str = "and ends with";

/// Counts cases, and keeps the errors of some until all have been tried.
#[derive(Default)]
pub struct Tally {
    cases: usize,
    wrong: Vec<String>,
    /// So many cases may end without an answer.
    pub without_answer: usize,
}

impl Tally {
    pub fn add(&mut self, name: &str, result: Result<(), String>) {
        self.cases += 1;
        if let Err(what) = result {
            self.wrong.push(format!("{name}: {what}"));
        }
    }

    /// # Panics
    /// If something was wrong.
    pub fn end(self) {
        let Self {
            cases,
            wrong,
            without_answer,
        } = self;
        let (none, wrong): (Vec<String>, Vec<String>) =
            wrong.into_iter().partition(|what| what.contains(NO_ANSWER));
        if !none.is_empty() {
            println!("{} without an answer:\n{}", none.len(), none.join("\n"));
        }
        assert!(none.len() <= without_answer, "{}", none.join("\n"));
        println!("{cases} cases, {} wrong", wrong.len());
        assert!(
            wrong.is_empty(),
            "{} of {cases} are wrong:\n{}",
            wrong.len(),
            wrong.join("\n")
        );
    }
}
