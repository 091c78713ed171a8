//! Files that are large enough for several threads.

use super::*;

const CELLS: usize = 16;

fn solid() -> Mesh<3> {
    let shape = SolidShape::Tetrahedron;
    block([0.0; 3], [1.0, 0.7, 0.3], [CELLS; 3], shape, "body", "")
}

/// The words of each entry, a line for each.
fn lines<T: std::fmt::Display>(entries: impl Iterator<Item = Vec<T>>, separator: &str) -> String {
    let words = |entry: Vec<T>| entry.iter().map(T::to_string).collect::<Vec<_>>();
    entries
        .map(|entry| words(entry).join(separator) + "\n")
        .collect()
}

/// A number of the file and the nodes of an element there.
fn listed(mesh: &Mesh<3>) -> impl Iterator<Item = Vec<u32>> {
    let tags = |element: &Element<3>| element.nodes().iter().map(|node| node + 1).collect();
    (1..).zip(&mesh.elements).map(move |(number, element)| {
        let nodes: Vec<u32> = tags(element);
        [vec![number], nodes].concat()
    })
}

fn msh4(mesh: &Mesh<3>) -> String {
    let (nodes, elements) = (mesh.nodes.len(), mesh.elements.len());
    let numbers = lines((1..=nodes).map(|number| vec![number]), " ");
    let places = lines(mesh.nodes.iter().map(|x| x.to_vec()), " ");
    let all = lines(listed(mesh), " ");
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {nodes} 1 {nodes}\n3 1 0 {nodes}\n{numbers}{places}$EndNodes\n\
         $Elements\n1 {elements} 1 {elements}\n3 1 4 {elements}\n{all}$EndElements\n"
    )
}

fn msh4_binary(mesh: &Mesh<3>) -> Vec<u8> {
    let mut file = b"$MeshFormat\n4.1 1 8\n".to_vec();
    let ints = |file: &mut Vec<u8>, all: &[i32]| {
        all.iter().for_each(|v| file.extend(v.to_le_bytes()));
    };
    let sizes = |file: &mut Vec<u8>, all: &[usize]| {
        all.iter()
            .for_each(|&v| file.extend((v as u64).to_le_bytes()));
    };
    ints(&mut file, &[1]);
    file.extend(b"\n$EndMeshFormat\n$Nodes\n");
    let n = mesh.nodes.len();
    sizes(&mut file, &[1, n, 1, n]);
    ints(&mut file, &[3, 1, 0]);
    sizes(&mut file, &[n]);
    (1..=n).for_each(|number| sizes(&mut file, &[number]));
    for x in mesh.nodes.iter().flatten() {
        file.extend(x.to_le_bytes());
    }
    file.extend(b"\n$EndNodes\n$Elements\n");
    let n = mesh.elements.len();
    sizes(&mut file, &[1, n, 1, n]);
    ints(&mut file, &[3, 1, 4]);
    sizes(&mut file, &[n]);
    listed(mesh)
        .flatten()
        .for_each(|tag| sizes(&mut file, &[tag as usize]));
    file.extend(b"\n$EndElements\n");
    file
}

fn inp(mesh: &Mesh<3>) -> String {
    let nodes = (1..).zip(&mesh.nodes).map(|(number, x)| {
        let number: u32 = number;
        vec![f64::from(number), x[0], x[1], x[2]]
    });
    let (nodes, elements) = (lines(nodes, ", "), lines(listed(mesh), ", "));
    format!("*NODE\n{nodes}*ELEMENT, TYPE=C3D4, ELSET=body\n{elements}*NSET, NSET=ends\n1, 2\n")
}

/// The arrays of a grid by `array(name, type, words, bytes)`.
#[cfg(feature = "files")]
fn vtu(mesh: &Mesh<3>, array: impl Fn(&str, &str, String, Vec<u8>) -> String) -> Vec<u8> {
    let n = mesh.elements.len();
    let floats: Vec<f64> = mesh.nodes.iter().flatten().copied().collect();
    let floats = array(
        "Points",
        "Float64",
        lines(floats.chunks(3).map(<[f64]>::to_vec), " "),
        floats.iter().flat_map(|x| x.to_le_bytes()).collect(),
    );
    let integers = |name: &str, all: Vec<i64>| {
        let words = lines(all.chunks(4).map(<[i64]>::to_vec), " ");
        array(
            name,
            "Int64",
            words,
            all.iter().flat_map(|x| x.to_le_bytes()).collect(),
        )
    };
    let nodes = mesh
        .elements
        .iter()
        .flat_map(|element| element.nodes().to_vec());
    let nodes = integers("connectivity", nodes.map(i64::from).collect());
    let ends = integers("offsets", (1..=n as i64).map(|end| 4 * end).collect());
    let types = integers("types", vec![10; n]);
    format!(
        "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\">\n\
         <UnstructuredGrid><Piece>\n<Points>{floats}</Points>\n<Cells>{nodes}{ends}{types}</Cells>\n</Piece>\
         </UnstructuredGrid></VTKFile>\n"
    )
    .into_bytes()
}

