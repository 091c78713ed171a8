//! The whole of a body that repeats itself about an axis, from the results of one sector.

use super::{ContactFields, OfBodies, StepFields};
use crate::contact::{ContactPlace, Space};
use crate::elasticity::Stress;
use crate::mesh::{ElementKind, Topology};
use crate::model::Elastic;

/// All sectors at the end of a load step.
pub(crate) struct Whole<const D: usize>
where
    ElementKind: Topology<D>,
{
    /// The bodies and contact places of all sectors; the matrices are those of one.
    pub elastic: Elastic<D>,
    pub fields: StepFields<D>,
    pub contact: ContactFields<D>,
}

impl<const D: usize> OfBodies<'_, D>
where
    ElementKind: Space<D>,
{
    /// All sectors of the first so many elements, if results are wanted for them.
    pub(crate) fn whole(&self, elements: usize) -> Option<Whole<D>> {
        let (axis, sectors) = self.elastic.sectors?;
        let n = self.elastic.mesh.nodes.len() as u32;
        let mut sector = self.elastic.mesh.clone();
        sector.elements.truncate(elements);
        let mut elastic = self.elastic.clone();
        elastic.mesh = sector.clone();
        let mut fields = StepFields {
            displacement: self.fields.displacement.clone(),
            at_nodes: self.fields.at_nodes.clone(),
            in_elements: self.fields.in_elements[..elements].to_vec(),
            rubbed: (self.fields.rubbed.as_ref()).map(|rubbed| rubbed.repeat(sectors as usize)),
        };
        let mut frames = self.contact.frames.clone();
        let places = &self.elastic.contact.places;
        let n_pools = places.iter().map(|place| place.pool + 1).max().unwrap_or(0);
        for k in 1..sectors {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(sectors);
            let start = axis.turned([0.0; D], angle);
            let turned = |v: [f64; D]| -> [f64; D] {
                let end = axis.turned(v, angle);
                std::array::from_fn(|c| end[c] - start[c])
            };
            let first = k * n;
            let mut copy = sector.clone();
            copy.place_nodes(|x| axis.turned(x, angle));
            copy.renumber(|node| node + first);
            let mesh = &mut elastic.mesh;
            mesh.nodes.extend(copy.nodes);
            mesh.elements.extend(copy.elements);
            for (name, facets) in copy.boundaries {
                mesh.boundaries.entry(name).or_default().extend(facets);
            }
            for (name, nodes) in copy.node_sets {
                mesh.node_sets.entry(name).or_default().extend(nodes);
            }
            let displacement = self.fields.displacement.iter();
            fields.displacement.extend(displacement.map(|&u| turned(u)));
            let ways: [[f64; D]; D] = std::array::from_fn(|d| {
                turned(std::array::from_fn(|c| f64::from(u8::from(c == d))))
            });
            let stress = |s: &Stress| s.turned(&ways);
            fields
                .at_nodes
                .extend(self.fields.at_nodes.iter().map(stress));
            let in_elements = &self.fields.in_elements[..elements];
            fields.in_elements.extend(in_elements.iter().map(stress));
            frames.extend(self.contact.frames.iter().map(|frame| frame.map(turned)));
            let moved = |all: &[(u32, f64)]| -> Vec<(u32, f64)> {
                let all = all.iter();
                // Images are nodes of the sectors that they are in.
                all.map(|&(node, weight)| ((node + first) % (n * sectors), weight))
                    .collect()
            };
            elastic
                .contact
                .places
                .extend(places.iter().map(|place| ContactPlace {
                    place: axis.turned(place.place, angle),
                    node: place.node.map(|node| node + first),
                    own: moved(&place.own),
                    partners: moved(&place.partners),
                    directed: Vec::new(),
                    further: Vec::new(),
                    frame: place.frame.map(turned),
                    pool: place.pool + k * n_pools,
                    ..place.clone()
                }));
        }
        elastic.pair_of = self.elastic.pair_of.repeat(sectors as usize);
        let all = |values: &Vec<f64>| values.repeat(sectors as usize);
        let of = &self.contact;
        let contact = ContactFields {
            gap: all(&of.gap),
            pressure: all(&of.pressure),
            traction: all(&of.traction),
            bound: all(&of.bound),
            slip: all(&of.slip),
            worn: all(&of.worn),
            frames,
            status: of.status.repeat(sectors as usize),
            any_friction: of.any_friction,
        };
        Some(Whole {
            elastic,
            fields,
            contact,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::contact::Obstacle;
    use crate::elasticity::Material;
    use crate::engine::Engine;
    use crate::mesh::structured::{CellShape, rectangle};
    use crate::mesh::vector::{dot, length, minus, unit};
    use crate::model::{Analysis, Axis, Cyclic, Model, Pair, Support, Temperature};
    use crate::output::{StepResults, vtu};
    use crate::solve::Event;
    use std::f64::consts::{PI, TAU};
    use std::ops::ControlFlow;

    /// A ring of seven sectors that shrinks onto a shaft: all fields of the whole are the same all around.
    #[test]
    fn a_ring_of_sectors_is_whole() {
        let bend = |[s, t]: [f64; 2]| {
            let (r, angle) = (1.0 + s, TAU * t / 7.0);
            [r * angle.cos(), r * angle.sin()]
        };
        let mut mesh = rectangle([0.0; 2], [1.0; 2], [3, 3], CellShape::Quad, "disc", "");
        mesh.place_nodes(bend);
        let axis = Axis::at([0.0; 2]);
        let shaft = Obstacle::Sphere {
            center: [0.0; 2],
            radius: 1.0,
        };
        let plane = Model::on(mesh)
            .material(Material {
                expansion: 1e-5,
                ..Material::new(2e11, 0.3)
            })
            .support(Support::on("right").about(axis).hoop(0.0))
            .temperature(Temperature::everywhere(-100.0))
            .contact(Pair::obstacle("left", shaft))
            .cyclic(Cyclic::between("bottom", "top", axis, 7).whole());
        let built = plane.build().expect("a ring");
        let mut seen = 0;
        let analysis = Analysis::from(&built);
        let mut engine =
            Engine::new(analysis.problem, Default::default(), |_| ()).expect("an engine");
        let solved = analysis.solve_on(&mut engine, &Default::default(), |event| {
            if let Event::Ends(step) = event {
                let of = StepResults::new(analysis, &step).of_bodies.expect("bodies");
                let all = of.whole(9).expect("all sectors");
                let mesh = &all.elastic.mesh;
                assert_eq!((mesh.nodes.len(), mesh.elements.len()), (7 * 16, 7 * 9));
                assert_eq!(mesh.boundaries["right"].len(), 21);
                // Areas add up to that of both polygons.
                let corner = |nodes: &[u32], i: usize| mesh.nodes[nodes[i % 4] as usize];
                let area: f64 = (mesh.elements.iter())
                    .flat_map(|e| {
                        (0..4).map(move |i| [corner(e.nodes(), i), corner(e.nodes(), i + 1)])
                    })
                    .map(|[a, b]| 0.5 * (a[0] * b[1] - a[1] * b[0]))
                    .sum();
                let polygon = 10.5 * (TAU / 21.0).sin() * 3.0;
                assert!((area - polygon).abs() < 1e-12 && area < 3.0 * PI, "{area}");
                let fields = all.fields.displacement.iter().zip(&all.fields.at_nodes);
                for (i, (x, (u, s))) in mesh.nodes.iter().zip(fields).enumerate() {
                    let way = unit(*x);
                    let first = i % 16;
                    let radial = dot(*u, way);
                    let own = of.fields.displacement[first];
                    assert!(
                        (radial - dot(own, unit(mesh.nodes[first]))).abs() < 1e-15 && radial < 1e-9
                    );
                    assert!((length(*u) + radial).abs() < 1e-12);
                    let along = way[0] * (s.xx * way[0] + s.xy * way[1])
                        + way[1] * (s.xy * way[0] + s.yy * way[1]);
                    let s = &of.fields.at_nodes[first];
                    let [c, d] = unit(mesh.nodes[first]);
                    let expected = c * (s.xx * c + s.xy * d) + d * (s.xy * c + s.yy * d);
                    assert!(
                        (along - expected).abs() < 1e-9 * expected.abs().max(1e6),
                        "{along} {expected}"
                    );
                }
                let places = &all.elastic.contact.places;
                assert_eq!(all.contact.pressure.len(), places.len());
                let mut pressed = 0;
                let values = places.iter().zip(&all.contact.pressure);
                let of_shaft = values
                    .zip(&all.elastic.pair_of)
                    .filter(|(_, pair)| **pair == 0);
                for ((place, &p), _) in of_shaft {
                    let node = place.node.expect("a node");
                    let off = minus(mesh.nodes[node as usize], place.place);
                    assert!(length(off) < 1e-12 && p > 0.0);
                    assert!((dot(place.frame[0], unit(place.place)) + 1.0).abs() < 1e-12);
                    pressed += 1;
                }
                assert_eq!(pressed, 7 * 4);
                let file = String::from_utf8(vtu::text(&of, 9).concat()).expect("a text");
                assert!(file.contains("NumberOfPoints=\"112\" NumberOfCells=\"63\""));
                seen += 1;
            }
            ControlFlow::Continue(())
        });
        solved.expect("solved");
        assert_eq!(seen, 1);
    }
}
