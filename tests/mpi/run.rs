//! The program run on ranks, and its results.

use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The default ε of a case file.
pub const TOLERANCE: f64 = 1e-6;
/// Pressures of single places are less accurate than their sums: the same holds for the factor.
pub const NODAL: f64 = 3000.0 * TOLERANCE;

/// Solves a case on each of these numbers of ranks, and compares it with the factor, and its counts with those of conjugate
/// gradients in one process.
pub fn compare(case: &Path, ranks: &[usize]) {
    let name = case.file_name().expect("a file").to_string_lossy();
    let place = tempfile::tempdir().expect("a directory");
    let place = place.path();
    let alone = |stiffness: &str| {
        let more = ["--stiffness", stiffness, "--backend", "cpu"];
        solved(None, case, &more, &place.join(stiffness))
    };
    let (direct, nested) = (alone("cholesky"), alone("pcg"));
    let off = |found: &[f64], expected: &[f64], scale: f64| {
        assert_eq!(found.len(), expected.len(), "{name}");
        let pairs = found.iter().zip(expected);
        pairs.fold(0.0_f64, |max, (a, b)| max.max((a - b).abs())) / scale
    };
    let size = |values: &[f64]| values.iter().fold(1e-300_f64, |max, v| max.max(v.abs()));
    // Slips and gaps may be pure rounding of the motions.
    let fields = std::fs::read_dir(&direct.directory)
        .expect("a directory")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "vtu"));
    let moved = fields.fold(0.0_f64, |most, path| most.max(Grid::read(&path).largest(0)));
    for &ranks in ranks {
        let shared = solved(Some(ranks), case, &[], &place.join("ranks"));
        assert_eq!(shared.report["ranks"]["count"], ranks);
        for key in ["elements", "order", "hints"] {
            let [told, expected] = [&shared, &direct].map(|run| &run.report[key]);
            assert_eq!(told, expected, "{name} on {ranks}: {key}");
        }
        // Forces that are rounding of the acting ones count as zero.
        let forces = off(
            &shared.forces(),
            &direct.forces(),
            size(&direct.normal_forces()),
        );
        let expected = direct.energies();
        let energies = off(&shared.energies(), &expected, size(&expected));
        let of =
            |column: &str, scale: f64| off(&shared.column(column), &direct.column(column), scale);
        let pressures = of("normal_pressure", size(&direct.column("normal_pressure")));
        let [slip, gap] = ["slip", "gap"].map(|column| of(column, moved));
        let counts = ["iter", "n_A"]
            .map(|key| [&shared, &nested].map(|run| run.report[key].as_f64().expect(key)));
        let [[iter, alone], [products, _]] = counts;
        println!(
            "  {name} on {ranks}: forces {forces:.1e}, pressures {pressures:.1e}, slip {slip:.1e}, gap {gap:.1e}; {iter} steps, \
             {products} products, {alone} steps in one process"
        );
        for column in ["contact", "place"] {
            assert_eq!(
                shared.words(column),
                direct.words(column),
                "{name} on {ranks}: {column}"
            );
        }
        assert!(forces <= 10.0 * TOLERANCE, "{name} on {ranks}: forces");
        assert!(
            energies <= NODAL,
            "{name} on {ranks}: energies {energies:e}"
        );
        assert!(pressures <= NODAL, "{name} on {ranks}: pressures");
        assert!(slip.max(gap) <= NODAL, "{name} on {ranks}: slip or gap");
        for [found, expected] in counts {
            assert!(
                (found - expected).abs() <= (0.2 * expected).max(2.0),
                "{name} on {ranks}: {found} steps or products instead of {expected}"
            );
        }
    }
}

/// The program with a command.
pub fn signorini(command: &str) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_signorini"));
    program.arg(command);
    program
}

/// A command on so many ranks, more than there are cores if necessary.
pub fn mpirun(ranks: usize, command: &mut Command) -> Output {
    let mut launcher = Command::new("mpirun");
    launcher.args(["--map-by", ":OVERSUBSCRIBE", "-n", &ranks.to_string()]);
    launcher.arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        launcher.env(name, value.unwrap_or_default());
    }
    // Ranks that wait leave the cores to those that work, and to other programs.
    launcher.env("OMPI_MCA_mpi_yield_when_idle", "1");
    // Open MPI refuses to start anything as root, the user in containers; MPICH does not.
    launcher
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    launcher
        .output()
        .expect("mpirun: sh tests/mpi.sh installs it")
}

/// The results of a run.
pub struct Solved {
    pub directory: PathBuf,
    pub report: Value,
    /// The last `contact.csv`.
    pub table: String,
}

