// Second half of a CG iteration on one segment: β = new rᵀz / old rᵀz, p = z + β p; in the first
// iteration p = z.
//
// Flags: WRITES_STATE: one dispatch of a step does.
//
// Bytes: z and p read, p written.

@group(0) @binding(0) var<uniform> params: Params;
/// As `check` (or `begin`) has left it: rᵀz is the old one.
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read_write> next: State;
/// The partial sums of rᵀz.
@group(0) @binding(3) var<storage, read_write> partials: array<real2>;
@group(0) @binding(4) var<storage, read> z: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> p: array<real2>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let writes_state = (params.flags & WRITES_STATE) != 0u && group.x == 0u && lane == 0u;
    if state.done != 0u {
        if writes_state {
            next = state;
        }
        return;
    }
    let rz = sum_of_partials(lane).x;
    if writes_state {
        next = state;
        next.rz = rz;
    }
    let first = state.rz == real(0.0);
    var beta = real(0.0);
    if !first {
        beta = rz / state.rz;
    }
    for (var i = group.x * WIDTH + lane; i < params.count; i += groups.x * WIDTH) {
        var direction = real2(z[i]);
        // Before the first iteration p may not even be a number.
        if !first {
            direction += beta * p[i];
        }
        p[i] = direction;
    }
}
