//! Case files of published problems in the plane.

/// The GRECO plate (SSNV128) with this many elements a side.
pub fn greco(cells: usize) -> String {
    format!(
        "[mesh]\nrectangle = {{ size = [0.04, 0.04], cells = [{cells}, {cells}] }}\n\
         [[material]]\nyoung = 1.3e11\npoisson = 0.2\n\
         [[support]]\nboundary = \"right\"\nx = 0\n[[support]]\npoint = [0.04, 0]\ny = 0\n\
         [[traction]]\nboundary = \"left\"\npressure = 15e7\n[[traction]]\nboundary = \"top\"\npressure = 5e7\n\
         [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = 1 }}\n\
         obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n"
    )
}

/// A quarter of a disc of radius r about (0, r) as a mapped rectangle, fine at (0, 0): sides `bottom` (the arc
/// from the bottom to 45°), `right` (the rest), `left` (the axis) and `top` (the horizontal diameter).
fn quarter_disc(r: f64, cells: usize, grade: f64) -> String {
    let u = format!("({grade}*x + {}*x^3)", 1.0 - grade);
    let v = format!("(1 - ({grade}*y + {}*y^3))", 1.0 - grade);
    format!(
        "rectangle = {{ size = [1, 1], cells = [{cells}, {cells}], \
         map = [\"{r}*{u}*sqrt(1 - {v}^2/2)\", \"{r} - {r}*{v}*sqrt(1 - {u}^2/2)\"] }}"
    )
}

/// A w × w block below y = 0, fine at (0, 0).
fn block(w: f64, cells: usize, grade: f64) -> String {
    let s = |x: &str| format!("{w}*({grade}*{x} + {}*{x}^3)", 1.0 - grade);
    format!(
        "rectangle = {{ size = [1, 1], cells = [{cells}, {cells}], map = [\"{}\", \"-{}\"] }}",
        s("x"),
        s("(1 - y)")
    )
}

/// A cylinder under the force P (2 · 1/2) on a block, both elastic.
pub fn hertz(
    r: f64,
    cells: usize,
    grade: f64,
    [cylinder, plate]: [f64; 2],
    force: f64,
    sides: &str,
) -> String {
    let half = 0.5 * force;
    format!(
        "[[mesh.part]]\nname = \"disc\"\n{}\n[[mesh.part]]\nname = \"plate\"\n{}\n\
         [[material]]\nregion = \"disc\"\nyoung = {cylinder}\npoisson = 0.3\n\
         [[material]]\nregion = \"plate\"\nyoung = {plate}\npoisson = 0.3\n\
         [[support]]\nboundary = \"disc-left\"\nx = 0\n[[support]]\nboundary = \"plate-left\"\nx = 0\n\
         [[support]]\nboundary = \"plate-bottom\"\ny = 0\n[[traction]]\nboundary = \"disc-top\"\npressure = {}\n\
         [[contact]]\n{sides}\n",
        quarter_disc(r, cells, grade),
        block(4.0 * r, 4 * cells / 5, grade / 4.0),
        half / r
    )
}

/// Two equal cylinders pressed together, then pushed sideways (Cattaneo 1938, Mindlin 1949): the lower half of the
/// upper one is lowered by δ and pulled by q along its diameter.
pub fn cattaneo(delta: f64, friction: &str, cells: usize) -> String {
    let half = |sign: &str| {
        let u = "(0.2*x + 0.8*x^5)";
        let v = "(1 - (0.2*y + 0.8*y^5))";
        format!(
            "rectangle = {{ origin = [-1, 0], size = [2, 1], cells = [{}, {cells}], \
             map = [\"8*{u}*sqrt(1 - {v}^2/2)\", \"{sign}(8 - 8*{v}*sqrt(1 - {u}^2/2))\"] }}",
            2 * cells
        )
    };
    format!(
        "[[mesh.part]]\nname = \"up\"\n{}\n[[mesh.part]]\nname = \"low\"\n{}\n\
         [[material]]\nyoung = 200\npoisson = 0.3\n\
         [[support]]\nboundary = \"low-top\"\ny = 0\n[[support]]\npoint = [0, -8]\nx = 0\n\
         [[traction]]\nboundary = \"low-top\"\nx = -0.05851\nfactors = [0, 1]\n\
         [[support]]\nboundary = \"up-top\"\ny = -{delta}\n\
         [[traction]]\nboundary = \"up-top\"\nx = 0.05851\nfactors = [0, 1]\n\
         [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-bottom\"\nfriction = {friction}\n\
         [steps]\nfactors = [1, 1]\n",
        half(""),
        half("0-")
    )
}
