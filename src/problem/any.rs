//! Contact problems whose dimension is known at run time.

use super::ContactProblem;

/// A [`ContactProblem`] of either dimension, for those who learn it at run time.
#[derive(Clone, Debug)]
pub enum AnyProblem {
    /// Of the plane.
    Plane(ContactProblem),
    /// Of space.
    Space(ContactProblem<3>),
}

impl From<ContactProblem> for AnyProblem {
    fn from(problem: ContactProblem) -> Self {
        Self::Plane(problem)
    }
}

impl From<ContactProblem<3>> for AnyProblem {
    fn from(problem: ContactProblem<3>) -> Self {
        Self::Space(problem)
    }
}

/// The dimension of a problem with m contact nodes, whose T has this many rows and whose points this many coordinates,
/// if there are any. T has a row for each node in the plane and two in space. Without contact nodes the points decide.
///
/// # Errors
/// If T and the points disagree; the text gives the correct sizes.
pub fn dimension(m: usize, rows_of_t: usize, coordinates: Option<usize>) -> Result<usize, String> {
    let is_solid = if m > 0 {
        rows_of_t == 2 * m
    } else {
        coordinates == Some(3)
    };
    match (is_solid, coordinates) {
        (false, Some(3)) if rows_of_t == m => Err(format!(
            "the coordinates have three columns, so this is a problem in space, but T has {m} rows like N: in space T \
             needs two for each contact node, {} in all",
            2 * m
        )),
        (true, Some(2)) => Err(format!(
            "T has two rows for each of the {m} contact nodes, so this is a problem in space, but the coordinates \
             have two columns: in space they need three"
        )),
        (true, _) => Ok(3),
        (false, _) => Ok(2),
    }
}
