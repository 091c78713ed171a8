// Included by every kernel.

/// The parameters of a dispatch. The host fills it; see `Params` there.
struct Params {
    /// Entries to handle: pairs of unknowns, or (block) rows.
    count: u32,
    /// The first of them inside the bound segment.
    first: u32,
    /// Where this dispatch writes its partial sums.
    first_partial: u32,
    /// The partial sums that this dispatch adds up: where they start, and how many.
    first_read: u32,
    n_read: u32,
    /// Where the columns start in the structure of a matrix, behind the slices.
    columns: u32,
    /// Options of a kernel: see its head.
    flags: u32,
    /// Invocations that share a block row.
    lanes: u32,
    /// Coefficients of the smoother.
    c1: f32,
    c2: f32,
}
