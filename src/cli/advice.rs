//! Command-line remedies for errors of the library, which knows no command line.

use signorini::backend::BackendError;
#[cfg(feature = "gpu")]
use signorini::backend::gpu::GpuError;
use signorini::case::CaseError;
use signorini::dual::DualError;
use signorini::engine::EngineError;
use signorini::quasistatic::StepError;
use signorini::solve;
use signorini::ssnm::{Cause, SolveError};
use signorini::stiffness::pcg::PcgError;
use std::error::Error;

/// An error as the user reads it: the library's message, and a command-line remedy if one may help.
pub fn message_of(error: &(dyn Error + 'static)) -> String {
    match (error.downcast_ref(), advice(error)) {
        (Some(CaseError::Setting { setting, message }), _) => {
            format!("--set {setting}: {message}")
        }
        (_, Some(advice)) => format!("{error}; {advice}"),
        (_, None) => error.to_string(),
    }
}

/// For the first error known here, from the outermost inwards. A `transparent` error is not the source of the error
/// inside, so those are unwrapped by hand.
fn advice(error: &(dyn Error + 'static)) -> Option<&'static str> {
    if let Some(error) = error.downcast_ref() {
        match error {
            EngineError::NoCholeskyOnGpu => {
                Some("use --stiffness pcg (or auto) with --backend gpu")
            }
            EngineError::NoGpuSupport => Some("use --backend cpu"),
            #[cfg(feature = "gpu")]
            EngineError::Gpu(error) => advice(error),
            EngineError::Pcg(error) => advice(error),
            _ => None,
        }
    } else if let Some(error) = error.downcast_ref() {
        match error {
            solve::Error::Engine(error) => advice(error),
            solve::Error::Step(error) => advice(&**error),
            _ => None,
        }
    } else if let Some(StepError { error, .. }) = error.downcast_ref() {
        advice(error)
    } else if let Some(SolveError { cause, .. }) = error.downcast_ref() {
        match cause {
            Cause::Operator(DualError::Pcg(error)) => advice(error),
            _ => None,
        }
    } else if let Some(error) = error.downcast_ref() {
        match error {
            PcgError::Backend(error) => advice(error),
            PcgError::Stalled { .. } => Some("or use --stiffness cholesky"),
            _ => None,
        }
    } else if let Some(error) = error.downcast_ref() {
        match error {
            BackendError::TooLarge { .. } | BackendError::OutOfMemory { .. } => {
                Some("or use --backend cpu")
            }
            BackendError::DenseRow { .. } => Some("use --backend cpu"),
            _ => None,
        }
    } else {
        no_device(error).or_else(|| advice(error.source()?))
    }
}

#[cfg(feature = "gpu")]
fn no_device(error: &(dyn Error + 'static)) -> Option<&'static str> {
    match error.downcast_ref()? {
        // The list of adapters is advice enough.
        GpuError::NoAdapter(text) if text.contains('\n') => None,
        GpuError::NoAdapter(_) => Some("or use --backend cpu"),
        GpuError::Unsuitable { reason, .. } if reason.contains("f64") => {
            Some("use --precision auto or f32")
        }
        GpuError::Backend(error) => advice(error),
        _ => None,
    }
}

#[cfg(not(feature = "gpu"))]
fn no_device(_error: &(dyn Error + 'static)) -> Option<&'static str> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost_memory() -> BackendError {
        BackendError::OutOfMemory {
            adapter: "a GPU".to_owned(),
        }
    }

    #[test]
    fn errors_inside_errors_are_found() {
        let failed = |error: DualError| SolveError::from(Cause::from(error));
        let cpu = "; or use --backend cpu";
        let stalled = || PcgError::Stalled {
            reached: 1e-3,
            asked: 1e-8,
            iterations: 1000,
        };
        let cholesky = "; or use --stiffness cholesky";
        let inside = |error: BackendError| DualError::Pcg(PcgError::Backend(error));
        let errors: [(Box<dyn Error>, &str); 7] = [
            (Box::new(lost_memory()), cpu),
            (
                Box::new(EngineError::Pcg(PcgError::Backend(lost_memory()))),
                cpu,
            ),
            (Box::new(failed(inside(lost_memory()))), cpu),
            (
                Box::new(solve::Error::Engine(
                    PcgError::Backend(lost_memory()).into(),
                )),
                cpu,
            ),
            (Box::new(EngineError::Pcg(stalled())), cholesky),
            (Box::new(failed(DualError::Pcg(stalled()))), cholesky),
            (
                Box::new(EngineError::NoCholeskyOnGpu),
                "; use --stiffness pcg (or auto) with --backend gpu",
            ),
        ];
        for (error, end) in errors {
            let text = message_of(error.as_ref());
            assert_eq!(text, format!("{error}{end}"));
        }
    }

    #[test]
    fn errors_without_a_flag_are_reported_as_they_are() {
        let lost = BackendError::Lost {
            adapter: "a GPU".to_owned(),
            reason: "unplugged".to_owned(),
        };
        assert_eq!(message_of(&lost), lost.to_string());
        #[cfg(feature = "gpu")]
        {
            let list = GpuError::NoAdapter("no adapter is called \"x\"; there are:\n  0: y".into());
            assert_eq!(message_of(&list), list.to_string());
        }
        let setting = CaseError::Setting {
            setting: "solver.beta".to_owned(),
            message: "there is no =".to_owned(),
        };
        assert_eq!(message_of(&setting), "--set solver.beta: there is no =");
    }
}
