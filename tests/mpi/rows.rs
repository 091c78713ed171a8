//! Programs that already run under MPI, and pass the rows of their ranks.

use super::run::mpirun;
use signorini::engine::EngineOptions;
use signorini::mpi::{OwnMatrices, Share, World};
use signorini::solve::Event;
use signorini::ssnm::Status;
use std::ops::ControlFlow;
use std::process::Command;

/// Marks this executable as one of several ranks, with its role.
pub const ROLE: &str = "SIGNORINI_MPI_ROLE";

/// This executable in a role.
pub fn command(role: &str) -> &'static mut Command {
    let mut command = Command::new(std::env::current_exe().expect("this executable"));
    command.env(ROLE, role);
    Box::leak(Box::new(command))
}

/// The role of a rank.
pub fn rank(role: &str) {
    let world = World::start().unwrap_or_else(|error| panic!("{error}"));
    match role {
        "panic" => {
            if world.group().rank() == 1 {
                panic!("on purpose");
            }
            // For ever, unless something ends it.
            world.group().wait();
        }
        _ => chain(&world),
    }
}

/// The unknowns of each of three ranks.
const OWN: [usize; 3] = [4, 0, 4];
/// All of them.
const ALL: usize = 8;

/// A chain of springs between two walls, pushed by 0.1 everywhere, whose third and sixth links may move by 0.1 until they
/// touch: each rank prints its part of u, and rank 0 the forces.
fn chain(world: &World) {
    let group = world.group();
    let first: usize = OWN[..group.rank()].iter().sum();
    let own = OWN[group.rank()];
    let mut matrices = OwnMatrices::<2> {
        starts: vec![0],
        load: vec![0.1; own],
        gap: vec![0.1; 2],
        slip_bound: vec![0.0; 2],
        ..OwnMatrices::default()
    };
    for row in first..first + own {
        for (column, value) in [(row.wrapping_sub(1), -1.0), (row, 2.0), (row + 1, -1.0)] {
            if column < ALL {
                matrices.columns.push(column as u64);
                matrices.values.push(value);
            }
        }
        matrices.starts.push(matrices.columns.len());
        if let Some(place) = [2, 5].iter().position(|&link| link == row) {
            matrices.normal.push((place, row - first, 1.0));
        }
    }
    let mut share = Share::of_rows(group, matrices, &EngineOptions::default())
        .unwrap_or_else(|error| panic!("{error}"));
    let mut found = None;
    let watch = |event: Event<2>| {
        if let Event::Ends(solved) = event {
            found = Some(solved.solution);
        }
        ControlFlow::Continue(())
    };
    share
        .solve(&Default::default(), None, watch)
        .unwrap_or_else(|error| panic!("{error}"));
    let found = found.expect("there is a step");
    assert_eq!(found.status, Status::Converged);
    for (i, u) in found.u.iter().enumerate() {
        println!("u {} {u:e}", first + i);
    }
    if group.rank() == 0 {
        found
            .lambda
            .iter()
            .enumerate()
            .for_each(|(i, l)| println!("lambda {i} {l:e}"));
    }
}

/// Its solution by hand: links 2 and 5 are at 0.1, the outer parts hang between 0 and 0.1 and the part between them bulges, each by
/// the parabola of an even load.
pub fn own_rows() {
    let run = mpirun(3, command("rows"));
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    assert_eq!(
        run.status.code(),
        Some(0),
        "{said}{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let found = |name: &str, i: usize| -> f64 {
        let head = format!("{name} {i} ");
        let line = said.lines().find_map(|line| line.strip_prefix(&head));
        line.unwrap_or_else(|| panic!("no {name} {i} in {said}"))
            .parse()
            .expect("a number")
    };
    // −u(i−1) + 2u(i) − u(i+1) = 0.1 between 0 at −1 and 0.1 at 2, and between 0.1 at 2 and 0.1 at 5.
    let outer = |i: f64| 0.1 * i / 3.0 + 0.05 * i * (3.0 - i);
    let expected = [
        outer(1.0),
        outer(2.0),
        0.1,
        0.2,
        0.2,
        0.1,
        outer(2.0),
        outer(1.0),
    ];
    for (i, expected) in expected.into_iter().enumerate() {
        let u = found("u", i);
        assert!(
            (u - expected).abs() < 1e-6,
            "u {i} is {u} instead of {expected}"
        );
    }
    // The push on each link beyond the forces of its springs.
    let force = 0.1 - (2.0 * 0.1 - outer(2.0) - 0.2);
    for i in 0..2 {
        assert!((found("lambda", i) - force).abs() < 1e-6, "{said}");
    }
}
