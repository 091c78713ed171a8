//! Sliding places are reported as slipping, in the plane, around an axis and in space.

use crate::common::models::on_the_cpu;
use crate::common::or_panic::OrPanic as _;
use crate::common::solved::case;
use signorini::case::CaseProblem;
use signorini::contact::Space;
use signorini::engine::Stiffness;
use signorini::mesh::ElementKind;
use signorini::model::AnyBuilt;
use signorini::model::Built;
use signorini::output::{ContactFields, NodeStatus};
use signorini::ssnm::Status;

const KINDS: [&str; 3] = ["plane", "axisymmetric", "space"];

/// A plug with a taper of 1 in 8, pushed into its sleeve and released in part, with so many cells along each; in space one slice of
/// it.
fn plug(kind: &str, [plug, sleeve]: [usize; 2], mu: f64, force: f64) -> String {
    let (shape, width, axis) = match kind {
        "space" => ("box", "0.3, ", "z"),
        _ => ("rectangle", "", "y"),
    };
    let (analysis, cells, middle, slice) = match kind {
        "axisymmetric" => ("[analysis]\nplane = \"axisymmetric\"\n", "", "", ""),
        "plane" => ("", "", "", ""),
        _ => (
            "",
            "1, ",
            "\"y\", ",
            "[[support]]\nboundary = [\"p-front\", \"p-back\", \"s-front\", \"s-back\"]\ny = 0\n",
        ),
    };
    let part = |name: &str, height: f64, cells_along: usize, x: &str, up: &str| {
        format!(
            "[[mesh.part]]\nname = \"{name}\"\n{shape} = {{ size = [1, {width}{height}], \
             cells = [1, {cells}{cells_along}], map = [\"{}\", {middle}\"{axis}{up}\"] }}\n",
            x.replace('h', axis)
        )
    };
    format!(
        "{analysis}{}{}{slice}[steps]\nfactors = [1, 0.9]\n[[material]]\nyoung = 2e5\npoisson = 0.3\n\
         [[support]]\nboundary = \"s-bottom\"\nx = 0\n{axis} = 0\n\
         [[support]]\nboundary = \"p-left\"\nx = 0\n\
         [[traction]]\nboundary = \"p-top\"\n{axis} = -{force}\n\
         [[contact]]\nboundary = \"p-right\"\nagainst = \"s-left\"\nfriction = {{ coulomb = {mu} }}\nadjust = 1e-6\n",
        part("p", 4.4, plug, "x*(1.5 + h/8)", ""),
        part("s", 3.6, sleeve, "(1.55 + h/8) + x*(1.65 - h/8)", " + 0.4"),
    )
}

/// The numbers of slipping and sticking places, where each state agrees with its slip: more than the tolerance leaves,
/// or less than a thousandth of that.
fn told<const D: usize>(built: &Built<D>, tolerance: f64) -> [usize; 2]
where
    ElementKind: Space<D>,
{
    let steps = built
        .solve(&on_the_cpu(tolerance, Stiffness::Cholesky))
        .or_panic();
    let (m, mut counts) = (built.problem.m(), [0; 2]);
    for (number, solution) in steps.iter().enumerate() {
        assert_eq!(solution.status, Status::Converged);
        let data = built.step(number).or_panic();
        let fields = ContactFields::new(&built.problem, &built.elastic, &data, solution);
        let largest = solution.u.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        let before = counts[0];
        for i in (0..m).filter(|&i| solution.lambda[i] > 0.0) {
            let along = (D - 1) * i..(D - 1) * (i + 1);
            let size = |v: &[f64]| v.iter().fold(0.0, |sum: f64, v| sum.hypot(*v));
            let slip = size(&solution.slip[along.clone()]);
            let part = size(&solution.lambda[m..][along]) / solution.slip_bound[i];
            let status = fields.status[i];
            if slip > 100.0 * tolerance * largest {
                assert_eq!(
                    status,
                    NodeStatus::Slip,
                    "slip {slip:e}, force {part:e} of its bound"
                );
                counts[0] += 1;
            } else if slip < 0.01 * tolerance * largest && part < 0.999 {
                assert_eq!(
                    status,
                    NodeStatus::Stick,
                    "slip {slip:e}, force {part:e} of its bound"
                );
                counts[1] += 1;
            }
        }
        let sizes = solution.sets.sizes(|i| built.problem.has_friction(i));
        assert!(sizes.slip.total() >= counts[0] - before);
    }
    counts
}

/// A plug slides while it is pushed in; when the load falls, one with much friction sticks.
#[test]
fn plugs_that_slide_slip() {
    for kind in KINDS {
        let mut stuck = 0;
        for cells in [[2, 3], [4, 3], [7, 5], [12, 9]] {
            for (mu, force) in [(0.1, 300.0), (0.15, 600.0), (0.25, 40.0), (1.5, 600.0)] {
                for tolerance in [1e-8, 1e-5] {
                    let made = case(&plug(kind, cells, mu, force)).build().or_panic();
                    let CaseProblem::Elastic(made) = made else {
                        panic!("it has bodies");
                    };
                    let [slip, stick] = match *made {
                        AnyBuilt::Plane(built) => told(&built, tolerance),
                        AnyBuilt::Space(built) => told(&built, tolerance),
                    };
                    println!(
                        "{kind} {cells:?} μ = {mu}, ε = {tolerance:e}: {slip} slip, {stick} stick"
                    );
                    assert!(slip > 0 || mu > 1.0, "{kind} {cells:?} {mu}");
                    stuck += stick;
                }
            }
        }
        assert!(stuck > 0, "{kind}");
    }
}
