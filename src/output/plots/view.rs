//! The view of bodies in `report.html`, which solids can be turned in: the data for `view.js`, as text.

use super::bodies::Bodies;
use super::legend::{short, state, states, ticks, top, top_pressure};
use super::obstacles::Patch;
use super::raster::VIRIDIS;
use super::surface::Surface;
use crate::mesh::vector::{bounds, length, minus};
use crate::mesh::{ElementKind, Topology};
use crate::output::shown_at_nodes;
use base64::Engine as _;
use serde_json::{Value, json};
use std::borrow::Cow;

/// The largest size that the view may add to the page, in bytes.
const LARGEST_PAGE: usize = 8 << 20;
const SCRIPT: &str = include_str!("view.js");
/// The style of the view and of its controls.
pub(super) const STYLE: &str = "
.controls { display: flex; flex-wrap: wrap; gap: .4rem 1.2rem; align-items: center; margin: .6rem 0; font-size: 14px } .controls input { vertical-align: middle } .controls .number { display: inline-block; min-width: 3.2em }
.stage { position: relative; height: 540px; border: 1px solid var(--line); color: #222; background: #fff } .stage canvas:focus-visible { outline: 3px solid #0072b2; outline-offset: 2px } .stage .value { position: absolute; left: 14px; top: 10px; margin: 0; font-size: 14px; pointer-events: none } .stage canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; cursor: grab } .stage canvas.axes { pointer-events: none }
.legend { position: absolute; top: 14px; right: 16px; min-width: 5.5em; font-size: 13px; pointer-events: none } .legend .strip { position: relative; width: 16px; height: 260px; margin: .7em 0; border: 1px solid #222 } .legend .strip span { position: absolute; left: 24px; white-space: nowrap; line-height: 1.2 } .legend .part i { display: inline-block; width: 1em; height: 1em; margin-right: .5em; vertical-align: -.1em }
.legend .dot i { border: 1px solid #222; border-radius: 50% } @media print { #bodies, #bodies + noscript + p { display: none !important } }
";
/// Values of a field are stored in this many steps from 0 to the value with the last of the colours.
const STEPS: f64 = 65534.0;
/// The code for a missing value.
const UNKNOWN: u16 = 65535;

/// The data of a step in the view.
#[derive(Clone, Debug)]
pub struct View {
    /// The surface at rest, from where it is looked at first, and its colours: the same for all steps.
    rest: String,
    /// Rigid obstacles, which may move from step to step.
    obstacles: String,
    /// The end of the step.
    step: String,
}

impl View {
    /// The view of a step: the surface of the bodies, rigid obstacles, and the direction to the viewer.
    pub(super) fn new<const D: usize>(
        bodies: &Bodies<D>,
        surface: &Surface,
        obstacles: &[Patch],
        back: [f64; 3],
    ) -> Self
    where
        ElementKind: Topology<D>,
    {
        let places = (surface.vertices.iter())
            .map(|vertex| in_space(bodies.elastic.mesh.nodes[vertex.node as usize]));
        let (low, high) = bounds(places.clone());
        let size = minus(high, low);
        let places = places.map(|x| minus(x, low));
        let triangles = obstacles.iter().flat_map(Patch::triangles).flatten();
        let obstacles = triangles.flat_map(|x| minus(x, low));
        Self {
            rest: text(&rest(
                &bodies.elastic.mesh.regions,
                surface,
                places,
                size,
                back,
                D == 2,
            )),
            // Triangles: nine numbers each.
            obstacles: packed(obstacles.map(|v| (v as f32).to_le_bytes())),
            step: text(&step(bodies, surface)),
        }
    }
}

/// The same in space; the plane has z = 0.
fn in_space<const D: usize>(x: [f64; D]) -> [f64; 3] {
    std::array::from_fn(|c| x.get(c).copied().unwrap_or(0.0))
}

/// Numbers from the lowest byte on in base64.
fn packed<const N: usize>(numbers: impl Iterator<Item = [u8; N]>) -> String {
    let bytes: Vec<u8> = numbers.flatten().collect();
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

/// JSON that no text in it can end early.
fn text(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// A number as a part of the largest, rounded.
fn scaled(value: f64, largest: f64, steps: f64) -> f64 {
    if largest > 0.0 {
        (steps * (value / largest).clamp(-1.0, 1.0)).round()
    } else {
        0.0
    }
}

/// The surface at rest; its places count from their lowest corner.
fn rest(
    regions: &[String],
    surface: &Surface,
    places: impl Iterator<Item = [f64; 3]>,
    size: [f64; 3],
    back: [f64; 3],
    is_plane: bool,
) -> Value {
    let places = places.flat_map(|x| [0, 1, 2].map(|c| scaled(x[c], size[c], 65535.0)));
    let normals = surface.vertices.iter().flat_map(|vertex| vertex.normal);
    let facets = surface.facets.iter().flat_map(|facet| facet.vertices);
    // Sharp edges with the part and the vertices of their first facet.
    let mut sharp: Vec<(u32, [u32; 2])> = (surface.edges.iter())
        .filter(|edge| edge.sharp)
        .map(|edge| {
            let facet = &surface.facets[edge.facets[0] as usize];
            let corner = |node| facet.nodes.iter().position(|&n| n == node);
            let ends = edge
                .ends
                .map(|node| facet.vertices[corner(node).unwrap_or(0)]);
            (facet.region, ends)
        })
        .collect();
    sharp.sort_by_key(|&(region, _)| region);
    // The parts with their facets and edges, from one number to another.
    let parts = (0..).zip(regions).filter_map(|(region, name)| {
        let ends = [region, region + 1];
        let facets = ends.map(|r| surface.facets.partition_point(|f| f.region < r));
        let edges = ends.map(|r| sharp.partition_point(|e| e.0 < r));
        (facets[0] < facets[1]).then(|| json!({"name": name, "facets": facets, "edges": edges}))
    });
    json!({
        "colours": VIRIDIS,
        "plane": is_plane,
        "back": back,
        // Of places 65535 is the whole extent, of normals 127 is 1.
        "size": size,
        "places": packed(places.map(|v| (v as u16).to_le_bytes())),
        "normals": packed(normals.map(|v| ((127.0 * v).round() as i8).to_le_bytes())),
        // Four vertices each, of a triangle the last twice; of sharp edges two.
        "facets": packed(facets.map(u32::to_le_bytes)),
        "edges": packed(sharp.iter().flat_map(|edge| edge.1).map(u32::to_le_bytes)),
        "parts": parts.collect::<Vec<_>>(),
    })
}

/// The contact pressure at each node of the mesh with one: at contact places, and on the other side the mean of the
/// pressures on it.
fn pressures<const D: usize>(bodies: &Bodies<D>) -> Vec<Option<f64>>
where
    ElementKind: Topology<D>,
{
    let (elastic, contact) = (bodies.elastic, bodies.contact);
    let mut sums = vec![(0.0, 0.0); elastic.mesh.nodes.len()];
    for (place, &value) in elastic.contact.places.iter().zip(&contact.pressure) {
        for &(partner, weight) in place.partners.iter().filter(|(_, weight)| *weight > 0.0) {
            let partner = place.node_in(partner, sums.len());
            let sum = &mut sums[partner as usize];
            *sum = (sum.0 + weight * value, sum.1 + weight);
        }
    }
    let means = sums
        .iter()
        .map(|&(sum, weight)| (weight > 0.0).then(|| sum / weight));
    let mut pressures: Vec<Option<f64>> = means.collect();
    for (node, i) in shown_at_nodes(elastic, contact, None) {
        pressures[node as usize] = Some(contact.pressure[i]);
    }
    pressures
}

/// Displacements, stresses and pressures of a step; in the plane, where pressures act on lines, the states of contact nodes.
fn step<const D: usize>(bodies: &Bodies<D>, surface: &Surface) -> Value
where
    ElementKind: Topology<D>,
{
    let vertices = &surface.vertices;
    let (units, displacement) = (&bodies.elastic.units, &bodies.fields.displacement);
    let field = |name: &str, unit: &str, top: f64, values: &[Option<f64>]| {
        let largest = values.iter().flatten().copied().fold(0.0, f64::max);
        let number = |value: f64| scaled(value.max(0.0), top, STEPS) as u16;
        let shown = vertices
            .iter()
            .map(|vertex| values[vertex.node as usize].map_or(UNKNOWN, number));
        let ticks = ticks(top, largest).map(|v| json!([v / top, short(v)]));
        json!({
            "name": name,
            "unit": unit,
            // The value of the last colour.
            "top": top,
            "values": packed(shown.map(u16::to_le_bytes)),
            // The positions of numbers beside the colours, as parts of the whole bar.
            "ticks": ticks.collect::<Vec<_>>(),
            "largest": (largest > top).then(|| short(largest)),
        })
    };
    let stress = units.stress();
    let mises: Vec<_> = bodies.von_mises.iter().copied().map(Some).collect();
    let seen = vertices
        .iter()
        .map(|vertex| bodies.von_mises[vertex.node as usize]);
    let top = top(&seen.collect::<Vec<_>>());
    let mut fields = vec![field("von Mises stress", &stress, top, &mises)];
    let has_contact = !bodies.elastic.contact.places.is_empty();
    if has_contact && D == 3 {
        let top = top_pressure(&bodies.contact.pressure);
        fields.push(field("contact pressure", &stress, top, &pressures(bodies)));
    }
    let shown = match has_contact && D == 2 {
        true => shown_at_nodes(bodies.elastic, bodies.contact, None),
        false => Default::default(),
    };
    let states = states(bodies.contact)
        .into_iter()
        .filter(|_| !shown.is_empty());
    let dots = states.map(|(status, name, _, fill)| {
        let is_shown = |node: &u32| {
            (shown.get(node)).is_some_and(|&place| state(bodies.contact, place).0 == status)
        };
        let here = (0_u32..).zip(vertices).filter(|(_, vertex)| is_shown(&vertex.node));
        json!({"name": name, "colour": fill, "vertices": packed(here.map(|(k, _)| k.to_le_bytes()))})
    });
    let lengths: Vec<_> = displacement.iter().map(|&u| Some(length(u))).collect();
    let top = bodies.travel.max(f64::MIN_POSITIVE);
    fields.push(field("displacement", &units.length, top, &lengths));
    let components = || {
        vertices
            .iter()
            .flat_map(|vertex| in_space(displacement[vertex.node as usize]))
    };
    let travel = components().map(f64::abs).fold(0.0, f64::max);
    let scaled = components().map(|v| scaled(v, travel, 32767.0) as i16);
    json!({
        "name": bodies.step.to_string(),
        // 32767 is the largest component of all.
        "displacements": packed(scaled.map(i16::to_le_bytes)),
        "travel": travel,
        "magnified": bodies.magnified,
        "fields": fields,
        "dots": dots.collect::<Vec<_>>(),
    })
}

/// A JSON object with one more text.
fn with(object: &str, key: &str, value: &str) -> String {
    format!("{},\"{key}\":\"{value}\"}}", &object[..object.len() - 1])
}

/// Adds the view to the page, with as many of the last steps as there is room for; `used` are the bytes of the page
/// without it. Returns whether there was any room.
pub(super) fn put_view<'v>(out: &mut String, views: &[&'v View], used: usize) -> bool {
    let Some(last) = views.last() else {
        return false;
    };
    let fixed = used + SCRIPT.len() + last.rest.len() + last.obstacles.len();
    let mut left = LARGEST_PAGE.checked_sub(fixed);
    let has_room = |step: &Cow<str>| {
        left = left.and_then(|left| left.checked_sub(step.len() + 1));
        left.is_some()
    };
    let step = |&view: &&'v View| match view.obstacles == last.obstacles {
        true => Cow::Borrowed(view.step.as_str()),
        false => Cow::Owned(with(&view.step, "obstacles", &view.obstacles)),
    };
    let mut steps: Vec<Cow<str>> = (views.iter().rev())
        .map(step)
        .take_while(has_room)
        .collect();
    steps.reverse();
    let (shown, all) = (steps.len(), views.len());
    let note = match shown {
        0 => "The bodies are too large for a view with values under the pointer; ParaView opens the solution."
            .to_owned(),
        _ if shown < all => format!("The view has room for the last {shown} of {all} load steps."),
        _ => String::new(),
    };
    if shown > 0 {
        out.push_str("<div id=\"bodies\" hidden></div>\n<noscript><p class=\"note\">With JavaScript enabled, this \
                      section shows a view with values under the pointer.</p></noscript>\n");
    }
    if !note.is_empty() {
        *out += &format!("<p class=\"note\">{note}</p>\n");
    }
    if shown > 0 {
        let rest = with(&last.rest, "obstacles", &last.obstacles);
        let (rest, steps) = (rest.trim_end_matches('}'), steps.join(","));
        *out += &format!(
            "<script type=\"application/json\" id=\"bodies-data\">{rest},\"steps\":[{steps}]}}</script>\n"
        );
    }
    shown > 0
}

/// The script, for the end of the page.
pub(super) fn put_script(out: &mut String) {
    *out += &format!("<script>\n{SCRIPT}</script>\n");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_takes_the_last_steps_that_it_has_room_for() {
        let view = |step: usize| View {
            rest: "{\"size\":1}".to_owned(),
            obstacles: ["A", "B"][step / 3].to_owned(),
            step: format!("{{\"name\":\"{step}{}\"}}", "a".repeat(3 << 20)),
        };
        let views = [1, 2, 3].map(view);
        let views: Vec<&View> = views.iter().collect();
        let mut page = String::new();
        assert!(put_view(&mut page, &views, 1000));
        assert!(page.contains("the last 2 of 3 load steps") && page.len() < LARGEST_PAGE);
        assert!(page.contains("{\"size\":1,\"obstacles\":\"B\",\"steps\":[{\"name\":\"2a"));
        // Only obstacles that were elsewhere are repeated.
        assert!(
            page.contains("a\",\"obstacles\":\"A\"},{\"name\":\"3a") && page.contains("a\"}]}")
        );
        page.clear();
        assert!(!put_view(&mut page, &views, 6 << 20));
        assert!(page.contains("too large") && !page.contains("<script"));
        assert!(!put_view(&mut page, &[], 0));
    }

    #[test]
    fn texts_cannot_end_the_script() {
        assert!(text(&json!({"name": "</script>"})).contains("\\u003c/script>"));
        assert!(!SCRIPT.contains("http") && !SCRIPT.contains("</script"));
    }

    #[test]
    fn numbers_are_parts_of_the_largest() {
        assert_eq!(scaled(1.0, 2.0, 65535.0), 32768.0);
        assert_eq!(scaled(-3.0, 2.0, 32767.0), -32767.0);
        assert_eq!(scaled(1.0, 0.0, 10.0), 0.0);
        assert_eq!(
            packed([1_u16, 258].into_iter().map(u16::to_le_bytes)),
            "AQACAQ=="
        );
    }
}
