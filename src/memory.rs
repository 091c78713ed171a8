//! The memory of this machine and of this process.

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator, with large pages for large data where Linux offers them on request. The first touch of a page is a fault:
/// without large ones, a quarter of the time for assembly and hierarchy at 6e5 unknowns goes there.
///
/// A program sets it with `#[global_allocator]`.
#[derive(Clone, Copy, Debug, Default)]
pub struct LargePages;

/// Bytes from which on data get large pages: enough that the unused part of the last one does not matter.
const LARGE: usize = 8 << 20;

// SAFETY: all memory is that of the system's allocator; the advice changes no contents.
unsafe impl GlobalAlloc for LargePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps to the contract, which is the same.
        advised(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        advised(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, data: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        advised(unsafe { System.realloc(data, layout, size) }, size)
    }

    unsafe fn dealloc(&self, data: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(data, layout) }
    }
}

/// The same data, in large pages if they are large.
fn advised(data: *mut u8, size: usize) -> *mut u8 {
    if size >= LARGE && !data.is_null() {
        #[cfg(target_os = "linux")]
        {
            const PAGE: usize = 4096;
            let before = data.align_offset(PAGE);
            // SAFETY: the range is whole pages of these data. Where the system refuses, they stay as they are.
            unsafe {
                let start = data.add(before).cast();
                libc::madvise(start, (size - before) / PAGE * PAGE, libc::MADV_HUGEPAGE);
            }
        }
    }
    data
}

/// The memory of this machine in bytes, or of the container it runs in; None if unknown.
pub(crate) fn total_bytes() -> Option<usize> {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    let total = match system.cgroup_limits() {
        Some(limits) if limits.total_memory > 0 => limits.total_memory.min(system.total_memory()),
        _ => system.total_memory(),
    };
    usize::try_from(total).ok().filter(|&bytes| bytes > 0)
}

/// The largest resident size of this process so far, in MiB, where the system reports it.
#[cfg(any(feature = "files", feature = "mpi"))]
pub fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Restarts the count of [`peak_memory_mib`] from the memory in use now; false if the system cannot.
#[cfg(feature = "files")]
pub fn forget_peak_memory() -> bool {
    // 5 resets the peak of the resident size: proc_pid_clear_refs(5).
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_machine_has_memory() {
        assert!(super::total_bytes().is_none_or(|bytes| bytes > 1 << 28));
    }
}
