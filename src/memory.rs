//! The memory of this machine and of this process.

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
