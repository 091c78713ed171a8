//! The resources that a run has used.

/// The largest resident size of this process so far, in MiB, where the system reports it.
pub fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Restarts the count of [`peak_memory_mib`] from the memory in use now; false if the system cannot.
pub fn forget_peak_memory() -> bool {
    // 5 resets the peak of the resident size: proc_pid_clear_refs(5).
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}
