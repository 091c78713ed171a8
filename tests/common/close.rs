//! Numbers compared.

/// Each number differs from the expected one by at most `tolerance`.
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
