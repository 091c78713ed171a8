// Included by every kernel, after `alias real` and `alias real2`.

/// Invocations of a workgroup, in all kernels.
const WIDTH: u32 = 128u;

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