/// Solves a case in a directory, on ranks or alone.
pub fn solved(ranks: Option<usize>, case: &Path, more: &[&str], directory: &Path) -> Solved {
    let mut command = signorini("solve");
    command
        .arg(case)
        .args(more)
        .args(["--quiet", "--output"])
        .arg(directory);
    let run = match ranks {
        // Otherwise it would be one process.
        Some(1) => mpirun(1, command.env("SIGNORINI_RANKS", "1")),
        Some(ranks) => mpirun(ranks, &mut command),
        None => command.output().expect("the program"),
    };
    assert_eq!(
        run.status.code(),
        Some(0),
        "{}: {}",
        case.display(),
        String::from_utf8_lossy(&run.stderr)
    );
    report(directory)
}

/// The results of a run in a directory.
pub fn report(directory: &Path) -> Solved {
    let text = std::fs::read_to_string(directory.join("report.json")).expect("a report");
    let mut tables: Vec<PathBuf> = std::fs::read_dir(directory)
        .expect("a directory")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "csv"))
        .collect();
    tables.sort();
    Solved {
        directory: directory.to_owned(),
        report: serde_json::from_str(&text).expect("a report"),
        table: tables.last().map_or(String::new(), |path| {
            std::fs::read_to_string(path).expect("a table")
        }),
    }
}

/// The numbers of a list.
pub fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("{value}"));
    list.iter().map(|v| v.as_f64().expect("a number")).collect()
}

impl Solved {
    fn of_steps(&self, what: &[&str], key: &str) -> Vec<f64> {
        let steps = self.report["steps"].as_array().expect("steps");
        let all = steps.iter().flat_map(|step| {
            what.iter()
                .flat_map(|what| step[*what].as_array().expect("a list"))
        });
        all.flat_map(|one| match &one[key] {
            Value::Number(number) => vec![number.as_f64().expect("a number")],
            list => numbers(list),
        })
        .collect()
    }

    /// The resultants of contacts and supports in all steps.
    pub fn forces(&self) -> Vec<f64> {
        self.of_steps(&["contacts", "supports"], "force")
    }

    /// Strain energy and work in all steps without temperatures.
    fn energies(&self) -> Vec<f64> {
        let steps = self.report["steps"].as_array().expect("steps").iter();
        let energies = steps.filter_map(|step| step["energy"].as_object());
        let of_step = |energy: &serde_json::Map<String, Value>| -> Vec<f64> {
            energy
                .values()
                .map(|value| value.as_f64().expect("a number"))
                .collect()
        };
        energies.flat_map(of_step).collect()
    }

    pub fn normal_forces(&self) -> Vec<f64> {
        self.of_steps(&["contacts"], "normal_force")
    }

    /// The entries in the columns of the table whose names begin so, in all its rows.
    fn words(&self, name: &str) -> Vec<&str> {
        let mut lines = self.table.lines();
        let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let wanted: Vec<usize> = (0..head.len())
            .filter(|&i| head[i].starts_with(name))
            .collect();
        lines
            .flat_map(|line| {
                let fields: Vec<&str> = line.split(',').collect();
                wanted.iter().map(|&i| fields[i]).collect::<Vec<&str>>()
            })
            .collect()
    }

    /// The numbers there.
    fn column(&self, name: &str) -> Vec<f64> {
        let words = self.words(name).into_iter();
        words.map(|word| word.parse().expect("a number")).collect()
    }
}

/// A field of a grid at a node: its number in [`FIELDS`], and a component.
type Value1 = (usize, f64);

const FIELDS: [&str; 3] = ["displacement", "stress", "contact_pressure"];

/// Points of a grid with their data.
pub struct Grid {
    pub cells: usize,
    pub nodes: HashMap<[u64; 3], Vec<Value1>>,
}

