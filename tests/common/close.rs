//! Numbers compared.

/// Each number is as far as that from what is expected at most.
#[track_caller]
pub fn close(values: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(values.len(), expected.len());
    for (value, expected) in values.iter().zip(expected) {
        assert!(
            (value - expected).abs() <= tolerance,
            "{value:e}, not {expected:e}"
        );
    }
}
