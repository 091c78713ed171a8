//! The sections of MSH 2.0 to 2.2.

use super::reader::Reader;
use super::{Result, cell, nodes_of};
use crate::mesh::file::raw::{Listed, Raw};

/// $Nodes; `parametric` ones also have their position on a curve or surface.
pub(super) fn nodes(reader: &mut Reader, raw: &mut Raw, parametric: bool) -> Result<()> {
    let count = count_line(reader, "nodes")?;
    // Parametric ones are of different lengths.
    let bytes = if parametric { [12, 0] } else { [8, 28] };
    let nodes = reader.records(count, bytes, |reader, nodes: &mut Vec<_>| {
        let tag = reader.tag()?;
        let x = [reader.float()?, reader.float()?, reader.float()?];
        if parametric {
            let dim = reader.int()?;
            reader.int()?;
            for _ in 0..if dim == 1 || dim == 2 { dim } else { 0 } {
                reader.float()?;
            }
        }
        nodes.push((tag, x, reader.at));
        Ok(())
    })?;
    for &(tag, x, at) in nodes.iter().flatten() {
        (raw.add_node(tag, x)).or_else(|message| reader.fail_at(at, message))?;
    }
    Ok(())
}

pub(super) fn elements<'a>(reader: &mut Reader<'a>, raw: &mut Raw) -> Result<()> {
    let total = count_line(reader, "elements")?;
    let header = |reader: &mut Reader, kind, count, n_tags| {
        let cell = cell(reader, kind)?;
        if count < 1 || !(0..1000).contains(&n_tags) {
            return reader.fail("the header of a run of elements is invalid");
        }
        Ok(cell)
    };
    let element = |reader: &mut Reader<'a>, cell, n_tags, listed: &mut Listed| {
        // The first tag is the physical group; 0 means none.
        let group = if n_tags > 0 { reader.int()? } else { 0 };
        for _ in 1..n_tags {
            reader.int()?;
        }
        listed.cells.push((cell, group));
        nodes_of(cell, Reader::tag, reader, raw, &mut listed.nodes)
    };
    let mut parts: Vec<Listed> = Vec::new();
    if reader.binary {
        // Binary files have a header for each run of one type.
        let mut read = 0;
        while read < total {
            let (kind, count, n_tags) = (reader.int()?, reader.int()?, reader.int()?);
            let cell = header(reader, kind, count, n_tags)?;
            let bytes = 4 * (1 + n_tags as usize + cell.n_nodes());
            parts.extend(
                reader.records(count as usize, [0, bytes], |reader, listed| {
                    reader.int()?;
                    element(reader, cell, n_tags, listed)
                })?,
            );
            read += count as usize;
        }
    } else {
        // The least are its number, its type, the number of its tags and a node.
        parts = reader.records(total, [8, 0], |reader, listed| {
            reader.int()?;
            let (kind, n_tags) = (reader.int()?, reader.int()?);
            let cell = header(reader, kind, 1, n_tags)?;
            element(reader, cell, n_tags, listed)
        })?;
    }
    raw.push_listed(parts);
    Ok(())
}

/// The count at the beginning of a section of MSH 2.2: text in binary files, too.
fn count_line(reader: &mut Reader, what: &str) -> Result<usize> {
    let line = reader.line().unwrap_or_default();
    let line = line.trim();
    match line.parse() {
        Ok(count) => Ok(count),
        Err(_) => reader.fail(format!("\"{line}\" is not a number of {what}")),
    }
}
