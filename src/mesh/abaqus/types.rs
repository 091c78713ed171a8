//! Types of elements, and the faces that surfaces name.

use crate::mesh::ElementKind;
use crate::mesh::file::raw::Cell;

/// Supported types to use instead of an unknown one.
pub(super) const KNOWN: &str = "CPE3, CPE4, CPE6, CPE8 (or CPS, CAX) in the plane, C3D4, C3D5, C3D6, C3D8, C3D10, C3D15 or \
                                C3D20 in space";

/// The cells of the types of bodies, without their variants.
const BODIES: [(&str, ElementKind); 21] = [
    ("C3D4", ElementKind::Tetrahedron),
    ("C3D5", ElementKind::Pyramid),
    ("C3D6", ElementKind::Wedge),
    ("C3D8", ElementKind::Hexahedron),
    ("C3D10", ElementKind::Tetrahedron10),
    ("C3D15", ElementKind::Wedge15),
    ("C3D20", ElementKind::Hexahedron20),
    ("C3D27", ElementKind::Hexahedron27),
    ("CPS3", ElementKind::Triangle),
    ("CPE3", ElementKind::Triangle),
    ("CPS4", ElementKind::Quad),
    ("CPE4", ElementKind::Quad),
    ("CPS6", ElementKind::Triangle6),
    ("CPE6", ElementKind::Triangle6),
    ("CPS8", ElementKind::Quad8),
    ("CPE8", ElementKind::Quad8),
    ("CPE9", ElementKind::Quad9),
    ("CAX3", ElementKind::Triangle),
    ("CAX4", ElementKind::Quad),
    ("CAX6", ElementKind::Triangle6),
    ("CAX8", ElementKind::Quad8),
];

/// Reduced integration, hybrid, modified and incompatible modes, temperatures: a matter of the element, not of its nodes.
const VARIANTS: [&str; 17] = [
    "", "R", "I", "H", "M", "RH", "IH", "MH", "T", "RT", "HT", "MT", "RHT", "MHT", "S", "HS", "E",
];

/// The cells of shells, membranes, rigid faces, beams and trusses, which bound bodies, and of point elements at a node.
const BOUNDS: [(&[&str], &[&str], Cell); 8] = [
    (
        &["S3", "R3D3", "M3D3", "SFM3D3", "STRI3"],
        &["", "R", "S"],
        Cell::Element(ElementKind::Triangle),
    ),
    (
        &["S4", "R3D4", "M3D4", "SFM3D4"],
        &["", "R", "R5", "S"],
        Cell::Element(ElementKind::Quad),
    ),
    (
        &["S6", "STRI65", "M3D6", "SFM3D6"],
        &["", "R"],
        Cell::Element(ElementKind::Triangle6),
    ),
    (
        &["S8", "M3D8", "SFM3D8"],
        &["", "R", "R5"],
        Cell::Element(ElementKind::Quad8),
    ),
    (
        &["S9", "M3D9", "SFM3D9"],
        &["", "R", "R5"],
        Cell::Element(ElementKind::Quad9),
    ),
    (
        &["T2D2", "T3D2", "B21", "B31", "R2D2", "SFM2D2"],
        &["", "H"],
        Cell::Line,
    ),
    (
        &["T2D3", "T3D3", "B22", "B32"],
        &["", "H", "R"],
        Cell::Line3,
    ),
    (&["MASS", "ROTARYI"], &[""], Cell::Point),
];

/// The cells of springs, whose stiffness a deck states, and of nodes that lead others.
const LINKS: [(&str, Cell); 5] = [
    ("DCOUP2D", Cell::Point),
    ("DCOUP3D", Cell::Point),
    ("SPRINGA", Cell::Link),
    ("SPRING1", Cell::Point),
    ("SPRING2", Cell::Link),
];

