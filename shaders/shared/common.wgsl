// Included by every kernel, after `alias real` and `alias real2`.

/// Invocations of a workgroup, in all kernels.
const WIDTH: u32 = 128u;

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

/// The scalars of one CG run. Each dispatch reads one copy and one of its invocations writes the other,
/// so that no invocation reads what another one writes in the same dispatch.
struct State {
    /// rᵀ M⁻¹ r.
    rz: real,
    /// rᵀ r.
    rr: real,
    /// The run is over once rᵀ r is at most this.
    goal: real,
    /// 1 once the run is over: all later kernels return at once.
    done: u32,
    /// 1 if a direction had no positive curvature: K is not positive definite, or rounding has taken over.
    broken: u32,
    /// Finished iterations.
    iterations: u32,
}
