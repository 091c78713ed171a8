//! `signorini phases`: the time of each phase of a case by the number of threads.

use super::advice::message_of;
use super::{PhasesArguments, SolveArguments, print, solve};
use signorini::backend::cpu::{COPIED, copy_bandwidth};
use signorini::output::write_whole;
use std::path::Path;

/// The phases, by their names in `report.json`, and what they are called here.
const PHASES: [(&str, &str); 7] = [
    ("mesh", "mesh"),
    ("assembly", "assembly"),
    ("factor", "factor or hierarchy"),
    ("setup", "set-up"),
    ("ssnm", "Newton's method"),
    ("output", "fields and files"),
    ("total", "all"),
];
/// Numbers of threads for which times are predicted.
const PREDICTED: [usize; 2] = [16, 64];

/// A row of the table: seconds, or bytes per second, for each number of threads.
struct Row {
    name: &'static str,
    values: Vec<f64>,
}

impl Row {
    /// How much faster the last number of threads is than one.
    fn ratio(&self) -> f64 {
        self.values[0] / self.values[self.values.len() - 1]
    }

    /// The part that s gives in T(1)/T(p) = 1/(s + (1 − s)/p), from 0 to 1 (Amdahl).
    fn serial(&self, p: usize) -> f64 {
        let p = p as f64;
        ((p / self.ratio() - 1.0) / (p - 1.0)).clamp(0.0, 1.0)
    }

    /// Seconds with so many threads.
    fn predicted(&self, serial: f64, threads: usize) -> f64 {
        self.values[0] * (serial + (1.0 - serial) / threads as f64)
    }
}

pub fn run(arguments: &PhasesArguments) -> Result<u8, String> {
    let threads = numbers(arguments)?;
    let directory = std::env::temp_dir().join(format!("signorini-phases-{}", std::process::id()));
    let measured = measure(arguments, &threads, &directory);
    // Whether or not it has been made.
    let _ = std::fs::remove_dir_all(&directory);
    let (code, rows, copies) = measured?;
    print(&table(&rows, &copies, &threads))?;
    if let Some(path) = &arguments.json {
        let most = threads[threads.len() - 1];
        let of_row = |row: &Row| serde_json::json!({ "phase": row.name, "seconds": row.values, "serial": row.serial(most) });
        let document = serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "case": arguments.case,
            "threads": threads,
            "phases": rows.iter().map(of_row).collect::<Vec<_>>(),
            "copy_bytes_per_second": copies,
        });
        write_whole(path, format!("{document:#}\n").as_bytes()).map_err(|e| message_of(&e))?;
    }
    Ok(code)
}

/// The numbers of threads, from 1 on.
fn numbers(arguments: &PhasesArguments) -> Result<Vec<usize>, String> {
    let cores = rayon::current_num_threads();
    let mut threads = match arguments.threads.is_empty() {
        false => arguments.threads.clone(),
        // Powers of two, and all cores.
        true => (0..)
            .map(|k| 1 << k)
            .take_while(|&threads| threads < cores)
            .chain([cores])
            .collect(),
    };
    threads.push(1);
    threads.sort_unstable();
    threads.dedup();
    if threads[0] == 0 || threads.len() < 2 {
        return Err(
            "--threads needs a number above 1: times are measured beside those of one thread"
                .to_owned(),
        );
    }
    Ok(threads)
}

/// The least seconds of all runs, and the bandwidth of a copy, for each number of threads; the exit code of the last run.
fn measure(
    arguments: &PhasesArguments,
    threads: &[usize],
    directory: &Path,
) -> Result<(u8, Vec<Row>, Vec<f64>), String> {
    let solving = SolveArguments {
        case: arguments.case.clone(),
        deck: arguments.deck.clone(),
        output: Some(directory.to_owned()),
        engine: arguments.engine.clone(),
        settings: arguments.settings.clone(),
        plots: false,
        quiet: true,
        verbose: false,
    };
    let mut rows = PHASES.map(|(_, name)| Row {
        name,
        values: Vec::new(),
    });
    let (mut code, mut copies) = (0, Vec::new());
    for &threads in threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| format!("{threads} threads: {error}"))?;
        let mut least = [f64::INFINITY; PHASES.len()];
        for _ in 0..arguments.repeat.max(1) {
            code = pool.install(|| solve::run(&solving))?;
            if solve::is_interrupted() {
                return Err("interrupted: there are no times of whole runs".to_owned());
            }
            let path = directory.join("report.json");
            let report =
                std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            let report: serde_json::Value = serde_json::from_slice(&report)
                .map_err(|error| format!("{}: {error}", path.display()))?;
            for (least, (key, _)) in least.iter_mut().zip(PHASES) {
                *least = least.min(report["timings"][key].as_f64().unwrap_or(f64::INFINITY));
            }
        }
        for (row, seconds) in rows.iter_mut().zip(least) {
            row.values.push(seconds);
        }
        copies.push(pool.install(|| copy_bandwidth(COPIED)));
    }
    Ok((code, rows.into(), copies))
}

fn table(rows: &[Row], copies: &[f64], threads: &[usize]) -> String {
    let most = threads[threads.len() - 1];
    let mut text = format!("{:20}", "seconds, threads");
    threads.iter().for_each(|p| text += &format!(" {p:>9}"));
    text += &format!(" {:>7} {:>8}", "ratio", "serial");
    PREDICTED.iter().for_each(|p| text += &format!(" {p:>9}"));
    text += "\n";
    for row in rows {
        text += &format!("{:20}", row.name);
        row.values.iter().for_each(|v| text += &format!(" {v:9.3}"));
        // Too short to be measured.
        if row.values[0] < 1e-3 {
            text += "\n";
            continue;
        }
        let serial = row.serial(most);
        text += &format!(" {:7.2} {:7.0}%", row.ratio(), 100.0 * serial);
        let predicted = PREDICTED.map(|p| format!(" {:9.3}", row.predicted(serial, p)));
        text += &(predicted.concat() + "\n");
    }
    text += &format!("{:20}", "copy, GB/s");
    copies
        .iter()
        .for_each(|v| text += &format!(" {:9.1}", v / 1e9));
    let last = copies.len() - 1;
    text += &format!(" {:7.2}\n", copies[last] / copies[0]);
    text + "The serial part s is that of T(1)/T(p) = 1/(s + (1 − s)/p), and the last columns follow from it. What memory limits counts as serial.\n"
}

#[cfg(test)]
mod tests {
    use super::Row;

    #[test]
    fn the_serial_part_is_that_of_amdahl() {
        let row = |values: [f64; 2]| Row {
            name: "",
            values: values.to_vec(),
        };
        // 1 s in sequence and 8 s on four threads.
        let mixed = row([9.0, 3.0]);
        assert!((mixed.serial(4) - 1.0 / 9.0).abs() < 1e-15 && mixed.ratio() == 3.0);
        assert!((mixed.predicted(mixed.serial(4), 16) - 1.5).abs() < 1e-14);
        assert_eq!(row([8.0, 2.0]).serial(4), 0.0);
        assert_eq!(row([8.0, 9.0]).serial(4), 1.0);
        assert_eq!(row([8.0, 1.0]).serial(4), 0.0);
    }
}
