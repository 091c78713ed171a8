// A step of the smoother on one part of A: d = c₁ d + c₂ D⁻¹(b − A x), x_next = x + d.
//
// Bytes: A, D⁻¹, b, x, d read once, d and x_next written once.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read> structure: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<Stored>;
/// Blocks of D⁻¹, by rows.
@group(0) @binding(4) var<storage, read> inverse_diagonal: array<f32>;
@group(0) @binding(5) var<storage, read> b: array<Row>;
@group(0) @binding(6) var<storage, read> x: array<In>;
@group(0) @binding(7) var<storage, read_write> d: array<Row>;
@group(0) @binding(8) var<storage, read_write> x_next: array<Row>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    let rows = rows_at_a_time();
    for (var base = group.x * rows; base < params.count; base += groups.x * rows) {
        let row = base + lane % rows;
        let product = times_x(row, lane);
        if row < params.count && lane < rows {
            let place = params.first + row;
            var r = load_b(place);
            for (var i = 0u; i < ROWS; i++) {
                r[i] -= product[i];
            }
            smoothed(place, diagonal_times(place, r));
        }
    }
}
