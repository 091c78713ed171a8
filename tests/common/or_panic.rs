//! What has to be there.

use std::fmt::Display;

/// The value of a result that has to be one; where it is not, the words of its error, and where it was asked for.
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
