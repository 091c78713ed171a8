//! Types of elements, and the faces that surfaces name.

use crate::mesh::file::raw::Cell;

/// What to write instead of a type that is not known.
pub(super) const KNOWN: &str = "CPE3, CPE4, CPS3 or CPS4 in the plane, C3D4, C3D6 or C3D8 in space";

/// The cell of a type of element; if there is none here, why not and what to do.
pub(super) fn cell(name: &str) -> Result<Cell, String> {
    let name = name.to_uppercase();
    let is = |begins: &[&str], rest: &[&str]| {
        (begins.iter()).any(|begin| {
            name.strip_prefix(begin)
                .is_some_and(|end| rest.contains(&end))
        })
    };
    // Reduced integration, hybrid and incompatible modes are a matter of the element, not of its nodes.
    const VARIANTS: [&str; 9] = ["", "R", "I", "H", "RH", "IH", "HT", "T", "S"];
    Ok(if is(&["C3D4"], &VARIANTS) {
        Cell::Tetrahedron
    } else if is(&["C3D6"], &VARIANTS) {
        Cell::Wedge
    } else if is(&["C3D8"], &VARIANTS) {
        Cell::Hexahedron
    } else if is(&["CPS3", "CPE3"], &VARIANTS)
        || is(&["S3", "R3D3", "M3D3", "SFM3D3", "STRI3"], &["", "R", "S"])
    {
        Cell::Triangle
    } else if is(&["CPS4", "CPE4"], &VARIANTS)
        || is(&["S4", "R3D4", "M3D4", "SFM3D4"], &["", "R", "R5", "S"])
    {
        Cell::Quad
    } else if is(
        &["T2D2", "T3D2", "B21", "B31", "R2D2", "SFM2D2"],
        &["", "H"],
    ) {
        Cell::Line
    } else if is(&["MASS", "ROTARYI"], &[""]) {
        Cell::Point
    } else if is(
        &["C3D10", "C3D15", "C3D20", "C3D27"],
        &["", "R", "H", "RH", "M", "MH", "I", "HS"],
    ) || is(
        &["CPS6", "CPE6", "CPS8", "CPE8", "CAX6", "CAX8"],
        &["", "R", "H", "RH", "M", "MH"],
    ) || is(&["S8", "STRI65", "S6"], &["", "R", "R5"])
    {
        return Err(format!(
            "{name} is an element of higher order, which is not supported: choose linear elements in the mesher (in \
             Abaqus/CAE: Mesh, Element Type, Geometric Order Linear; in Gmsh Mesh.ElementOrder = 1)"
        ));
    } else if name.starts_with("CAX") || name.starts_with("CGAX") {
        return Err(format!(
            "{name} is an axisymmetric element: a body of revolution is a sector of a solid here (C3D4, C3D6, C3D8) \
             between planes of symmetry"
        ));
    } else if name.starts_with("C3D5") {
        return Err(
            "C3D5 is a pyramid, which is not supported: use tetrahedra alone, or hexahedra and wedges"
                .to_owned(),
        );
    } else {
        return Err(format!(
            "elements of type {name} are not supported: use {KNOWN}"
        ));
    })
}

/// The corners of face `number`, from 1, as surfaces count them.
pub(super) fn face(cell: Cell, number: usize) -> Option<&'static [usize]> {
    let faces: &[&[usize]] = match cell {
        Cell::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
        Cell::Quad => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
        Cell::Tetrahedron => &[&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]],
        Cell::Wedge => &[
            &[0, 1, 2],
            &[3, 5, 4],
            &[0, 3, 4, 1],
            &[1, 4, 5, 2],
            &[2, 5, 3, 0],
        ],
        Cell::Hexahedron => &[
            &[0, 1, 2, 3],
            &[4, 7, 6, 5],
            &[0, 4, 5, 1],
            &[1, 5, 6, 2],
            &[2, 6, 7, 3],
            &[3, 7, 4, 0],
        ],
        Cell::Point | Cell::Line => &[],
    };
    faces.get(number.checked_sub(1)?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;

    #[test]
    fn variants_are_the_same_cells() {
        for (name, expected) in [
            ("C3D8R", Cell::Hexahedron),
            ("c3d8i", Cell::Hexahedron),
            ("C3D4H", Cell::Tetrahedron),
            ("CPE4RH", Cell::Quad),
            ("CPS3", Cell::Triangle),
            ("S4R", Cell::Quad),
            ("T3D2", Cell::Line),
        ] {
            assert_eq!(cell(name), Ok(expected), "{name}");
        }
        for (name, expected) in [
            ("C3D10M", "higher order"),
            ("CPE8R", "higher order"),
            ("CAX4R", "axisymmetric"),
            ("C3D5", "pyramid"),
            ("SPRINGA", "are not supported: use CPE3"),
        ] {
            assert!(
                cell(name).is_err_and(|text| text.contains(expected)),
                "{name}"
            );
        }
    }

    /// Every face of a surface is one of the element.
    #[test]
    fn faces_are_those_of_the_elements() {
        for (cell, kind) in [
            (Cell::Triangle, ElementKind::Triangle),
            (Cell::Quad, ElementKind::Quad),
            (Cell::Tetrahedron, ElementKind::Tetrahedron),
            (Cell::Hexahedron, ElementKind::Hexahedron),
            (Cell::Wedge, ElementKind::Wedge),
        ] {
            let sorted = |face: &[usize]| {
                let mut face = face.to_vec();
                face.sort_unstable();
                face
            };
            let mut known: Vec<Vec<usize>> = kind.facets().iter().map(|f| sorted(f)).collect();
            let mut found: Vec<Vec<usize>> = (1..)
                .map_while(|number| face(cell, number))
                .map(sorted)
                .collect();
            known.sort();
            found.sort();
            assert_eq!(found, known, "{cell:?}");
        }
    }
}
