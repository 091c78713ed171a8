//! The memory of this machine.

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

#[cfg(test)]
mod tests {
    #[test]
    fn a_machine_has_memory() {
        assert!(super::total_bytes().is_none_or(|bytes| bytes > 1 << 28));
    }
}
