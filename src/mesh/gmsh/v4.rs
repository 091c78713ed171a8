//! The sections of MSH 4.1.

use super::reader::Reader;
use super::{Result, cell, nodes_of};
use crate::mesh::file::raw::{MOST_GROUPS, Raw};

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
        let tags = reader.records(count, [2, 8], |reader, tags: &mut Vec<usize>| {
            tags.push(reader.size()?);
            Ok(())
        })?;
        // Further ones are places on a curve or surface.
        let n = if parametric {
            3 + dim.clamp(0, 3) as usize
        } else {
            3
        };
        let places = reader.records(count, [2 * n, 8 * n], |reader, places: &mut Vec<_>| {
            let x = [reader.float()?, reader.float()?, reader.float()?];
            for _ in 3..n {
                reader.float()?;
            }
            places.push((x, reader.at));
            Ok(())
        })?;
        for (&tag, &(x, at)) in tags.iter().flatten().zip(places.iter().flatten()) {
            (raw.add_node(tag, x)).or_else(|message| reader.fail_at(at, message))?;
        }
    }
    Ok(())
}

pub(super) fn elements<'a>(reader: &mut Reader<'a>, raw: &mut Raw) -> Result<()> {
    let blocks = reader.size()?;
    for _ in 0..3 {
        reader.size()?;
    }
    for _ in 0..blocks {
        let (dim, tag, kind) = (reader.int()?, reader.int()?, reader.int()?);
        let count = reader.size()?;
        let cell = cell(reader, kind)?;
        let set = raw.entities.get(&(dim, tag)).copied().unwrap_or(0);
        let numbers = 1 + cell.n_nodes();
        let nodes = reader.records(count, [2 * numbers, 8 * numbers], |reader, nodes| {
            reader.size()?;
            nodes_of(cell, Reader::size, reader, raw, nodes)
        })?;
        raw.push_all(cell, set, &nodes.concat());
    }
    Ok(())
}
