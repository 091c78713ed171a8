//! The sections of MSH 2.0 to 2.2.

use super::reader::Reader;
use super::{Result, cell, in_our_order};
use crate::mesh::file::raw::{MOST_NODES, Raw};

/// $Nodes; `parametric` ones also have their position on a curve or surface.
pub(super) fn nodes(reader: &mut Reader, raw: &mut Raw, parametric: bool) -> Result<()> {
    let count = count_line(reader, "nodes")?;
    for _ in 0..count {
        let tag = reader.tag()?;
        let x = [reader.float()?, reader.float()?, reader.float()?];
        if parametric {
            let dim = reader.int()?;
            reader.int()?;
            for _ in 0..if dim == 1 || dim == 2 { dim } else { 0 } {
                reader.float()?;
            }
        }
        (raw.add_node(tag, x)).or_else(|message| reader.fail(message))?;
    }
    Ok(())
}

pub(super) fn elements(reader: &mut Reader, raw: &mut Raw) -> Result<()> {
    let total = count_line(reader, "elements")?;
    let mut read = 0;
    // The tag of the last element and the number of its set: the next one mostly has the same.
    let (mut last, mut set) = (0, 0);
    while read < total {
        // Binary files have a header for each run of one type; in ASCII every element has its own type.
        let (kind, count, n_tags) = if reader.binary {
            (reader.int()?, reader.int()?, reader.int()?)
        } else {
            reader.int()?;
            (reader.int()?, 1, reader.int()?)
        };
        let cell = cell(reader, kind)?;
        if count < 1 || !(0..1000).contains(&n_tags) {
            return reader.fail("the header of a run of elements is invalid");
        }
        for _ in 0..count {
            if reader.binary {
                reader.int()?;
            }
            // The first tag is the physical group; 0 means none.
            let group = if n_tags > 0 { reader.int()? } else { 0 };
            for _ in 1..n_tags {
                reader.int()?;
            }
            if group != last {
                (last, set) = (group, raw.groups.number([group]));
            }
            let nodes = &mut [0; MOST_NODES][..cell.n_nodes()];
            for node in &mut *nodes {
                *node = reader.tag()?;
            }
            in_our_order(cell, nodes);
            (raw.add_element(cell, set, nodes)).or_else(|message| reader.fail(message))?;
        }
        read += count as usize;
    }
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
