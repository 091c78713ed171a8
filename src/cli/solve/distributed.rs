//! `mpirun signorini solve`: the same on several ranks. Rank 0 reads, reports, and writes everything except the pieces of
//! the others.

use super::log::Log;
use super::{INTERRUPTED, READ, hear_interrupts, output_directory, summary};
use crate::cli::advice::message_of;
use crate::cli::{ERROR, NOT_CONVERGED, SolveArguments, Stiffness};
use signorini::case::{Case, CaseDraft};
use signorini::contact::Space;
use signorini::mesh::ElementKind;
use signorini::model::Draft;
use signorini::mpi::{AnyShare, Group, MpiError, Results, ResultsError, Share};
use signorini::output::withdraw;
use signorini::ssnm::Status;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Solves on all ranks; the exit code. Only rank 0 reports an error, the others have its code.
pub fn run(arguments: &SolveArguments, group: &Arc<Group>) -> Result<u8, String> {
    let is_root = group.rank() == 0;
    let start = Instant::now();
    hear_interrupts();
    if let Some(reason) = refused(arguments) {
        return told(is_root, reason);
    }
    let output = output_directory(arguments);
    let read = is_root.then(|| read(arguments, &output));
    let text = read
        .as_ref()
        .map(|read| read.as_ref().ok().map(|case| case.text().to_owned()));
    // The case is small, and every rank needs its settings.
    let Some(text) = group.broadcast(text) else {
        return read.map_or(Ok(ERROR), |read| read.map(|_| ERROR));
    };
    let case = match read {
        Some(case) => case?,
        None => Case::parse(&arguments.case, text, &[]).map_err(|e| message_of(&e))?,
    };
    let drafted = is_root.then(|| case.draft().map_err(|e| message_of(&e)));
    READ.store(true, Ordering::Relaxed);
    let kind = drafted.as_ref().map(|drafted| match drafted {
        Ok(CaseDraft::Plane(_)) => Kind::Plane,
        Ok(CaseDraft::Space(_)) => Kind::Space,
        Ok(CaseDraft::Algebraic(_)) => Kind::Algebraic,
        Err(_) => Kind::None,
    });
    let kind = group.broadcast(kind);
    let draft = drafted.transpose()?;
    let run = Run {
        start,
        case: &case,
        arguments,
        output: &output,
        log: Log::of_rank(arguments, is_root),
        group,
    };
    match (kind, draft) {
        (Kind::None, _) => Ok(ERROR),
        (Kind::Plane, Some(CaseDraft::Plane(draft))) => run.on_mesh(Some(draft)),
        (Kind::Space, Some(CaseDraft::Space(draft))) => run.on_mesh(Some(draft)),
        (Kind::Plane, _) => run.on_mesh::<2>(None),
        (Kind::Space, _) => run.on_mesh::<3>(None),
        (Kind::Algebraic, draft) => {
            let problem = draft.and_then(|draft| match draft {
                CaseDraft::Algebraic(problem) => Some(*problem),
                _ => None,
            });
            match AnyShare::of_problem(group, problem, &arguments.engine.options()) {
                Ok(AnyShare::Plane(share)) => run.make(*share),
                Ok(AnyShare::Space(share)) => run.make(*share),
                Err(error) => run.failed(error),
            }
        }
    }
}

/// The subject of a case.
#[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
enum Kind {
    None,
    Plane,
    Space,
    Algebraic,
}

/// An error of rank 0's, with its code on all.
fn told(is_root: bool, message: String) -> Result<u8, String> {
    match is_root {
        true => Err(message),
        false => Ok(ERROR),
    }
}

/// A request that several ranks cannot fulfil.
fn refused(arguments: &SolveArguments) -> Option<String> {
    if arguments.engine.stiffness == Stiffness::Cholesky {
        return Some(format!(
            "--stiffness cholesky: {}: leave it out, or start the program without mpirun",
            MpiError::NoFactor
        ));
    }
    arguments.plots.then(|| {
        "--plots: pictures are drawn in one process; several ranks write .pvtu files, which ParaView draws: leave it out"
            .to_owned()
    })
}

/// Reads the case and removes the status of the run before.
fn read(arguments: &SolveArguments, output: &Path) -> Result<Case, String> {
    let read =
        super::super::read_case(&arguments.case, &arguments.deck.ignore, &arguments.settings);
    let case = match read {
        Ok((case, _)) => case,
        Err(message) => {
            // Errors in the case come first, because the user has to fix them first.
            let _ = withdraw(output, std::slice::from_ref(&arguments.case));
            return Err(message);
        }
    };
    withdraw(output, &case.inputs()).map_err(|e| message_of(&e))?;
    Ok(case)
}

/// A run, of whichever dimension.
struct Run<'a> {
    start: Instant,
    case: &'a Case,
    arguments: &'a SolveArguments,
    output: &'a Path,
    log: Log,
    group: &'a Arc<Group>,
}

