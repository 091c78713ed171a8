//! Values that must exist.

use std::fmt::Display;

/// The value of a result; without one, a panic with its error and the place of the call.
pub trait OrPanic {
    type Value;

    fn or_panic(self) -> Self::Value;
}

impl<T, E: Display> OrPanic for Result<T, E> {
    type Value = T;

    #[track_caller]
    fn or_panic(self) -> T {
        match self {
            Ok(value) => value,
            Err(error) => panic!("{error}"),
        }
    }
}
