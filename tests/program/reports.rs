//! The reported forces of contacts and supports, against values by hand: forces, moments about their centres, and the work
//! that friction dissipates. All follow from statics, because the material is so stiff that nothing else moves.

use crate::close::close;
use crate::run::{numbers, solved};
use serde_json::Value;

/// Of forces, in parts of the largest: a hundred tolerances of the solver.
const EXACT: f64 = 1e-4;
const MU: f64 = 0.2;
/// How far the block is driven.
const WAY: f64 = 0.01;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// A block 2 long, 1 high and 0.5 thick on a floor, under 1000 (1 + 0.3 x) Pa, whose top is driven to the right, and back by
/// twice as much. Its weight N = 0.5 (2000 + 600) = 1300 N presses with −100 N m about its middle x = 1, because 0.5 · 300 ∫
/// x (x − 1) dx = 100; friction and the driving force are a couple μ N · 1 m.
#[test]
fn a_block_pushed_to_and_fro() {
    let (n, friction) = (1300.0, MU * 1300.0);
    let law = format!("{{ coulomb = {MU} }}");
    // Tresca's friction is g times the area.
    for (law, friction) in [(&*law, friction), ("{ tresca = 150 }", 150.0 * 2.0 * 0.5)] {
        let report = solved(&format!(
            "[analysis]\nthickness = 0.5\n[mesh.rectangle]\nsize = [2, 1]\ncells = [8, 4]\n\
             [[material]]\nyoung = 1e11\npoisson = 0.3\n\
             [[support]]\nboundary = \"top\"\nx = {WAY}\nfactors = [0, 1, -1]\n\
             [[traction]]\nboundary = \"top\"\npressure = \"1000 * (1 + 0.3 * x)\"\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {law}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n\
             [steps]\nfactors = [1, 1, 1]\n"
        ));
        for (step, way, sign) in [(1, WAY, 1.0), (2, 2.0 * WAY, -1.0)] {
            let step = &report["steps"][step];
            let (contact, support) = (&step["contacts"][0], &step["supports"][0]);
            let rubbed = -sign * friction;
            close(&numbers(&contact["centre"]), &[1.0, 0.0], 1e-9);
            close(&numbers(&contact["force"]), &[rubbed, n], EXACT * n);
            close(&[number(&contact["normal_force"])], &[n], EXACT * n);
            let along = number(&contact["tangential_force"]).abs();
            close(&[along], &[friction], EXACT * n);
            let moment = [100.0 + sign * friction];
            close(&numbers(&contact["moment"]), &moment, EXACT * n);
            let work = number(&contact["slipping_work"]);
            close(&[work], &[friction * way], EXACT * friction * way);
            // It has no arm: all its forces are in one line.
            close(&numbers(&support["centre"]), &[1.0, 1.0], 1e-9);
            close(&numbers(&support["force"]), &[-rubbed, 0.0], EXACT * n);
            close(&numbers(&support["moment"]), &[0.0], EXACT * n);
        }
        // Only pressed: friction and, 1 above, the support hold the spreading of the block.
        let contact = &report["steps"][0]["contacts"][0];
        let rubbed = numbers(&contact["force"])[0];
        close(&numbers(&contact["moment"]), &[100.0 - rubbed], EXACT * n);
        let work = number(&contact["slipping_work"]);
        close(&[work], &[0.0], EXACT * friction * WAY);
    }
}

/// A beam 3 long and 0.25 thick, clamped at the left end, whose middle is at half its height, under 40 Pa down at the other
/// end and 8 Pa to the right on its top.
#[test]
fn a_clamped_beam() {
    let report = solved(
        "[analysis]\nthickness = 0.25\n[mesh.rectangle]\nsize = [3, 1]\ncells = [12, 4]\n\
         [[material]]\nyoung = 1e9\npoisson = 0.3\n[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n\
         [[traction]]\nboundary = \"right\"\ny = -40\n[[traction]]\nboundary = \"top\"\nx = 8\n",
    );
    let support = &report["steps"][0]["supports"][0];
    close(&numbers(&support["centre"]), &[0.0, 0.5], 1e-9);
    close(&numbers(&support["force"]), &[-6.0, 10.0], 1e-6);
    // 3 · 10 of the end, 0.5 · 6 of the top.
    close(&numbers(&support["moment"]), &[30.0 + 3.0], 1e-5);
}