impl Run<'_> {
    fn is_root(&self) -> bool {
        self.group.rank() == 0
    }

    /// An error, after agreeing on it with the other ranks: an error of this rank alone ends all of them.
    fn failed(&self, error: MpiError) -> Result<u8, String> {
        let is_of_one_rank = error.is_of_one_rank();
        let message = match error {
            MpiError::Model(error) => message_of(&self.case.at_line(error)),
            error => format!("{}: {}", self.arguments.case.display(), message_of(&error)),
        };
        if is_of_one_rank {
            self.group.abort(&message, ERROR.into());
        }
        told(self.is_root(), message)
    }

    fn on_mesh<const D: usize>(&self, draft: Option<Draft<D>>) -> Result<u8, String>
    where
        ElementKind: Space<D>,
    {
        match Share::of_model(self.group, draft, &self.arguments.engine.options()) {
            Ok(share) => self.make(share),
            Err(error) => self.failed(error),
        }
    }

    /// Solves, writes and reports; the exit code.
    fn make<const D: usize>(&self, mut share: Share<D>) -> Result<u8, String>
    where
        ElementKind: Space<D>,
    {
        let log = self.log;
        self.introduce(&share);
        let title = &self.case.tables.title;
        let made = Results::new(self.output, title, &self.case.inputs(), &share);
        let mut results = match made {
            Ok(results) => results,
            Err(error) => return self.unwritten(error),
        };
        results.set_begin(self.start);
        let timings = &mut results.report.timings;
        timings.mesh = self.start.elapsed().as_secs_f64() - timings.assembly - timings.factor;
        let solved = self.steps(&mut share, &mut results);
        match &solved {
            Err(Ended::Solve(error)) if error.is_of_one_rank() => {}
            Err(Ended::Solve(error)) => results.report.fail(&message_of(error)),
            Err(Ended::Results(error)) => results.report.fail(&message_of(error)),
            Ok(()) => log.say(format_args!("{}", super::log::describe(&share.costs()))),
        }
        if let Err(Ended::Solve(error)) = solved {
            if !error.is_of_one_rank()
                && let Err(error) = results.finish()
            {
                return self.unwritten(error);
            }
            return self.failed(error);
        }
        results.add_share(&mut share);
        let files = match results.finish() {
            Ok(files) => files.to_vec(),
            Err(error) => return self.unwritten(error),
        };
        if let Err(Ended::Results(error)) = solved {
            return self.unwritten(error);
        }
        let status =
            self.group.broadcast(self.is_root().then(|| {
                u8::from(results.report.status != Some(Status::Converged)) * NOT_CONVERGED
            }));
        if self.is_root() && !self.arguments.quiet {
            crate::cli::print(&summary::text(&results.report, &files))?;
        }
        Ok(status)
    }

    /// The distribution of the work, and the operator for K⁻¹.
    fn introduce<const D: usize>(&self, share: &Share<D>)
    where
        ElementKind: Space<D>,
    {
        let (log, division) = (self.log, share.division());
        let (about, fallback) = share.about();
        log.tell(&format!(
            "{} ranks: n = {}, m = {}; the largest share is {:.3} times the mean",
            self.group.size(),
            share.system().n_free(),
            share.system().m(),
            division.of_unknowns()
        ));
        log.say(format_args!(
            "partition {:.3} s, distribution {:.3} s, assembly {:.3} s, set-up {:.3} s",
            division.partition, division.distribution, division.assembly, division.setup
        ));
        log.say(format_args!("{about}"));
        if let Some((adapter, precision)) = share.adapter() {
            log.say(format_args!("rank 0 on {adapter}, {precision}"));
        }
        if let Some(reason) = fallback {
            log.tell(&format!("{reason}: using block-Jacobi instead"));
        }
        for body in share.floating_bodies() {
            log.tell(&body);
        }
    }

    /// A file that could not be written.
    fn unwritten(&self, error: ResultsError) -> Result<u8, String> {
        match error {
            ResultsError::Petsc(error) => self.group.abort(&error.to_string(), ERROR.into()),
            // The rank with the error reports it.
            ResultsError::Elsewhere(_) => Ok(ERROR),
            error => Err(message_of(&error)),
        }
    }

    /// Makes the load steps, until one does not converge.
    fn steps<const D: usize>(
        &self,
        share: &mut Share<D>,
        results: &mut Results<D>,
    ) -> Result<(), Ended>
    where
        ElementKind: Space<D>,
    {
        let (log, n_steps) = (self.log, [share.n_steps(), 1]);
        let mut settings = self.case.settings();
        let limit = settings.ssnm.time_limit;
        settings.ssnm.time_limit = limit.map(|limit| limit.saturating_sub(self.start.elapsed()));
        let mut written = Ok(());
        let tolerance = settings.ssnm.tolerance;
        let observer = log.observer(n_steps, tolerance, &mut written, |solved| {
            results.add(solved)
        });
        (share.solve(&settings, Some(Arc::clone(&INTERRUPTED)), observer)).map_err(Ended::Solve)?;
        written.map_err(Ended::Results)
    }
}

/// The reason why a run has not come to its end.
enum Ended {
    Solve(MpiError),
    Results(ResultsError),
}
