//! A drawing and the files that Gmsh and others make of it.

/// Numbers as text, or as bytes of either order.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Coding {
    Ascii,
    Little,
    Big,
}

pub const CODINGS: [Coding; 3] = [Coding::Ascii, Coding::Little, Coding::Big];

pub struct Out {
    pub coding: Coding,
    pub bytes: Vec<u8>,
}

impl Out {
    pub fn new(version: &str, coding: Coding) -> Self {
        let mut out = Self {
            coding,
            bytes: Vec::new(),
        };
        let binary = u8::from(coding != Coding::Ascii);
        out.text(&format!("$MeshFormat\n{version} {binary} 8\n"));
        if binary == 1 {
            out.int(1);
            out.end();
        }
        out.text("$EndMeshFormat\n");
        out
    }

    pub fn text(&mut self, text: &str) {
        self.bytes.extend(text.bytes());
    }

    pub fn number<const N: usize>(&mut self, text: String, little: [u8; N]) {
        match self.coding {
            Coding::Ascii => self.text(&(text + " ")),
            Coding::Little => self.bytes.extend(little),
            Coding::Big => self.bytes.extend(little.iter().rev()),
        }
    }

    pub fn int(&mut self, value: i64) {
        self.number(value.to_string(), (value as i32).to_le_bytes());
    }

    pub fn size(&mut self, value: u64) {
        self.number(value.to_string(), value.to_le_bytes());
    }

    pub fn float(&mut self, value: f64) {
        self.number(value.to_string(), value.to_le_bytes());
    }

    pub fn end(&mut self) {
        self.text("\n");
    }
}

/// A curve or surface with its physical groups and its elements.
#[derive(Clone)]
pub struct Entity {
    pub dim: i64,
    pub groups: Vec<i64>,
    pub elements: Vec<Vec<i64>>,
}

pub fn curve(groups: &[i64], edges: &[[i64; 2]]) -> Entity {
    Entity {
        dim: 1,
        groups: groups.to_vec(),
        elements: edges.iter().map(|edge| edge.to_vec()).collect(),
    }
}

pub fn surface(groups: &[i64], elements: &[&[i64]]) -> Entity {
    Entity {
        dim: 2,
        groups: groups.to_vec(),
        elements: elements.iter().map(|nodes| nodes.to_vec()).collect(),
    }
}

/// A drawing: nodes 1, 2, … and entities, as Gmsh keeps them.
#[derive(Clone)]
pub struct Drawing {
    pub names: Vec<(i64, i64, &'static str)>,
    pub nodes: Vec<[f64; 2]>,
    pub entities: Vec<Entity>,
}

/// Two unit squares side by side, the left one of triangles; nodes 1 to 6 around, and a separate line.
///
/// Surfaces: steel, rubber, and "all" of both. Curves: "bottom" turned around, "middle" between the squares, "every" of
/// these, and "line", which is not an edge.
pub fn squares() -> Drawing {
    Drawing {
        names: vec![
            (1, 11, "bottom"),
            (1, 12, "left"),
            (1, 13, "top"),
            (1, 14, "middle"),
            (1, 15, "every"),
            (1, 16, "line"),
            (2, 1, "steel"),
            (2, 2, "rubber"),
            (2, 3, "all"),
        ],
        nodes: vec![
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [5.0, 5.0],
            [6.0, 5.0],
        ],
        entities: vec![
            curve(&[-11, 15], &[[1, 2], [2, 3]]),
            curve(&[12, 15], &[[6, 1]]),
            curve(&[13, -15], &[[4, 5], [5, 6]]),
            curve(&[14, 15], &[[2, 5]]),
            curve(&[16], &[[7, 8]]),
            surface(&[1, 3], &[&[1, 2, 5], &[1, 5, 6]]),
            surface(&[-2, 3], &[&[2, 3, 4, 5]]),
        ],
    }
}

impl Drawing {
    pub fn names(&self, out: &mut Out) {
        let mut text = format!("$PhysicalNames\n{}\n", self.names.len());
        for (dim, tag, name) in &self.names {
            text += &format!("{dim} {tag} \"{name}\"\n");
        }
        out.text(&(text + "$EndPhysicalNames\n"));
    }

