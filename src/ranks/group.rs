//! A group of ranks: an MPI communicator with its operations.

use bytemuck::{Pod, cast_slice, cast_slice_mut};
use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::request::multiple_scope;
use mpi::topology::SimpleCommunicator;
use mpi::traits::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::sync_channel;
use std::time::Instant;

/// Bytes of a message at most: MPI counts in 32 bits.
const MESSAGE: usize = 1 << 30;

/// Ranks that work on one problem together.
pub struct Group {
    world: SimpleCommunicator,
    /// Nanoseconds spent in collective operations, including waiting, and their number.
    nanoseconds: AtomicU64,
    calls: AtomicU64,
}

// SAFETY: a communicator is a handle that any thread may use. MPI was initialised for calls from several threads, one
// at a time (`MPI_THREAD_SERIALIZED`). Ranks make their collective calls in one order, so that there is never more than
// one under way.
unsafe impl Send for Group {}
// SAFETY: as above.
unsafe impl Sync for Group {}

impl fmt::Debug for Group {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "rank {} of {}", self.rank(), self.size())
    }
}

impl Group {
    /// The ranks of a communicator, which is duplicated, so that messages here never mix with others. Collective.
    pub fn of(communicator: &impl Communicator) -> Self {
        Self {
            world: communicator.duplicate(),
            nanoseconds: AtomicU64::new(0),
            calls: AtomicU64::new(0),
        }
    }

    /// The number of this rank.
    pub fn rank(&self) -> usize {
        self.world.rank() as usize
    }

    /// The number of ranks.
    pub fn size(&self) -> usize {
        self.world.size() as usize
    }

    /// The number of this rank among those of its machine. Collective.
    #[cfg(feature = "gpu")]
    pub(crate) fn turn(&self) -> usize {
        self.world.split_shared(self.world.rank()).rank() as usize
    }

    /// The communicator.
    pub(crate) fn communicator(&self) -> &SimpleCommunicator {
        &self.world
    }

    /// Seconds spent in collective operations, including waiting, and their number.
    pub fn spent(&self) -> (f64, u64) {
        let nanoseconds = self.nanoseconds.load(Ordering::Relaxed);
        (
            nanoseconds as f64 * 1e-9,
            self.calls.load(Ordering::Relaxed),
        )
    }

    fn timed<T>(&self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let made = work();
        let taken = start.elapsed().as_nanos() as u64;
        self.nanoseconds.fetch_add(taken, Ordering::Relaxed);
        self.calls.fetch_add(1, Ordering::Relaxed);
        made
    }

    /// Combines entry by entry on rank 0, and sends the result to all.
    fn combine(&self, values: &mut [f64], how: SystemOperation) {
        if self.size() == 1 || values.is_empty() {
            return;
        }
        self.timed(|| {
            let root = self.world.process_at_rank(0);
            if self.rank() == 0 {
                let own = values.to_vec();
                root.reduce_into_root(&own[..], values, how);
            } else {
                root.reduce_into(&*values, how);
            }
            root.broadcast_into(values);
        });
    }

    /// Adds up entry by entry.
    pub(crate) fn sum(&self, values: &mut [f64]) {
        self.combine(values, SystemOperation::sum());
    }

    /// The largest value; NaN if there is one.
    pub(crate) fn max(&self, value: f64) -> f64 {
        // MPI does not define the result for NaN.
        let mut both = [value, f64::from(u8::from(value.is_nan()))];
        if value.is_nan() {
            both[0] = f64::NEG_INFINITY;
        }
        self.combine(&mut both, SystemOperation::max());
        if both[1] > 0.0 { f64::NAN } else { both[0] }
    }

    /// The numbers of all ranks, one rank after the other.
    pub(crate) fn joined(&self, values: &[f64]) -> Vec<f64> {
        let (all, _) = self.gathered(values);
        all
    }

    /// The same, with how many each has.
    pub(crate) fn gathered(&self, values: &[f64]) -> (Vec<f64>, Vec<usize>) {
        self.timed(|| {
            let mut counts = vec![0i32; self.size()];
            let own = i32::try_from(values.len()).expect("short lists only");
            self.world.all_gather_into(&own, &mut counts[..]);
            let starts: Vec<i32> = (counts.iter())
                .scan(0, |next, &count| {
                    let start = *next;
                    *next += count;
                    Some(start)
                })
                .collect();
            let mut all = vec![0.0; counts.iter().map(|&count| count as usize).sum()];
            let mut parts = PartitionMut::new(&mut all[..], &counts[..], &starts[..]);
            self.world.all_gather_varcount_into(values, &mut parts);
            (all, counts.iter().map(|&count| count as usize).collect())
        })
    }

