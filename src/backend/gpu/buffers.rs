//! Buffers on the device, and their contents.

use super::arrays::Vector;
use super::context::{Buffer, Context};
use super::{Gpu, PIECE_BYTES};
use crate::backend::{BackendError, Precision};
use std::sync::{Arc, Mutex};
use wgpu::BufferUsages;

/// A buffer on the device, with its own number as the key of its bind groups.
pub(super) struct Allocation {
    pub id: u64,
    pub buffer: Buffer,
    pub context: Arc<Context>,
    /// Numbers of dropped buffers, whose bind groups are dropped too.
    pub gone: Arc<Mutex<Vec<u64>>>,
}

impl Drop for Allocation {
    fn drop(&mut self) {
        self.context.released(self.buffer.size);
        // Nothing that holds the lock can panic.
        if let Ok(mut gone) = self.gone.lock() {
            gone.push(self.id);
        }
    }
}

pub(super) type Handle = Arc<Allocation>;

impl Gpu {
    /// Bytes of a real number of the kernels.
    pub(super) fn real_bytes(&self) -> u64 {
        self.context.precision.bytes() as u64
    }

    /// A zeroed buffer.
    pub(super) fn allocate(
        &mut self,
        label: &'static str,
        bytes: u64,
        usage: BufferUsages,
    ) -> Result<Handle, BackendError> {
        let buffer = self.context.buffer(label, bytes, usage)?;
        self.next_id += 1;
        Ok(Arc::new(Allocation {
            id: self.next_id,
            buffer,
            context: Arc::clone(&self.context),
            gone: Arc::clone(&self.gone),
        }))
    }

    /// A buffer with contents.
    pub(super) fn upload_bytes(
        &mut self,
        label: &'static str,
        bytes: &[u8],
    ) -> Result<Handle, BackendError> {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let handle = self.allocate(label, bytes.len() as u64, usage)?;
        // The contents are copied into staging memory first, which each submission gives back.
        for (i, piece) in bytes.chunks(PIECE_BYTES as usize).enumerate() {
            let queue = &self.context.queue;
            queue.write_buffer(&handle.buffer.buffer, i as u64 * PIECE_BYTES, piece);
            if bytes.len() as u64 > PIECE_BYTES {
                queue.submit([]);
                // The poll only frees memory here; a fault shows in the check.
                let _ = self.context.wait();
            }
        }
        self.context.check()?;
        Ok(handle)
    }

    /// Copies numbers to the beginning of a vector.
    pub(super) fn write_reals(&mut self, from: &[f64], to: &Vector) {
        assert!(from.len() <= to.len);
        // Writes take effect before all commands of the next submission.
        self.submit(None);
        for segment in &to.segments {
            let last = segment.range.end.min(from.len());
            let Some(from) = from.get(segment.range.start..last) else {
                break;
            };
            let bytes = self.real_array(from);
            self.context
                .queue
                .write_buffer(&segment.data.buffer.buffer, 0, &bytes);
        }
    }

    /// Real numbers in the precision of the kernels.
    pub(super) fn real_array(&self, values: &[f64]) -> Vec<u8> {
        match self.context.precision {
            Precision::F64 => bytemuck::cast_slice(values).to_vec(),
            Precision::F32 => values
                .iter()
                .flat_map(|&v| (v as f32).to_ne_bytes())
                .collect(),
        }
    }
}

/// Real numbers of the device.
pub(super) fn read_reals(precision: Precision, bytes: &[u8], out: &mut [f64]) {
    match precision {
        Precision::F64 => {
            for (out, bytes) in out.iter_mut().zip(bytes.chunks_exact(8)) {
                *out = f64::from_ne_bytes(bytes.try_into().expect("chunks of eight"));
            }
        }
        Precision::F32 => {
            for (out, bytes) in out.iter_mut().zip(bytes.chunks_exact(4)) {
                *out = f32::from_ne_bytes(bytes.try_into().expect("chunks of four")).into();
            }
        }
    }
}
