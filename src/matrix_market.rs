//! Matrix Market files: real (or integer) matrices in coordinate or array form, general or symmetric.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum MatrixMarketError {
    #[error("cannot read {}: {source}", path.display())]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}, line {line}: {message}", path.display())]
    Format {
        path: PathBuf,
        line: usize,
        message: String,
    },
    #[error("{}: {message}", path.display())]
    Shape { path: PathBuf, message: String },
}

/// A matrix as triplets, counted from 0; both triangles of a symmetric one.
#[derive(Clone, Debug)]
pub struct Matrix {
    pub rows: usize,
    pub cols: usize,
    pub entries: Vec<(usize, usize, f64)>,
    path: PathBuf,
}

impl Matrix {
    /// The entries of a matrix with one column (or one row).
    pub fn into_vector(self) -> Result<Vec<f64>, MatrixMarketError> {
        if self.rows != 1 && self.cols != 1 {
            return Err(MatrixMarketError::Shape {
                message: format!(
                    "expected a vector, found a {} × {} matrix",
                    self.rows, self.cols
                ),
                path: self.path,
            });
        }
        let mut vector = vec![0.0; self.rows * self.cols];
        for (i, j, value) in self.entries {
            vector[i + j] += value;
        }
        Ok(vector)
    }

    /// The rows of a matrix with two columns.
    pub fn into_points(self) -> Result<Vec<[f64; 2]>, MatrixMarketError> {
        if self.cols != 2 {
            return Err(MatrixMarketError::Shape {
                message: format!("expected two columns (x and y), found {}", self.cols),
                path: self.path,
            });
        }
        let mut points = vec![[0.0; 2]; self.rows];
        for (i, j, value) in self.entries {
            points[i][j] += value;
        }
        Ok(points)
    }
}

/// Reads a file.
pub fn read(path: &Path) -> Result<Matrix, MatrixMarketError> {
    let text = std::fs::read_to_string(path).map_err(|source| MatrixMarketError::Io {
        path: path.to_owned(),
        source,
    })?;
    parse(&text, path).map_err(|(line, message)| MatrixMarketError::Format {
        path: path.to_owned(),
        line,
        message,
    })
}

fn parse(text: &str, path: &Path) -> Result<Matrix, (usize, String)> {
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()));
    let (_, header) = lines.next().ok_or((1, "the file is empty".to_owned()))?;
    let words: Vec<String> = header.split_whitespace().map(str::to_lowercase).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let ["%%matrixmarket", "matrix", form, field, symmetry] = words[..] else {
        return Err((
            1,
            "the first line must be: %%MatrixMarket matrix coordinate|array real general|symmetric"
                .to_owned(),
        ));
    };
    let coordinate = match form {
        "coordinate" => true,
        "array" => false,
        _ => return Err((1, format!("form \"{form}\" is not coordinate or array"))),
    };
    if !matches!(field, "real" | "integer" | "double") {
        return Err((
            1,
            format!("field \"{field}\" is not supported: only real numbers are"),
        ));
    }
    let symmetric = match symmetry {
        "general" => false,
        "symmetric" => true,
        _ => {
            return Err((
                1,
                format!("symmetry \"{symmetry}\" is not general or symmetric"),
            ));
        }
    };
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('%'));
    let (line, sizes) = lines
        .next()
        .ok_or((2, "the line with the sizes is missing".to_owned()))?;
    let parsed: Option<Vec<usize>> = sizes.split_whitespace().map(|w| w.parse().ok()).collect();
    let (rows, cols, count) = match (parsed.as_deref(), coordinate) {
        (Some(&[rows, cols, count]), true) => (rows, cols, count),
        (Some(&[rows, cols]), false) => (rows, cols, rows.saturating_mul(cols)),
        _ => {
            let expected = if coordinate {
                "rows columns entries"
            } else {
                "rows columns"
            };
            return Err((line, format!("\"{sizes}\" is not: {expected}")));
        }
    };
    if symmetric && rows != cols {
        return Err((
            line,
            format!("a symmetric matrix cannot be {rows} × {cols}"),
        ));
    }
    if rows >= u32::MAX as usize || cols >= u32::MAX as usize {
        return Err((line, format!("{rows} × {cols} is too large")));
    }
    let number = |line: usize, word: Option<&str>| -> Result<f64, (usize, String)> {
        let word = word.ok_or((line, "a value is missing".to_owned()))?;
        word.parse()
            .map_err(|_| (line, format!("\"{word}\" is not a number")))
    };
    let mut entries = Vec::with_capacity(count.min(text.len() / 2) * if symmetric { 2 } else { 1 });
    let mut push = |i: usize, j: usize, value: f64| {
        entries.push((i, j, value));
        if symmetric && i != j {
            entries.push((j, i, value));
        }
    };
    let mut last = line;
    if coordinate {
        let mut read = 0;
        for (line, text) in lines {
            last = line;
            if read == count {
                return Err((
                    line,
                    format!("there are more than the {count} announced entries"),
                ));
            }
            let mut words = text.split_whitespace();
            let mut index = |name: &str, limit: usize| -> Result<usize, (usize, String)> {
                let word = words
                    .next()
                    .ok_or((line, format!("the {name} is missing")))?;
                match word.parse::<usize>() {
                    Ok(i) if (1..=limit).contains(&i) => Ok(i - 1),
                    _ => Err((
                        line,
                        format!("{name} \"{word}\" is not between 1 and {limit}"),
                    )),
                }
            };
            let (i, j) = (index("row", rows)?, index("column", cols)?);
            if symmetric && j > i {
                return Err((
                    line,
                    "a symmetric file holds the lower triangle only".to_owned(),
                ));
            }
            push(i, j, number(line, words.next())?);
            read += 1;
        }
        if read < count {
            return Err((
                last,
                format!("the file ends after {read} of {count} entries"),
            ));
        }
    } else {
        // Column by column; of a symmetric matrix the lower triangle.
        let mut values =
            lines.flat_map(|(line, text)| text.split_whitespace().map(move |w| (line, w)));
        for j in 0..cols {
            for i in if symmetric { j } else { 0 }..rows {
                let (line, word) = values
                    .next()
                    .ok_or((last, "the file ends before the last value".to_owned()))?;
                last = line;
                push(i, j, number(line, Some(word))?);
            }
        }
        if let Some((line, _)) = values.next() {
            return Err((
                line,
                "there are more values than the matrix has entries".to_owned(),
            ));
        }
    }
    Ok(Matrix {
        rows,
        cols,
        entries,
        path: path.to_owned(),
    })
}

/// A vector as the text of an array file with one column.
pub fn vector_text(values: &[f64]) -> String {
    let mut text = format!(
        "%%MatrixMarket matrix array real general\n{} 1\n",
        values.len()
    );
    for value in values {
        writeln!(text, "{value:e}").expect("writing to a string cannot fail");
    }
    text
}
