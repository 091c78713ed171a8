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
    /// rᵀ r at its start.
    rr_start: real,
    /// What the iterations have lowered the energy error by: the sum of all α rᵀz.
    energy: real,
    /// The last α rᵀz.
    decrease: real,
    /// The run is over once the last decrease is at most this, plus the next times the energy.
    decrease_goal: real,
    decrease_part: real,
    /// 1 once the run is over: all later kernels return at once.
    done: u32,
    /// 1 if a direction had no positive curvature: K is not positive definite, or rounding has taken over.
    broken: u32,
    /// Finished iterations.
    iterations: u32,
}

/// Whether an iteration has ended its run. Written so that NaN does.
fn is_over(state: State) -> bool {
    return !(state.rr > state.goal)
        || !(state.decrease > state.decrease_goal + state.decrease_part * state.energy)
        || state.broken != 0u;
}

/// The state after x += α p, with all but rᵀr and the next rᵀz; α is 0 where the curvature is not positive.
fn after_step(state: State, alpha: real, positive: bool) -> State {
    var after = state;
    after.decrease = alpha * state.rz;
    after.energy += after.decrease;
    after.broken = u32(!positive);
    after.iterations += u32(positive);
    return after;
}

/// Goals of a run: for rᵀr, relative to that at the start and absolute; for the decrease, absolute and
/// relative to the energy.
struct Goals {
    residual_part: real,
    residual: real,
    decrease: real,
    decrease_part: real,
}

/// The state at the start of a run.
fn started(rz: real, rr: real, goals: Goals) -> State {
    let goal = max(goals.residual_part * rr, goals.residual);
    // Written so that NaN ends the run.
    let done = u32(!(rr > goal));
    return State(rz, rr, goal, rr, real(0.0), real(0.0), goals.decrease, goals.decrease_part, done, 0u, 0u);
}
