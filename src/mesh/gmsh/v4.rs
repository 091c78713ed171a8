//! The sections of MSH 4.1.

use super::reader::Reader;
use super::{Result, cell, in_our_order};
use crate::mesh::file::raw::{MOST_GROUPS, MOST_NODES, Raw};

pub(super) fn entities(reader: &mut Reader, raw: &mut Raw) -> Result<()> {
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = reader.size()?;
    }
    for (dim, &count) in counts.iter().enumerate() {
        for _ in 0..count {
            let tag = reader.int()?;
            // A point has a place, the others a box.
            for _ in 0..if dim == 0 { 3 } else { 6 } {
                reader.float()?;
            }
            let n_groups = reader.size()?;
            if n_groups > MOST_GROUPS {
                return reader.fail(format!(
                    "entity {tag} is in more than {MOST_GROUPS} physical groups"
                ));
            }
            let mut groups = Vec::new();
            for _ in 0..n_groups {
                groups.push(reader.int()?);
            }
            let set = raw.groups.number(groups);
            raw.entities.insert((dim as i64, tag), set);
            if dim > 0 {
                for _ in 0..reader.size()? {
                    reader.int()?;
                }
            }
        }
    }
    Ok(())
}

pub(super) fn nodes(reader: &mut Reader, raw: &mut Raw) -> Result<()> {
    let blocks = reader.size()?;
    for _ in 0..3 {
        reader.size()?;
    }
    for _ in 0..blocks {
        let dim = reader.int()?;
        reader.int()?;
        let parametric = reader.int()? != 0;
        let count = reader.size()?;
        let mut tags = Vec::new();
        for _ in 0..count {
            tags.push(reader.size()?);
        }
        for tag in tags {
            let x = [reader.float()?, reader.float()?, reader.float()?];
            for _ in 0..if parametric { dim } else { 0 } {
                reader.float()?;
            }
            (raw.add_node(tag, x)).or_else(|message| reader.fail(message))?;
        }
    }
    Ok(())
}

pub(super) fn elements(reader: &mut Reader, raw: &mut Raw) -> Result<()> {
    let blocks = reader.size()?;
    for _ in 0..3 {
        reader.size()?;
    }
    for _ in 0..blocks {
        let (dim, tag, kind) = (reader.int()?, reader.int()?, reader.int()?);
        let count = reader.size()?;
        let cell = cell(reader, kind)?;
        let set = raw.entities.get(&(dim, tag)).copied().unwrap_or(0);
        let tags = &mut [0; MOST_NODES][..cell.n_nodes()];
        for _ in 0..count {
            reader.size()?;
            for tag in &mut *tags {
                *tag = reader.size()?;
            }
            in_our_order(cell, tags);
            (raw.add_element(cell, set, tags)).or_else(|message| reader.fail(message))?;
        }
    }
    Ok(())
}