/// The cell of a type of element, of a `deck` or of a mesh alone; if it is not supported, the reason and the remedy.
pub(super) fn cell(name: &str, deck: bool) -> Result<Cell, String> {
    let name = name.to_uppercase();
    let mut links = LINKS.iter().filter(|_| deck);
    if let Some(&(_, cell)) = links.find(|known| known.0 == name) {
        return Ok(cell);
    }
    let is = |begin: &str, rest: &[&str]| {
        (name.strip_prefix(begin)).is_some_and(|end| rest.contains(&end))
    };
    if let Some(&(_, kind)) = BODIES.iter().find(|known| is(known.0, &VARIANTS)) {
        return Ok(Cell::Element(kind));
    }
    let bounds = |known: &&(&[&str], &[&str], Cell)| known.0.iter().any(|begin| is(begin, known.1));
    if let Some(&(.., cell)) = BOUNDS.iter().find(bounds) {
        return Ok(cell);
    }
    Err(if name.starts_with("CGAX") {
        format!(
            "{name} is an axisymmetric element with twist: here a body of revolution moves only in planes through its \
             axis (CAX3, CAX4 …)"
        )
    } else {
        format!("elements of type {name} are not supported: use {KNOWN}")
    })
}

/// The plain type of an element of a body, and the variant in its name.
fn variant(name: &str) -> Option<(&'static str, ElementKind, String)> {
    let name = name.to_uppercase();
    let mut known = BODIES.iter();
    known.find_map(|&(plain, kind)| {
        let rest = name
            .strip_prefix(plain)
            .filter(|rest| VARIANTS.contains(rest))?;
        Some((plain, kind, rest.to_owned()))
    })
}

/// Whether a type has incompatible modes.
pub(super) fn has_modes(name: &str) -> bool {
    variant(name)
        .is_some_and(|(_, kind, variant)| variant.starts_with('I') && kind.may_have_modes())
}

/// The type that an element is read as, if that differs from its name. A `deck` keeps elements with incompatible modes.
/// (Other purposes of variants have other remedies here: elements for nearly incompressible bodies, and those of second
/// order.)
pub(super) fn note(name: &str, deck: bool) -> Option<String> {
    let (plain, kind, variant) = variant(name)?;
    let name = name.to_uppercase();
    let with_modes = match deck {
        true => format!("{plain}I, with incompatible modes, avoids that"),
        false => "incompatible_modes = true in its material avoids that".to_owned(),
    };
    if has_modes(&name) {
        return (!deck).then(|| {
            format!("{name} is read as {plain}, without incompatible modes, and is stiffer in bending: {with_modes}")
        });
    }
    if !variant.contains(['R', 'M']) {
        return None;
    }
    let taken = format!("{name} is read as {plain}, with full integration");
    Some(match kind.may_have_modes() {
        true => format!("{taken}, and is stiffer in bending: {with_modes}"),
        false => taken,
    })
}

/// The order of the nodes of a kind in the file, if it differs from the order here. The middle of a hexahedron precedes
/// those of its faces, in the order of [`face`], and the middle of a line is between its ends.
pub(super) fn order(cell: Cell) -> Option<&'static [usize]> {
    const HEXAHEDRON: [usize; 27] = [
        0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 26, 24, 23, 25, 21,
        22, 20,
    ];
    match cell {
        Cell::Element(ElementKind::Hexahedron27) => Some(&HEXAHEDRON),
        Cell::Line3 => Some(&[0, 2, 1]),
        _ => None,
    }
}