/// A bar 2 long, 1 high and 0.5 thick that is pressed by σ on a wall of stiffness k: all energies by hand.
#[test]
fn energy_and_work() {
    let (sigma, young, k) = (3.0, 1e3, 2e3);
    let report = solved(&format!(
        "[analysis]\nthickness = 0.5\n[mesh.rectangle]\nsize = [2, 1]\ncells = [4, 2]\n\
         [[material]]\nyoung = {young}\npoisson = 0\n[[support]]\nboundary = \"bottom\"\ny = 0\n\
         [[traction]]\nboundary = \"right\"\npressure = {sigma}\n\
         [[contact]]\nboundary = \"left\"\nstiffness = {{ normal = {k} }}\n\
         obstacle = {{ half_plane = {{ point = [0, 0], normal = [1, 0] }} }}\n[steps]\nfactors = [1, 3]\n"
    ));
    let (bar, wall) = (0.5 * sigma * sigma / young, 0.25 * sigma * sigma / k);
    for (step, stored, done) in [(0, 1.0, 1.0), (1, 9.0, 8.0)] {
        let energy = &report["steps"][step]["energy"];
        let known = [stored * bar, done * (bar + wall), 0.0, -done * wall];
        let told = ["strain", "loads", "supports", "contacts"].map(|name| number(&energy[name]));
        close(&told, &known, 1e-6 * known[0]);
    }
}

/// A block 2 × 1 × 1 on a floor, under 1000 (1 + 0.3 x) Pa, driven along (0.6, 0.8) and back by twice as much: N = 2600 N
/// presses with −200 N m about y. The friction of each place is μ times its pressure, so that it acts where the pressure has
/// its resultant, and turns the block by −160 μ N m about z as it goes, however the pressure is distributed.
#[test]
fn a_block_pushed_across() {
    let (n, friction) = (2600.0, MU * 2600.0);
    let report = solved(&format!(
        "[mesh.box]\nsize = [2, 1, 1]\ncells = [6, 3, 3]\n[[material]]\nyoung = 1e11\npoisson = 0.3\n\
         [[support]]\nboundary = \"top\"\nx = {}\ny = {}\nfactors = [0, 1, -1]\n\
         [[traction]]\nboundary = \"top\"\npressure = \"1000 * (1 + 0.3 * x)\"\n\
         [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = {MU} }}\n\
         obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
         [steps]\nfactors = [1, 1, 1]\n",
        0.6 * WAY,
        0.8 * WAY
    ));
    for (step, way, sign) in [(1, WAY, 1.0), (2, 2.0 * WAY, -1.0)] {
        let step = &report["steps"][step];
        let (contact, support) = (&step["contacts"][0], &step["supports"][0]);
        let [fx, fy] = [-0.6 * sign * friction, -0.8 * sign * friction];
        close(&numbers(&contact["centre"]), &[1.0, 0.5, 0.0], 1e-9);
        close(&numbers(&contact["force"]), &[fx, fy, n], EXACT * n);
        let along = number(&contact["tangential_force"]);
        close(&[along], &[friction], EXACT * n);
        let turn = -160.0 * MU * sign;
        let moment = [-fy, fx - 200.0, turn];
        close(&numbers(&contact["moment"]), &moment, EXACT * n);
        let work = number(&contact["slipping_work"]);
        close(&[work], &[friction * way], EXACT * friction * way);
        close(&numbers(&support["centre"]), &[1.0, 0.5, 1.0], 1e-9);
        close(&numbers(&support["force"]), &[-fx, -fy, 0.0], EXACT * n);
        let moment = [0.0, 0.0, -turn];
        close(&numbers(&support["moment"]), &moment, EXACT * n);
    }
}
