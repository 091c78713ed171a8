//! `check` on a mesh with elements in several groups and curves between them.

use crate::run::{directory, signorini_in, text, write};

#[test]
fn check_lists_groups_and_inner_boundaries() {
    let place = directory();
    let mesh = std::path::absolute("tests/meshes/squares.msh").unwrap_or_default();
    write(
        &place.path().join("case.toml"),
        &format!(
            "[mesh]\nfile = '{}'\n[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n\
             [[material]]\nregion = \"all\"\nyoung = 1e6\npoisson = 0.3\ndensity = 1\n",
            mesh.display()
        ),
    );
    let said = text(&signorini_in(place.path(), &["check", "case.toml"]).stdout);
    for line in [
        "region        \"steel & all\": area 1.0000e0 m²",
        "group         \"all\": \"steel & all\", \"rubber & all\"",
        "boundary      \"middle\": 1 edges, 1.0000e0 m; unusable for contact and traction: its edge from",
        "boundary      \"bottom\": 2 edges, 2.0000e0 m\n",
        "boundary      \"line\": 0 edges, 0.0000e0 m; unusable: its edge from",
    ] {
        assert!(said.contains(line), "{line}\n{said}");
    }
}
