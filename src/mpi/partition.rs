//! The owner of each node: METIS divides the graph of the nodes so that ranks have about the same work and few neighbours.

use crate::model::share::Graph;

/// The owner of each node, among so many ranks; METIS's own words where it fails.
pub(super) fn owners(graph: &mut Graph, ranks: usize) -> Result<Vec<u32>, String> {
    let nodes = graph.work.len();
    if ranks == 1 {
        return Ok(vec![0; nodes]);
    }
    // With hardly more nodes than ranks there is nothing to divide.
    if nodes <= 2 * ranks {
        return Ok((0..nodes).map(|node| (node % ranks) as u32).collect());
    }
    // METIS wants some work.
    if graph.work.iter().all(|&work| work == 0) {
        graph.work.fill(1);
    }
    let mut parts = vec![0; nodes];
    metis::Graph::new(1, ranks as i32, &graph.starts, &graph.others)
        .map_err(|error| error.to_string())?
        .set_vwgt(&graph.work)
        .part_kway(&mut parts)
        .map_err(|error| error.to_string())?;
    Ok(parts.into_iter().map(|part| part as u32).collect())
}