    /// As Gmsh writes it: an element is listed once for each of its groups. It writes no signs, but reverses elements;
    /// other programs write the signs.
    pub fn msh2(&self, version: &str, coding: Coding, signs: bool, parametric: bool) -> Vec<u8> {
        let mut out = Out::new(version, coding);
        self.names(&mut out);
        let section = if parametric {
            "ParametricNodes"
        } else {
            "Nodes"
        };
        out.text(&format!("${section}\n{}\n", self.nodes.len()));
        for (number, x) in (1..).zip(&self.nodes) {
            out.int(number);
            out.float(x[0]);
            out.float(x[1]);
            out.float(0.0);
            if parametric {
                // On points, curves, surfaces and in volumes by turns.
                let dim = number % 4;
                out.int(dim);
                out.int(7);
                for parameter in 0..[0, 1, 2, 0][dim as usize] {
                    out.float(0.25 + f64::from(parameter));
                }
            }
            if coding == Coding::Ascii {
                out.end();
            }
        }
        let mut rows = Vec::new();
        for (entity, e) in (1..).zip(&self.entities) {
            for nodes in &e.elements {
                let none = [0];
                for &group in if e.groups.is_empty() {
                    &none[..]
                } else {
                    &e.groups
                } {
                    let mut nodes = nodes.clone();
                    if group < 0 {
                        nodes.reverse();
                    }
                    rows.push((entity, if signs { group } else { group.abs() }, nodes));
                }
            }
        }
        out.text(&format!("\n$End{section}\n$Elements\n{}\n", rows.len()));
        for (number, (entity, group, nodes)) in (1..).zip(rows) {
            let kind = nodes.len() as i64 - 1;
            let mut row = vec![number, kind, 2];
            if coding != Coding::Ascii {
                row = vec![kind, 1, 2, number];
            }
            row.extend([group, entity]);
            row.extend(nodes);
            row.iter().for_each(|&value| out.int(value));
            if coding == Coding::Ascii {
                out.end();
            }
        }
        out.text("\n$EndElements\n");
        out.bytes
    }

    pub fn msh4(&self, coding: Coding) -> Vec<u8> {
        let mut out = Out::new("4.1", coding);
        self.names(&mut out);
        out.text("$Entities\n");
        for dim in 0..4 {
            out.size(self.entities.iter().filter(|e| e.dim == dim).count() as u64);
        }
        for (tag, e) in (1..).zip(&self.entities) {
            out.int(tag);
            (0..6).for_each(|_| out.float(0.0));
            out.size(e.groups.len() as u64);
            e.groups.iter().for_each(|&group| out.int(group));
            out.size(0);
        }
        out.text("\n$EndEntities\n$Nodes\n");
        let n = self.nodes.len() as u64;
        [1, n, 1, n].iter().for_each(|&v| out.size(v));
        [2, 1, 0].iter().for_each(|&v| out.int(v));
        out.size(n);
        (1..=n).for_each(|tag| out.size(tag));
        for x in &self.nodes {
            [x[0], x[1], 0.0].iter().for_each(|&v| out.float(v));
        }
        out.text("\n$EndNodes\n$Elements\n");
        [self.entities.len() as u64, 1, 1, 1]
            .iter()
            .for_each(|&v| out.size(v));
        for (tag, e) in (1..).zip(&self.entities) {
            let kind = e.elements[0].len() as i64 - 1;
            [e.dim, tag, kind].iter().for_each(|&v| out.int(v));
            out.size(e.elements.len() as u64);
            for nodes in &e.elements {
                out.size(1);
                nodes.iter().for_each(|&node| out.size(node as u64));
            }
        }
        out.text("\n$EndElements\n");
        out.bytes
    }

    /// The file in every format there is.
    pub fn files(&self) -> Vec<(String, Vec<u8>)> {
        let mut files = Vec::new();
        for coding in CODINGS {
            files.push((format!("4.1 {coding:?}"), self.msh4(coding)));
            for version in ["2", "2.0", "2.1", "2.2"] {
                for (signs, parametric) in [(false, false), (true, false), (false, true)] {
                    files.push((
                        format!("{version} {coding:?}, signs {signs}, parametric {parametric}"),
                        self.msh2(version, coding, signs, parametric),
                    ));
                }
            }
        }
        files
    }
}
