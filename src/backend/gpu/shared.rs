//! CG on several ranks, each with a device of its own.
//!
//! Every sum over unknowns passes through the host, which adds up those of all ranks, follows the run as the CPU does
//! ([`crate::backend::cpu::State`]) and writes the scalars back. They, and with them all decisions, are the same on all
//! ranks, whatever the devices are.

use super::arrays::{Beyond, Matrix, Rows, State, Vector};
use super::buffers::{Handle, read_reals};
use super::kernels::{Kernel, flag};
use super::queue::Wanted;
use super::{Gpu, Params, flag_if};
use crate::backend::{Backend as _, BackendError, Run, cpu};
use crate::ranks::Halo;
use crate::sparse::Csr;

impl State {
    /// The partial sums that a kernel has to add up, where a device by itself has this many.
    pub(super) fn sums(&self, alone: u32) -> u32 {
        match self.shared {
            Some(_) => 1,
            None => alone,
        }
    }
}

impl Gpu {
    /// The interface of vectors with this halo, whose rows have `width` entries.
    pub(super) fn beyond(&mut self, halo: &Halo, width: usize) -> Result<Beyond, BackendError> {
        let (rows, interface) = halo.interface();
        let entries = (rows.iter().enumerate()).flat_map(|(i, &row)| {
            (0..width).map(move |c| (width * i + c, width * row as usize + c, 1.0))
        });
        let own = width * halo.own();
        let picks = Csr::from_triplets(width * rows.len(), own, entries);
        let like = self.vector(own)?;
        let there = self.vector(width * rows.len())?;
        Ok(Beyond {
            picks: self.rows(&picks, &like, &there)?,
            interface: there,
            copies: self.vector(width * halo.copies())?,
            halo: interface,
            width,
        })
    }

    /// The dispatches of a product with the rows of a matrix that have entries.
    pub(super) fn rows_product(&mut self, m: &Rows, x: &Vector, y: &Vector) {
        assert_eq!((x.len, y.len), (m.n_cols, m.n_rows));
        for part in &m.parts {
            let params = Params {
                count: part.count,
                flags: flag_if(part.adds, flag::ADD),
                ..Params::default()
            };
            let buffers = [
                &part.starts,
                &part.targets,
                &part.columns,
                &part.values,
                &x.segments[part.from].data,
                &y.segments[part.to].data,
            ];
            let groups = self.groups(part.count, m.parts.len());
            self.dispatch(Kernel::Rows, params, &buffers, groups, part.bytes);
        }
    }

    /// The dispatches of a product y = K x, after an exchange with other ranks if there are any.
    pub(super) fn product_with_copies(
        &mut self,
        k: &Matrix,
        x: &Vector,
        y: &Vector,
        flags: u32,
        handles: [&Handle; 2],
    ) {
        let Some(beyond) = &k.beyond else {
            return self.product(&k.blocks, x, x, y, flags, handles);
        };
        self.rows_product(&beyond.picks, x, &beyond.interface);
        let own = beyond.interface.len;
        let mut values = vec![0.0; own + beyond.copies.len];
        if let Err(error) = self.download(&beyond.interface, &mut values[..own]) {
            self.fails(error, &mut values);
        }
        beyond.halo.update(beyond.width, &mut values);
        self.write_reals(&values[own..], &beyond.copies);
        let segments = [&x.segments[..], &beyond.copies.segments].concat();
        let extended = Vector {
            len: x.len + beyond.copies.len,
            segments,
        };
        self.product(&k.blocks, &extended, x, y, flags, handles);
    }

    /// Keeps an error until the next look at the progress. The other ranks wait for this one: it has to go on, with numbers that
    /// end the run on all of them.
    fn fails(&mut self, error: BackendError, values: &mut [f64]) {
        self.failure.get_or_insert(error);
        values.fill(f64::NAN);
    }

    /// Adds up partial sums on the device over all ranks; the first one then is the sum.
    fn summed(&mut self, state: &State, first: u32, count: u32) -> [f64; 2] {
        let (real, precision) = (self.real_bytes(), self.context.precision);
        let mut partials = vec![0.0; 2 * count as usize];
        let offset = 2 * u64::from(first) * real;
        let wanted = Wanted {
            from: &state.partials,
            offset,
            bytes: 2 * u64::from(count) * real,
        };
        let read = self.read(&[wanted], |bytes| {
            read_reals(precision, bytes, &mut partials);
        });
        if let Err(error) = read {
            self.fails(error, &mut partials);
        }
        let mut sums = [0, 1].map(|c| partials.iter().skip(c).step_by(2).sum());
        self.ranks.sum(&mut sums);
        let bytes = self.real_array(&sums);
        (self.context.queue).write_buffer(&state.partials.buffer.buffer, offset, &bytes);
        sums
    }

    /// Writes the scalars of a run to a copy of the device.
    fn tell(&mut self, shared: &cpu::State, to: &Handle) {
        let (reals, words) = shared.members();
        let mut bytes = self.real_array(&reals);
        bytes.extend_from_slice(bytemuck::cast_slice(&words));
        // Writes take effect before all commands of the next submission.
        self.submit(None);
        self.context
            .queue
            .write_buffer(&to.buffer.buffer, 0, &bytes);
    }

    /// The run has begun, on several ranks.
    pub(super) fn started(&mut self, state: &mut State, run: Run) {
        let [_, rr] = self.summed(state, state.n_curvature, state.n_vector);
        let shared = cpu::State::started(rr, run);
        self.tell(&shared, &state.current);
        self.tell(&shared, &state.next);
        state.shared = Some(shared);
    }

    /// The next direction has pᵀKp, on several ranks if there are any.
    pub(super) fn curves(&mut self, state: &mut State) {
        if let Some(mut shared) = state.shared {
            let [curvature, _] = self.summed(state, 0, state.n_curvature);
            shared.curves(curvature);
            state.shared = Some(shared);
        }
    }

    /// Whether there is a step to make: on several ranks that is known.
    pub(super) fn steps(&mut self, state: &mut State) -> bool {
        let Some(shared) = &mut state.shared else {
            return true;
        };
        if shared.is_done() {
            return false;
        }
        let steps = shared.step().is_some();
        if !steps {
            let shared = *shared;
            self.tell(&shared, &state.next);
        }
        steps
    }

    /// A step has been made, on several ranks.
    pub(super) fn stepped(&mut self, state: &mut State) {
        let [_, rr] = self.summed(state, state.n_curvature, state.n_vector);
        if let Some(mut shared) = state.shared {
            shared.stepped(rr);
            self.tell(&shared, &state.next);
            state.shared = Some(shared);
        }
    }

    /// The residual has rᵀz, on several ranks if there are any.
    pub(super) fn turned(&mut self, state: &mut State) {
        if let Some(mut shared) = state.shared {
            let [rz, _] = self.summed(state, state.n_curvature, state.n_vector);
            shared.turned(rz);
            state.shared = Some(shared);
        }
    }
}