    /// The count of each rank.
    pub(crate) fn counts(&self, here: usize) -> Vec<usize> {
        let all = self.joined(&[here as f64]);
        all.into_iter().map(|count| count as usize).collect()
    }

    /// Sends each rank its list, and returns those that the ranks have sent to this one.
    pub(crate) fn lists(&self, to: &[Vec<u64>]) -> Vec<Vec<u64>> {
        let counts: Vec<u64> = to.iter().map(|list| list.len() as u64).collect();
        let mut others = vec![0u64; self.size()];
        self.world.all_to_all_into(&counts[..], &mut others[..]);
        let mut from: Vec<Vec<u64>> = others.iter().map(|&n| vec![0; n as usize]).collect();
        let all: Vec<usize> = (0..self.size()).collect();
        self.swap(&all, to, &mut from);
        from
    }

    /// Sends values to ranks and receives others from them: `from` has the right lengths.
    pub(crate) fn swap<T: Pod>(&self, with: &[usize], to: &[Vec<T>], from: &mut [Vec<T>]) {
        multiple_scope(2 * with.len(), |scope, requests| {
            for (&rank, values) in with.iter().zip(from) {
                let other = self.world.process_at_rank(rank as i32);
                for part in cast_slice_mut::<T, u8>(values).chunks_mut(MESSAGE) {
                    requests.add(other.immediate_receive_into(scope, part));
                }
            }
            for (&rank, values) in with.iter().zip(to) {
                let other = self.world.process_at_rank(rank as i32);
                for part in cast_slice::<T, u8>(values).chunks(MESSAGE) {
                    requests.add(other.immediate_send(scope, part));
                }
            }
            requests.wait_all(&mut Vec::new());
        });
    }

    /// Waits for all ranks.
    pub fn wait(&self) {
        self.world.barrier();
    }

    /// Whether this is true on any rank.
    pub fn any(&self, here: bool) -> bool {
        self.max(f64::from(u8::from(here))) > 0.0
    }

    /// Sends the value of rank 0 to all.
    pub fn broadcast<T: Serialize + DeserializeOwned>(&self, value: Option<T>) -> T {
        let root = self.world.process_at_rank(0);
        let mut bytes = match &value {
            Some(value) if self.rank() == 0 => packed(value),
            _ => Vec::new(),
        };
        let mut length = bytes.len() as u64;
        root.broadcast_into(&mut length);
        bytes.resize(length as usize, 0);
        for part in bytes.chunks_mut(MESSAGE) {
            root.broadcast_into(part);
        }
        match value {
            Some(value) if self.rank() == 0 => value,
            _ => unpacked(&bytes),
        }
    }

    /// Sends something to another rank, which has to [`Group::receive`] it.
    pub(crate) fn send<T: Serialize>(&self, to: usize, value: &T) {
        self.send_packed(to, &packed(value));
    }

    /// Sends something to each of the other ranks, and makes the next one meanwhile.
    pub(crate) fn send_each<T: Serialize>(&self, make: impl Fn(usize) -> T + Sync) {
        let (sender, receiver) = sync_channel(0);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let sender = sender;
                // The receiver is gone only if this thread's parent panics.
                (1..self.size()).all(|rank| sender.send(packed(&make(rank))).is_ok())
            });
            for (bytes, rank) in receiver.iter().zip(1..) {
                self.send_packed(rank, &bytes);
            }
        });
    }

    fn send_packed(&self, to: usize, bytes: &[u8]) {
        let to = self.world.process_at_rank(to as i32);
        to.send(&(bytes.len() as u64));
        bytes.chunks(MESSAGE).for_each(|part| to.send(part));
    }

    /// Receives a message of another rank.
    pub(crate) fn receive<T: DeserializeOwned>(&self, from: usize) -> T {
        let from = self.world.process_at_rank(from as i32);
        let (length, _) = from.receive::<u64>();
        let mut bytes = vec![0u8; length as usize];
        for part in bytes.chunks_mut(MESSAGE) {
            from.receive_into(part);
        }
        unpacked(&bytes)
    }
}

fn packed<T: Serialize>(value: &T) -> Vec<u8> {
    postcard::to_stdvec(value).expect("plain data can be written")
}

fn unpacked<T: DeserializeOwned>(bytes: &[u8]) -> T {
    postcard::from_bytes(bytes).expect("it was written by the same program")
}