impl Grid {
    pub fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let after = |mark: &str| {
            text.split_once(mark)
                .unwrap_or_else(|| panic!("no {mark}"))
                .1
        };
        let cells = after("NumberOfCells=\"")
            .split('"')
            .next()
            .expect("a number");
        let array = |name: &str| -> Vec<f64> {
            let encoded = after(&format!("Name=\"{name}\" "))
                .split(['>', '<'])
                .nth(1)
                .expect("numbers");
            let raw = decoded(encoded);
            raw[8..]
                .chunks(8)
                .map(|word| f64::from_le_bytes(word.try_into().expect("8 bytes")))
                .collect()
        };
        let points = array("Points");
        let fields = FIELDS.map(array);
        let nodes = points.chunks(3).enumerate().map(|(i, x)| {
            let here = fields.iter().enumerate().flat_map(|(number, field)| {
                let each = 3 * field.len() / points.len();
                field[each * i..each * (i + 1)]
                    .iter()
                    .map(move |&v| (number, v))
            });
            (
                [x[0].to_bits(), x[1].to_bits(), x[2].to_bits()],
                here.collect(),
            )
        });
        Self {
            cells: cells.parse().expect("a number"),
            nodes: nodes.collect(),
        }
    }

    /// The largest entry of a field.
    pub fn largest(&self, field: usize) -> f64 {
        let all = self.nodes.values().flatten();
        all.filter(|v| v.0 == field)
            .fold(0.0, |max, v| max.max(v.1.abs()))
    }
}

/// Base64 (RFC 4648).
fn decoded(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let letters: Vec<u8> = text.bytes().filter(|&c| c != b'=').collect();
    letters
        .chunks(4)
        .flat_map(|four| {
            let bits = four
                .iter()
                .fold(0_u32, |bits, &c| bits << 6 | u32::from(value(c)))
                << (6 * (4 - four.len()));
            bits.to_be_bytes()[1..four.len()].to_vec()
        })
        .collect()
}

/// The entries of a file in the Matrix Market format: row, column, value.
fn entries(path: &Path) -> Vec<(usize, usize, f64)> {
    let text =
        std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let is_symmetric = text
        .lines()
        .next()
        .is_some_and(|line| line.contains("symmetric"));
    let is_array = text
        .lines()
        .next()
        .is_some_and(|line| line.contains("array"));
    let lines = text
        .lines()
        .filter(|line| !line.starts_with('%') && !line.trim().is_empty())
        .skip(1);
    let mut all = Vec::new();
    for (number, line) in lines.enumerate() {
        let mut fields = line.split_whitespace();
        let mut next = || fields.next().expect("a field");
        if is_array {
            all.push((number, 0, next().parse().expect("a number")));
            continue;
        }
        let [i, j] = [next(), next()].map(|field| field.parse::<usize>().expect("an index") - 1);
        let v = next().parse().expect("a number");
        all.push((i, j, v));
        if is_symmetric && i != j {
            all.push((j, i, v));
        }
    }
    all
}

/// The violations of (1)–(3) by u and λ in a directory, for the problem whose matrices are in another one, each relative to the
/// largest of its kind.
pub fn conditions_of_matrices(problem: &Path, solution: &Path) -> f64 {
    let vector = |directory: &Path, name: &str| -> Vec<f64> {
        entries(&directory.join(name))
            .into_iter()
            .map(|entry| entry.2)
            .collect()
    };
    let [k, n, t] = ["K.mtx", "N.mtx", "T.mtx"].map(|name| entries(&problem.join(name)));
    let [f, d, g] = ["f.mtx", "d.mtx", "g.mtx"].map(|name| vector(problem, name));
    let u = vector(solution, "u.mtx");
    let [normal, tangential] =
        ["lambda_normal.mtx", "lambda_tangential.mtx"].map(|name| vector(solution, name));
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |max, v| max.max(v.abs()));
    let mut rest: Vec<f64> = f.iter().map(|f| -f).collect();
    for (matrix, x, transposed) in [
        (&k, &u, false),
        (&n, &normal, true),
        (&t, &tangential, true),
    ] {
        for &(i, j, v) in matrix {
            let (row, column) = if transposed { (j, i) } else { (i, j) };
            rest[row] += v * x[column];
        }
    }
    let times = |matrix: &[(usize, usize, f64)]| {
        let mut y = vec![0.0; d.len()];
        matrix.iter().for_each(|&(i, j, v)| y[i] += v * u[j]);
        y
    };
    let (closing, slip) = (times(&n), times(&t));
    let (force, length) = (largest(&f), largest(&u));
    let mut worst = largest(&rest) / force;
    for i in 0..d.len() {
        let gap = d[i] - closing[i];
        // Nothing overlaps or is pulled, and pressed places touch.
        worst = worst.max(-gap / length).max(-normal[i] / force);
        worst = worst.max((normal[i] / force).min(gap / length));
        // Friction up to its bound; below it nothing slips, and it acts against the slip.
        worst = worst.max((tangential[i].abs() - g[i]) / force);
        worst = worst.max(((g[i] - tangential[i].abs()) / force).min(slip[i].abs() / length));
        worst = worst
            .max((tangential[i].abs() / force).min(-slip[i] * tangential[i].signum() / length));
    }
    worst
}
