// Included by every kernel, after the declarations of the host: `real`, `real2`, WIDTH and the flags.

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
    /// The decrease of the energy error by the iterations: the sum of all α rᵀz.
    energy: real,
    /// The same over the last full block of iterations and over the unfinished one.
    full_block: real,
    open_block: real,
    /// The run is over once the estimate of the energy error is at most this, plus the next times the energy.
    remaining_goal: real,
    remaining_part: real,
    /// That estimate relative to the last α rᵀz, where the blocks hold no other.
    to_come: real,
    /// 1 once the run is over: all later kernels return at once.
    done: u32,
    /// 1 if a direction had no positive curvature: K is not positive definite, or rounding has taken over.
    broken: u32,
    /// Finished iterations.
    iterations: u32,
    /// The number of them in the last full block and in the unfinished one.
    in_full: u32,
    in_open: u32,
}

/// The estimate of the energy error from the last terms α rᵀz.
fn remaining(state: State) -> real {
    let recent = state.full_block + state.open_block;
    if state.in_full + state.in_open > 1u {
        return recent;
    }
    return recent * state.to_come;
}

/// Whether an iteration has ended its run. Written so that NaN does.
fn is_over(state: State) -> bool {
    return !(state.rr > state.goal)
        || !(remaining(state) > state.remaining_goal + state.remaining_part * state.energy)
        || state.broken != 0u;
}

/// The state after x += α p, with all but rᵀr and the next rᵀz; α is 0 where the curvature is not positive.
fn after_step(state: State, alpha: real, positive: bool) -> State {
    var after = state;
    after.broken = u32(!positive);
    if !positive {
        return after;
    }
    let decrease = alpha * state.rz;
    after.energy += decrease;
    after.iterations += 1u;
    after.open_block += decrease;
    after.in_open += 1u;
    // As `block_is_full` of the host.
    if after.in_open >= max(after.iterations / 5u, 1u) {
        after.full_block = after.open_block;
        after.in_full = after.in_open;
        after.open_block = real(0.0);
        after.in_open = 0u;
    }
    return after;
}

/// Goals of a run: for rᵀr, relative to that at the start and absolute; for the energy error, absolute and
/// relative to the energy, and how it is estimated from a single term.
struct Goals {
    residual_part: real,
    residual: real,
    remaining: real,
    remaining_part: real,
    to_come: real,
}

/// The state at the start of a run.
fn started(rr: real, goals: Goals) -> State {
    let goal = max(goals.residual_part * rr, goals.residual);
    // Written so that NaN ends the run.
    let done = u32(!(rr > goal));
    var state = State();
    state.rr = rr;
    state.goal = goal;
    state.rr_start = rr;
    state.remaining_goal = goals.remaining;
    state.remaining_part = goals.remaining_part;
    state.to_come = goals.to_come;
    state.done = done;
    return state;
}
