//! The dispatches of products with matrices in blocks, and of smoothing steps.

use super::arrays::{Blocks, LevelDiagonal, State, Vector};
use super::buffers::Handle;
use super::kernels::{Kernel, Lanes, flag};
use super::{Gpu, Params};

impl Gpu {
    /// The dispatches of a product y = M x; `flags` select the further use of y.
    pub(super) fn product(
        &mut self,
        m: &Blocks,
        x: &Vector,
        b: &Vector,
        y: &Vector,
        flags: u32,
        [state, partials]: [&Handle; 2],
    ) {
        assert_eq!((x.len, y.len), (m.n_cols, m.n_rows));
        let mut first_partial = 0;
        for part in &m.parts {
            let flags = match part.adds {
                true => flags & !flag::BASE | flag::ADD,
                false => flags,
            };
            let params = Params {
                count: part.count,
                first: part.first,
                first_partial,
                columns: part.columns,
                lanes: part.lanes,
                flags,
                ..Params::default()
            };
            let there = if flags & (flag::BASE | flag::DOT) != 0 {
                assert_eq!(b.len, m.n_rows);
                &b.segments[part.row_segment]
            } else {
                &x.segments[part.column_segment]
            };
            let buffers = [
                state,
                &part.structure,
                &part.values,
                &x.segments[part.column_segment].data,
                &there.data,
                &y.segments[part.row_segment].data,
                partials,
            ];
            let kernel = Kernel::Multiply(m.scalar, m.shape, Lanes::of(part.lanes));
            self.dispatch(kernel, params, &buffers, part.groups, part.bytes);
            first_partial += part.groups;
        }
    }

    /// The dispatches of a smoothing step from a residual in `x_next`, or of the first one.
    #[allow(clippy::too_many_arguments, reason = "one fused pass over this data")]
    pub(super) fn smooth_by_diagonal(
        &mut self,
        state: &State,
        inverse_diagonal: &LevelDiagonal,
        params: Params,
        b: &Vector,
        x: &Vector,
        d: &Vector,
        x_next: &Vector,
    ) {
        for vector in [b, x, d, x_next] {
            assert_eq!(vector.len, inverse_diagonal.len);
        }
        for (s, inverse) in inverse_diagonal.segments.iter().enumerate() {
            let count = (b.segments[s].len() / inverse_diagonal.block) as u32;
            let buffers = [
                &state.next,
                inverse,
                &b.segments[s].data,
                &x.segments[s].data,
                &d.segments[s].data,
                &x_next.segments[s].data,
            ];
            let bytes = 4 * (inverse_diagonal.block as u64 + 4) * b.segments[s].len() as u64;
            self.dispatch(
                Kernel::Diagonal(inverse_diagonal.shape),
                Params { count, ..params },
                &buffers,
                self.groups(count, 1),
                bytes,
            );
        }
    }

    /// The dispatches of a smoothing step from the residual r where D⁻¹ is a matrix.
    pub(super) fn smooth_by_patches(
        &mut self,
        state: &State,
        patches: &Blocks,
        params: Params,
        r: &Vector,
        d: &Vector,
        x: &Vector,
    ) {
        for vector in [r, d, x] {
            assert_eq!(vector.len, patches.n_rows);
        }
        for part in &patches.parts {
            let params = Params {
                count: part.count,
                first: part.first,
                columns: part.columns,
                lanes: part.lanes,
                flags: params.flags | if part.adds { flag::ADD } else { 0 },
                ..params
            };
            let buffers = [
                &state.next,
                &part.structure,
                &part.values,
                &r.segments[part.column_segment].data,
                &d.segments[part.row_segment].data,
                &x.segments[part.row_segment].data,
            ];
            let kernel = Kernel::Patches(patches.shape, Lanes::of(part.lanes));
            self.dispatch(kernel, params, &buffers, part.groups, part.bytes);
        }
    }
}
