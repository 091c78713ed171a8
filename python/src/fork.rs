//! Processes that are forks of the one that has loaded the package: threads do not survive that, nor does a GPU.

use rayon::ThreadPool;
use std::process;
use std::sync::OnceLock;

/// The process that has loaded the package.
static LOADED: OnceLock<u32> = OnceLock::new();

/// The threads of forks. (No lock is around them: one that a thread has held at the fork would never be free.)
static THREADS: OnceLock<Threads> = OnceLock::new();

/// The remedy where a fork cannot be used.
pub const REMEDY: &str =
    "start processes with multiprocessing.set_start_method(\"spawn\") or \"forkserver\"";

/// The threads of a fork. In a fork of that fork they are only memory.
struct Threads {
    of: u32,
    pool: ThreadPool,
    later: OnceLock<Box<Threads>>,
}

impl Threads {
    fn new() -> Self {
        let pool = rayon::ThreadPoolBuilder::new().build();
        Self {
            of: process::id(),
            pool: pool.expect("threads can be started"),
            later: OnceLock::new(),
        }
    }
}

/// Notes which process has loaded the package.
pub fn loaded() {
    LOADED.get_or_init(process::id);
}

/// Whether this process is a fork of that one.
pub fn is_fork() -> bool {
    LOADED.get().is_some_and(|&pid| pid != process::id())
}

/// Runs work on threads that exist: in a fork on separate ones, because those of rayon's global pool are missing there.
pub fn with_threads<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if !is_fork() {
        return work();
    }
    let mut threads = THREADS.get_or_init(Threads::new);
    while threads.of != process::id() {
        threads = threads.later.get_or_init(|| Box::new(Threads::new()));
    }
    threads.pool.install(work)
}