/// In base64, with a line end after every 76 letters, and compressed by blocks.
#[cfg(feature = "files")]
fn packed(name: &str, kind: &str, bytes: &[u8]) -> String {
    use base64::Engine as _;
    use std::io::Write as _;
    const BLOCK: usize = 10_000;
    let blocks: Vec<Vec<u8>> = (bytes.chunks(BLOCK))
        .map(|block| {
            let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), Default::default());
            packed
                .write_all(block)
                .and_then(|()| packed.finish())
                .expect("into memory")
        })
        .collect();
    let sizes = [blocks.len(), BLOCK, bytes.len() % BLOCK].into_iter();
    let header = sizes.chain(blocks.iter().map(Vec::len));
    let header: Vec<u8> = header
        .flat_map(|size| (size as u32).to_le_bytes())
        .collect();
    let encode = |bytes: &[u8]| base64::engine::general_purpose::STANDARD.encode(bytes);
    let all = encode(&header) + &encode(&blocks.concat());
    let all: Vec<&[u8]> = all.as_bytes().chunks(76).collect();
    let all = String::from_utf8(all.join(&b'\n')).expect("letters");
    format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"binary\">\n{all}\n</DataArray>\n")
}

/// A file of each format with its ending.
fn files(mesh: &Mesh<3>) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("2.msh", msh(&AnyMesh::Space(mesh.clone())).into_bytes()),
        ("4.msh", msh4(mesh).into_bytes()),
        ("4-binary.msh", msh4_binary(mesh)),
        (".inp", inp(mesh).into_bytes()),
        #[cfg(feature = "files")]
        (
            "-ascii.vtu",
            vtu(mesh, |name, kind, words, _| {
                format!("<DataArray type=\"{kind}\" Name=\"{name}\">\n{words}</DataArray>\n")
            }),
        ),
        #[cfg(feature = "files")]
        (
            "-packed.vtu",
            vtu(mesh, |name, kind, _, bytes| packed(name, kind, &bytes)),
        ),
    ]
}

/// The mesh of a file, or its error, by each number of threads.
fn read_by_threads(name: &str, file: &[u8]) -> Vec<Result<Mesh<3>, String>> {
    let place = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let path = place.path().join(format!("mesh{name}"));
    std::fs::write(&path, file).unwrap_or_else(|error| panic!("{error}"));
    let of_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.unwrap_or_else(|error| panic!("{error}"));
        match pool.install(|| read(&path, 1.0, None)) {
            Ok(AnyMesh::Space(mesh)) => Ok(mesh),
            Ok(AnyMesh::Plane(_)) => panic!("{name}: plane"),
            Err(error) => Err(error
                .to_string()
                .replace(&path.display().to_string(), "mesh")),
        }
    };
    [1, 2, 3, 7].map(of_threads).into()
}

#[test]
fn meshes_do_not_depend_on_the_number_of_threads() {
    let mesh = solid();
    let nodes = |mesh: &Mesh<3>| -> Vec<Vec<u32>> {
        mesh.elements
            .iter()
            .map(|element| element.nodes().to_vec())
            .collect()
    };
    for (name, file) in files(&mesh) {
        let found = read_by_threads(name, &file);
        let found: Vec<Mesh<3>> = found.into_iter().map(Result::unwrap).collect();
        for one in &found {
            assert!(
                one.nodes == mesh.nodes && nodes(one) == nodes(&mesh),
                "{name}"
            );
            assert!(one.boundaries == found[0].boundaries, "{name}");
        }
    }
}

/// Errors far behind the beginning are located, and the first one counts.
#[test]
fn errors_do_not_depend_on_the_number_of_threads() {
    let mesh = solid();
    let element = |number: usize| listed(&mesh).nth(number - 1).expect("it exists");
    let [second, third] = [mesh.elements.len() / 2, 3 * mesh.elements.len() / 4];
    let missing = "an element names node 999999, which does not exist";
    for (name, separator, wrong) in [
        ("2.msh", " ", "\"x\" is not an integer"),
        ("4.msh", " ", "\"x\" is not a non-negative integer"),
        (
            ".inp",
            ", ",
            "\"x\" is not the number of a node or an element",
        ),
    ] {
        let file = files(&mesh).into_iter().find(|file| file.0 == name);
        let text = String::from_utf8(file.expect("it is there").1).expect("a text");
        // The first node of an element replaced, and the line of that.
        let damaged = |text: &str, number: usize, word: &str| {
            let words: Vec<String> = element(number)[1..].iter().map(u32::to_string).collect();
            let behind = format!("{separator}{}\n", words.join(separator));
            let at = separator.len() + text.rfind(&behind).expect("it is listed");
            let mut damaged = text.to_owned();
            damaged.replace_range(at..at + words[0].len(), word);
            (damaged, 1 + text[..at].matches('\n').count())
        };
        for (word, message) in [("x", wrong), ("999999", missing)] {
            let (text, _) = damaged(&text, third, word);
            let (text, line) = damaged(&text, second, word);
            let expected = format!("mesh, line {line}: {message}");
            for found in read_by_threads(name, text.as_bytes()) {
                assert_eq!(found.err().as_deref(), Some(expected.as_str()), "{name}");
            }
        }
        // The file ends in the middle of an element.
        let cut = &text[..text.len() * 3 / 4];
        let found = read_by_threads(name, cut.as_bytes());
        let errors: Vec<_> = found.into_iter().map(Result::err).collect();
        assert!(
            errors[0].is_some() && errors.iter().all(|error| *error == errors[0]),
            "{errors:?}"
        );
    }
}
