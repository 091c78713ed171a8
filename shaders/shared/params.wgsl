// Included by the kernels that work on vectors of unknowns.

/// What a dispatch works on. The host fills it; see `Params` there.
struct Params {
    /// Entries to handle (pairs of unknowns, or rows).
    count: u32,
    /// Their offset inside the bound segment.
    first: u32,
    /// Where this dispatch writes its partial sums.
    first_partial: u32,
    /// The partial sums that this dispatch adds up: where they start, and how many.
    first_read: u32,
    n_read: u32,
    /// Kernel-specific bits.
    flags: u32,
}

/// Flag: this dispatch is the one that writes the state.
const WRITES_STATE: u32 = 16u;
/// Flag: CG starts from the x that is there.
const CONTINUES: u32 = 32u;