/// The corners of face `number`, from 1, as surfaces count them.
pub(super) fn face(cell: Cell, number: usize) -> Option<&'static [usize]> {
    let Cell::Element(kind) = cell else {
        return None;
    };
    let faces: &[&[usize]] = match kind.linear() {
        ElementKind::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
        ElementKind::Quad => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
        ElementKind::Tetrahedron => &[&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]],
        ElementKind::Wedge => &[
            &[0, 1, 2],
            &[3, 5, 4],
            &[0, 3, 4, 1],
            &[1, 4, 5, 2],
            &[2, 5, 3, 0],
        ],
        ElementKind::Hexahedron => &[
            &[0, 1, 2, 3],
            &[4, 7, 6, 5],
            &[0, 4, 5, 1],
            &[1, 5, 6, 2],
            &[2, 6, 7, 3],
            &[3, 7, 4, 0],
        ],
        ElementKind::Pyramid => &[
            &[0, 1, 2, 3],
            &[0, 4, 1],
            &[1, 4, 2],
            &[2, 4, 3],
            &[3, 4, 0],
        ],
        _ => unreachable!("kinds of first order"),
    };
    faces.get(number.checked_sub(1)?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_are_the_same_cells() {
        for (name, expected) in [
            ("C3D8R", ElementKind::Hexahedron),
            ("c3d8i", ElementKind::Hexahedron),
            ("C3D4H", ElementKind::Tetrahedron),
            ("C3D5", ElementKind::Pyramid),
            ("CPE4RH", ElementKind::Quad),
            ("CPS3", ElementKind::Triangle),
            ("S4R", ElementKind::Quad),
            ("C3D10", ElementKind::Tetrahedron10),
            ("C3D10M", ElementKind::Tetrahedron10),
            ("C3D10T", ElementKind::Tetrahedron10),
            ("C3D10HS", ElementKind::Tetrahedron10),
            ("C3D15H", ElementKind::Wedge15),
            ("C3D20", ElementKind::Hexahedron20),
            ("C3D20RH", ElementKind::Hexahedron20),
            ("C3D20RT", ElementKind::Hexahedron20),
            ("CPE8R", ElementKind::Quad8),
            ("CAX4RH", ElementKind::Quad),
            ("CAX6M", ElementKind::Triangle6),
            ("CPS6M", ElementKind::Triangle6),
            ("S8R5", ElementKind::Quad8),
            ("STRI65", ElementKind::Triangle6),
        ] {
            assert_eq!(cell(name, true), Ok(Cell::Element(expected)), "{name}");
        }
        assert_eq!(cell("T3D2", true), Ok(Cell::Line));
        assert_eq!(cell("springa", true), Ok(Cell::Link));
        let taken = Some("C3D20RH is read as C3D20, with full integration".to_owned());
        assert_eq!(note("c3d20rh", true), taken);
        for deck in [true, false] {
            let none = ["C3D20", "C3D10H", "C3D8", "S8R", "CPS4", "S4R"];
            assert!(none.iter().all(|name| note(name, deck).is_none()));
            let reduced = note("c3d8r", deck).expect("it is another one");
            let way = if deck {
                "C3D8I, with"
            } else {
                "incompatible_modes = true"
            };
            assert!(
                reduced.contains("read as C3D8") && reduced.contains(way),
                "{reduced}"
            );
            assert_eq!(note("CPE4I", deck).is_some(), !deck);
        }
        assert!(
            ["C3D8I", "cpe4i", "CAX4I", "CPS4IH"]
                .iter()
                .all(|name| has_modes(name))
        );
        assert!(
            ["C3D8", "C3D8R", "C3D10I", "CPS3", "S4"]
                .iter()
                .all(|name| !has_modes(name))
        );
        assert_eq!(cell("B32R", true), Ok(Cell::Line3));
        for (name, expected) in [
            ("CGAX4R", "axisymmetric element with twist"),
            ("C3D15V", "are not supported: use CPE3"),
            ("SPRINGA", "are not supported: use CPE3"),
        ] {
            assert!(
                cell(name, false).is_err_and(|text| text.contains(expected)),
                "{name}"
            );
        }
    }

    /// Every face of a surface is a face of the element.
    #[test]
    fn faces_are_those_of_the_elements() {
        for kind in ElementKind::ALL {
            let sorted = |face: &[usize]| {
                let mut face = face.to_vec();
                face.sort_unstable();
                face
            };
            let facets = kind.linear().facets();
            let mut known: Vec<Vec<usize>> = facets.iter().map(|f| sorted(f)).collect();
            let mut found: Vec<Vec<usize>> = (1..)
                .map_while(|number| face(Cell::Element(kind), number))
                .map(sorted)
                .collect();
            known.sort();
            found.sort();
            assert_eq!(found, known, "{kind:?}");
        }
    }

    /// The nodes of a C3D27: 21 in the middle, 22 to 27 in that of faces 1 to 6.
    #[test]
    fn middles_of_faces_follow_the_order_of_faces() {
        let cell = Cell::Element(ElementKind::Hexahedron27);
        let order = order(cell).expect("another order");
        let middles = ElementKind::Hexahedron27.middles();
        for number in 1..=6 {
            let place = order.iter().position(|&at| at == 20 + number).expect("all");
            let mut of = middles[place - 8].to_vec();
            let mut corners = face(cell, number).expect("a face").to_vec();
            of.sort_unstable();
            corners.sort_unstable();
            assert_eq!(of, corners, "face {number}");
        }
        assert_eq!(order[26], 20);
    }
}
