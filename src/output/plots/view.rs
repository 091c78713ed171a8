//! The view of solids in `report.html` that can be turned: what `view.js` needs of them, as text.

use super::camera::Camera;
use super::legend;
use super::obstacles::Patch;
use super::raster::VIRIDIS;
use super::solid::Solids;
use crate::mesh::vector::bounds;
use crate::output::{put, shown_at_nodes};
use base64::Engine as _;
use serde::Serialize;

/// The page does not get larger than this by the view, in bytes.
const LARGEST_PAGE: usize = 8 << 20;
const SCRIPT: &str = include_str!("view.js");
/// The look of the view and of what is beside it.
pub(super) const STYLE: &str = "
.controls { display: flex; flex-wrap: wrap; gap: .4rem 1.2rem; align-items: center; margin: .6rem 0; font-size: 14px } .controls input { vertical-align: middle } .controls .number { display: inline-block; min-width: 3.2em }
.stage { position: relative; height: 540px; border: 1px solid #ddd } .stage canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; cursor: grab } .stage canvas.axes { pointer-events: none }
.legend { position: absolute; top: 14px; right: 16px; min-width: 5.5em; font-size: 13px; pointer-events: none } .legend .strip { position: relative; width: 16px; height: 260px; margin: .7em 0; border: 1px solid #222 } .legend .strip span { position: absolute; left: 24px; white-space: nowrap; line-height: 1.2 } .legend .part i { display: inline-block; width: 1em; height: 1em; margin-right: .5em; vertical-align: -.1em }
";

/// What the view shows of a step.
#[derive(Clone, Debug)]
pub struct View {
    /// The surface at rest: the same for all steps.
    surface: String,
    /// What has happened to it.
    step: String,
    /// What the whole needs beside.
    rest: String,
}

/// The surface of the bodies at rest. Arrays are numbers from the lowest byte on in base64.
#[derive(Serialize)]
struct SurfaceData {
    vertices: usize,
    /// The extent of the surface; places count from its lowest corner.
    size: [f64; 3],
    /// Of the vertices: 65535 is the whole extent.
    places: String,
    /// 127 is 1.
    normals: String,
    /// Four vertices each; a triangle names the last twice.
    facets: String,
    /// The sharp edges: two vertices each.
    edges: String,
    parts: Vec<Part>,
    /// Triangles: nine numbers each, of 32 bits.
    obstacles: String,
}

/// A region with its facets and edges, from one number to another.
#[derive(Serialize)]
struct Part {
    name: String,
    facets: [usize; 2],
    edges: [usize; 2],
}

#[derive(Serialize)]
struct Step {
    name: String,
    /// 32767 is the largest component of all.
    displacements: String,
    travel: f64,
    magnified: f64,
    fields: Vec<Field>,
}

#[derive(Serialize)]
struct Field {
    name: &'static str,
    top: f64,
    largest: f64,
    /// 65535 is the value with the last of the colours.
    values: String,
    /// 1 where there is a value, else 0; None: everywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    known: Option<String>,
}

#[derive(Serialize)]
struct Rest<'a> {
    length: &'a str,
    stress: String,
    colours: Vec<[u8; 3]>,
    /// From where the bodies are looked at first.
    back: [f64; 3],
}

/// Bytes as text.
fn packed(bytes: impl IntoIterator<Item = u8>) -> String {
    let bytes: Vec<u8> = bytes.into_iter().collect();
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

/// JSON that no text in it can end early.
fn json(value: &impl Serialize) -> String {
    let text = serde_json::to_string(value).expect("numbers and texts are always JSON");
    text.replace('<', "\\u003c")
}

impl View {
    /// That of a step.
    pub(super) fn new(solids: &Solids, step: usize) -> Self {
        let elastic = solids.elastic;
        let back = Camera::pair(&elastic.mesh, &solids.surface, &solids.von_mises)[0].back;
        Self {
            surface: json(&surface(solids)),
            step: json(&fields(solids, step)),
            rest: json(&Rest {
                length: &elastic.units.length,
                stress: elastic.units.stress(),
                colours: VIRIDIS.map(|colour| colour.map(|v| v as u8)).to_vec(),
                back,
            }),
        }
    }
}

/// The surface at rest.
fn surface(solids: &Solids) -> SurfaceData {
    let (mesh, surface) = (&solids.elastic.mesh, &solids.surface);
    let place = |node: u32| mesh.nodes[node as usize];
    let (low, high) = bounds(surface.vertices.iter().map(|vertex| place(vertex.node)));
    let size = [0, 1, 2].map(|c| high[c] - low[c]);
    let places = surface.vertices.iter().flat_map(|vertex| {
        let x = place(vertex.node);
        [0, 1, 2].map(|c| scaled(x[c] - low[c], size[c], 65535.0) as u16)
    });
    let normals = surface.vertices.iter().flat_map(|vertex| vertex.normal);
    let facets = surface.facets.iter().flat_map(|facet| facet.vertices);
    // Sharp edges with the part and the vertices of their first facet.
    let mut sharp: Vec<(u32, [u32; 2])> = (surface.edges.iter())
        .filter(|edge| edge.sharp)
        .map(|edge| {
            let facet = &surface.facets[edge.facets[0] as usize];
            let ends = edge.ends.map(|node| {
                let corner = facet.nodes.iter().position(|&n| n == node);
                facet.vertices[corner.unwrap_or(0)]
            });
            (facet.region, ends)
        })
        .collect();
    sharp.sort_by_key(|&(region, _)| region);
    let parts = (0..).zip(&mesh.regions).map(|(region, name)| Part {
        name: name.clone(),
        facets: [region, region + 1].map(|r| surface.facets.partition_point(|f| f.region < r)),
        edges: [region, region + 1].map(|r| sharp.partition_point(|e| e.0 < r)),
    });
    let obstacles = (solids.obstacles.iter().flat_map(Patch::triangles).flatten())
        .flat_map(|x| [0, 1, 2].map(|c| (x[c] - low[c]) as f32));
    SurfaceData {
        vertices: surface.vertices.len(),
        size,
        places: packed(places.flat_map(u16::to_le_bytes)),
        normals: packed(normals.map(|v| (127.0 * v).round() as i8 as u8)),
        facets: packed(facets.flat_map(u32::to_le_bytes)),
        edges: packed(
            sharp
                .iter()
                .flat_map(|edge| edge.1)
                .flat_map(u32::to_le_bytes),
        ),
        parts: parts
            .filter(|part| part.facets[0] < part.facets[1])
            .collect(),
        obstacles: packed(obstacles.flat_map(f32::to_le_bytes)),
    }
}

/// A number as a part of the largest, rounded.
fn scaled(value: f64, largest: f64, steps: f64) -> f64 {
    if largest > 0.0 {
        (steps * (value / largest).clamp(-1.0, 1.0)).round()
    } else {
        0.0
    }
}

/// The contact pressure at each node of the mesh, and whether it has one: those of contact places, and what they meet, with
/// the mean of what presses on them.
fn pressures(solids: &Solids) -> (Vec<f64>, Vec<bool>) {
    let count = solids.elastic.mesh.nodes.len();
    let (mut pressure, mut known) = (vec![0.0_f64; count], vec![false; count]);
    let (mut sums, mut weights) = (vec![0.0; count], vec![0.0; count]);
    for (node, i) in shown_at_nodes(solids.elastic, solids.contact, None) {
        pressure[node as usize] = solids.contact.pressure[i];
        known[node as usize] = true;
    }
    for (place, &value) in (solids.elastic.contact.places.iter()).zip(&solids.contact.pressure) {
        for &(partner, weight) in place.partners.iter().filter(|(_, weight)| *weight > 0.0) {
            sums[partner as usize] += weight * value;
            weights[partner as usize] += weight;
        }
    }
    for node in 0..count {
        if !known[node] && weights[node] > 0.0 {
            pressure[node] = sums[node] / weights[node];
            known[node] = true;
        }
    }
    (pressure, known)
}

/// Displacements, stresses and pressures of a step.
fn fields(solids: &Solids, step: usize) -> Step {
    let vertices = &solids.surface.vertices;
    let displacement = |node: u32| solids.fields.displacement[node as usize];
    let components = || vertices.iter().flat_map(|vertex| displacement(vertex.node));
    let travel = components().map(f64::abs).fold(0.0, f64::max);
    let field = |name, values: &[f64], top: f64, largest: f64, known: Option<&[bool]>| Field {
        name,
        top,
        largest,
        values: packed(
            (vertices.iter())
                .map(|vertex| scaled(values[vertex.node as usize].max(0.0), top, 65535.0) as u16)
                .flat_map(u16::to_le_bytes),
        ),
        known: known.map(|known| {
            packed((vertices.iter()).map(|vertex| u8::from(known[vertex.node as usize])))
        }),
    };
    let mises = field(
        "von Mises stress",
        &solids.von_mises,
        solids.top,
        solids.largest,
        None,
    );
    let mut all = vec![mises];
    if !solids.elastic.contact.places.is_empty() {
        let (pressure, known) = pressures(solids);
        let top = legend::top_pressure(&solids.contact.pressure);
        let largest = pressure.iter().copied().fold(0.0, f64::max);
        all.push(field(
            "contact pressure",
            &pressure,
            top,
            largest,
            Some(&known),
        ));
    }
    let components = components().map(|v| scaled(v, travel, 32767.0) as i16);
    Step {
        name: step.to_string(),
        displacements: packed(components.flat_map(i16::to_le_bytes)),
        travel,
        magnified: solids.magnified,
        fields: all,
    }
}

/// Adds the view to the page, with as many of the last steps as there is room for; `used` are the bytes of the page
/// without it. Whether there was any.
pub(super) fn put_view(out: &mut String, views: &[&View], used: usize) -> bool {
    let Some(last) = views.last() else {
        return false;
    };
    let room = LARGEST_PAGE.saturating_sub(used + SCRIPT.len() + last.rest.len());
    let mut left = room.checked_sub(last.surface.len());
    let mut steps: Vec<&str> = Vec::new();
    for view in views.iter().rev() {
        left = left.and_then(|left| left.checked_sub(view.step.len() + 1));
        if left.is_none() {
            break;
        }
        steps.push(&view.step);
    }
    if steps.is_empty() {
        put(
            out,
            format_args!(
                "<p class=\"note\">The surface is too large for a view that can be turned; ParaView opens the solution.</p>"
            ),
        );
        return false;
    }
    steps.reverse();
    put(
        out,
        format_args!(
            "<div id=\"solid\" hidden></div>\n<noscript><p class=\"note\">With JavaScript there is a view here that can be turned.</p></noscript>"
        ),
    );
    if steps.len() < views.len() {
        put(
            out,
            format_args!(
                "<p class=\"note\">The view has room for the last {} of {} load steps.</p>",
                steps.len(),
                views.len()
            ),
        );
    }
    let rest = last.rest.trim_end_matches('}');
    put(
        out,
        format_args!(
            "<script type=\"application/json\" id=\"solid-data\">{rest},\"surface\":{},\"steps\":[{}]}}</script>",
            last.surface,
            steps.join(",")
        ),
    );
    true
}

/// The script, for the end of the page.
pub(super) fn put_script(out: &mut String) {
    put(out, format_args!("<script>\n{SCRIPT}</script>"));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(step: usize, size: usize) -> View {
        View {
            surface: "{}".to_owned(),
            step: format!("\"{step}{}\"", "a".repeat(size)),
            rest: "{\"length\":\"mm\"}".to_owned(),
        }
    }

    #[test]
    fn a_page_takes_the_last_steps_that_it_has_room_for() {
        let views: Vec<View> = (1..4).map(|step| view(step, 3 << 20)).collect();
        let views: Vec<&View> = views.iter().collect();
        let mut page = String::new();
        assert!(put_view(&mut page, &views, 1000));
        assert!(page.contains("the last 2 of 3 load steps") && page.len() < LARGEST_PAGE);
        assert!(
            page.contains("\"steps\":[\"2a") && page.contains("\"length\":\"mm\",\"surface\":{}")
        );
        page.clear();
        assert!(!put_view(&mut page, &views, 6 << 20));
        assert!(page.contains("too large") && !page.contains("<script"));
        assert!(!put_view(&mut page, &[], 0));
    }

    #[test]
    fn texts_cannot_end_the_script() {
        let part = Part {
            name: "</script>".to_owned(),
            facets: [0, 1],
            edges: [0, 0],
        };
        assert!(json(&part).contains("\\u003c/script>"));
        assert!(!SCRIPT.contains("http") && !SCRIPT.contains("</script"));
    }

    #[test]
    fn numbers_are_parts_of_the_largest() {
        assert_eq!(scaled(1.0, 2.0, 65535.0), 32768.0);
        assert_eq!(scaled(-3.0, 2.0, 32767.0), -32767.0);
        assert_eq!(scaled(1.0, 0.0, 10.0), 0.0);
        assert_eq!(
            packed([1_u16, 258].into_iter().flat_map(u16::to_le_bytes)),
            "AQACAQ=="
        );
    }
}
