//! A running solve: it works on a separate thread, while the thread that Python called from receives its events and signals.

use crate::errors::of_panic;
use crate::fork::with_threads;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

/// The longest delay of a signal while a solve sends no events: shorter ones go unnoticed.
const PATIENCE: Duration = Duration::from_millis(50);

/// The events of a solve.
pub enum News {
    /// A line for the log.
    Line(String),
    /// A load step begins: its number, how many there are, its factor.
    Begins(usize, usize, f64),
    /// An outer step has been made, as JSON and in words; the answer tells whether to continue.
    Step(String, String, mpsc::Sender<bool>),
    /// A load step has ended: its number, how.
    Ends(usize, String),
}

/// Who hears the lines of an engine, which outlives a solve.
pub type Ear = Arc<Mutex<Option<mpsc::Sender<News>>>>;

/// The sender of the working thread.
#[derive(Clone)]
pub struct Voice(Option<mpsc::Sender<News>>);

impl Voice {
    /// Whether anybody hears.
    pub fn is_heard(&self) -> bool {
        self.0.is_some()
    }

    /// Sends an event and continues.
    pub fn tell(&self, news: News) {
        if let Some(to) = &self.0 {
            // A receiver that is gone hears nothing.
            let _ = to.send(news);
        }
    }

    /// Sends a step and waits for the answer.
    pub fn ask(&self, step: String, words: String) -> bool {
        let (answer, answered) = mpsc::channel();
        self.tell(News::Step(step, words, answer));
        answered.recv().unwrap_or(true)
    }

    /// The other end for an engine.
    pub fn sender(&self) -> Option<mpsc::Sender<News>> {
        self.0.clone()
    }
}

/// Hands news to Python; whether to go on.
fn hear(hears: &Bound<PyAny>, news: News) -> PyResult<()> {
    match news {
        News::Line(line) => hears.call_method1("line", (line,)).map(drop),
        News::Begins(number, of, factor) => {
            hears.call_method1("begins", (number, of, factor)).map(drop)
        }
        News::Ends(number, status) => hears.call_method1("ends", (number, status)).map(drop),
        News::Step(step, words, answer) => {
            let asked = hears.call_method1("step", (step, words));
            let goes_on = asked.as_ref().map_or(Ok(false), |flow| flow.is_truthy());
            let _ = answer.send(*goes_on.as_ref().unwrap_or(&false));
            asked.and(goes_on.map(drop))
        }
    }
}

/// Works without the interpreter's lock and handles events meanwhile: a signal, or an exception of the observer, sets
/// `interrupt`, and is returned with the result of the work.
///
/// # Errors
/// If the work has panicked.
pub fn watched<T: Send>(
    py: Python<'_>,
    hears: Option<&Bound<PyAny>>,
    interrupt: &AtomicBool,
    work: impl FnOnce(Voice) -> T + Send,
) -> PyResult<(T, Option<PyErr>)> {
    let (to, mut from) = mpsc::channel();
    let mut stopped: Option<PyErr> = None;
    std::thread::scope(|scope| {
        let voice = Voice(hears.is_some().then(|| to.clone()));
        let worker = scope.spawn(move || {
            // Dropping it at the end marks the end.
            let _to = to;
            with_threads(move || work(voice))
        });
        loop {
            let news;
            (news, from) = py.detach(move || (from.recv_timeout(PATIENCE), from));
            let heard = match (news, hears) {
                (Err(mpsc::RecvTimeoutError::Disconnected), _) => break,
                (Ok(news), Some(hears)) => hear(hears, news),
                _ => Ok(()),
            };
            if let Err(error) = heard.and_then(|()| py.check_signals()) {
                interrupt.store(true, Ordering::Relaxed);
                stopped.get_or_insert(error);
            }
        }
        match worker.join() {
            Ok(made) => Ok((made, stopped)),
            Err(panic) => Err(of_panic(panic.as_ref())),
        }
    })
}
