//! The values of loads and supports at the end of each load step.

use super::said::{Amplitude, Said};
use std::collections::HashMap;
use std::hash::Hash;

/// Ends of load steps: the step of the deck, from 0, and the time since its beginning.
pub(super) struct Times<'a> {
    said: &'a Said<'a>,
    pub ends: Vec<(usize, f64)>,
}

impl<'a> Times<'a> {
    /// The ends of the steps, and the corners of the amplitudes that are used in them.
    pub fn new(said: &'a Said<'a>) -> Self {
        let mut ends = Vec::new();
        let mut before = 0.0;
        for (number, step) in said.steps.iter().enumerate() {
            // Amplitudes in total time go on in later steps.
            let used = (said.loads.iter())
                .filter_map(|load| Some((load.step.unwrap_or(0), load.amplitude?)))
                .filter(|&(of, amplitude)| {
                    of == number || of < number && said.amplitudes[amplitude].total
                })
                .map(|(_, amplitude)| amplitude);
            let mut times = vec![step.period];
            for amplitude in used.map(|number| &said.amplitudes[number]) {
                let shift = if amplitude.total { before } else { 0.0 };
                let corners = amplitude.points.iter().map(|point| point[0] - shift);
                times.extend(corners.filter(|&t| t > 1e-9 * step.period && t < step.period));
            }
            times.sort_by(f64::total_cmp);
            times.dedup_by(|a, b| *a - *b <= 1e-9 * step.period);
            ends.extend(times.into_iter().map(|time| (number, time)));
            before += step.period;
        }
        Self { said, ends }
    }

    /// The time of the beginning of a step.
    fn begin(&self, step: usize) -> f64 {
        self.said.steps[..step].iter().map(|step| step.period).sum()
    }
}

/// An entry of a deck in one of its steps.
#[derive(Clone, Copy)]
struct Setting {
    by: Stated,
    to: To,
    /// It adds to what other entries of its step state.
    adds: bool,
}

/// The new setting of an entry.
#[derive(Clone, Copy, PartialEq)]
enum To {
    Value(f64),
    /// It keeps its value from the beginning of the step.
    Fixed,
    /// It is removed.
    Nothing,
}

/// Where an entry is, and its amplitude.
#[derive(Clone, Copy)]
pub(super) struct Stated {
    pub step: usize,
    pub line: usize,
    pub amplitude: Option<usize>,
}

/// Something that has a value, with the first line about it.
pub(super) struct Track {
    pub line: usize,
    /// The set that it was named by; empty of a number.
    pub origin: String,
    settings: Vec<Setting>,
}

impl Track {
    /// The line of the deck that adds or removes it after the beginning.
    pub fn changes(&self) -> Option<usize> {
        let late = self.settings.first().filter(|first| first.by.step > 0);
        let changes = |setting: &&Setting| !matches!(setting.to, To::Value(_));
        let changed = || self.settings.iter().find(changes);
        late.or_else(changed).map(|setting| setting.by.line)
    }

    /// For each load step 1 where it is there, and 1 where it is fixed; None where that is the same in all of them.
    pub fn switches(&self, times: &Times) -> [Option<Vec<f64>>; 2] {
        let state = |step: usize| {
            let last = self
                .settings
                .iter()
                .rfind(|setting| setting.by.step <= step);
            last.map_or(To::Nothing, |setting| setting.to)
        };
        let list = |is: &dyn Fn(usize) -> bool| -> Vec<f64> {
            let steps = times.ends.iter().map(|end| end.0);
            steps.map(|step| f64::from(u8::from(is(step)))).collect()
        };
        let there = list(&|step| state(step) != To::Nothing);
        let fixed = list(&|step| state(step) == To::Fixed);
        [
            Some(there).filter(|list| list.contains(&0.0)),
            Some(fixed).filter(|list| list.contains(&1.0)),
        ]
    }

    /// Whether it has a value in a step that an earlier one has stated.
    pub fn lasts(&self, step: usize) -> bool {
        let last = self
            .settings
            .iter()
            .rfind(|setting| setting.by.step <= step);
        last.is_some_and(|last| {
            let is_something = |one: &Setting| one.to != To::Value(0.0);
            let goes_on = last.by.step < step && last.to != To::Nothing;
            goes_on && self.together(last).any(is_something)
        })
    }

    /// The settings that count with the last one of a step.
    fn together<'s>(&'s self, last: &'s Setting) -> impl Iterator<Item = &'s Setting> {
        self.settings.iter().filter(|one| match last.adds {
            true => one.by.step == last.by.step,
            false => std::ptr::eq(*one, last),
        })
    }

    /// The line of the deck that takes it in a straight way, in a step with corners, from where it is: which the deck does not say if the
    /// step before has left it free, or has fixed it.
    pub fn starts_anywhere(&self, times: &Times) -> Option<usize> {
        let starts = |(number, last): (usize, &Setting)| {
            let step = last.by.step;
            let next = self.settings.get(number + 1);
            let counts = next.is_none_or(|next| next.by.step > step);
            let is_straight = matches!(last.to, To::Value(_)) && last.by.amplitude.is_none();
            let corners = times.ends.iter().filter(|end| end.0 == step).count() > 1;
            let mut before = self.settings[..number].iter();
            let before = before.rfind(|before| before.by.step < step);
            let is_free = before.is_none_or(|before| !matches!(before.to, To::Value(_)));
            let starts = step > 0 && counts && is_straight && corners && is_free;
            (starts && !times.said.steps[step].at_once).then_some(last.by.line)
        };
        self.settings.iter().enumerate().find_map(starts)
    }

    /// The change since the beginning of a step that does not state it, of amplitudes in total time.
    fn goes_on(&self, times: &Times, step: usize, time: f64) -> f64 {
        let mut earlier = self
            .settings
            .iter()
            .filter(|setting| setting.by.step < step);
        let Some(last) = earlier.next_back() else {
            return 0.0;
        };
        let begin = times.begin(step);
        let change = |setting: &Setting| match (setting.to, setting.by.amplitude) {
            (To::Value(value), Some(number)) if times.said.amplitudes[number].total => {
                let amplitude = &times.said.amplitudes[number];
                value * (amplitude.at(begin + time) - amplitude.at(begin))
            }
            _ => 0.0,
        };
        self.together(last).map(change).sum()
    }

    /// Its value at the end of each load step, if it has been `start` before the first.
    pub fn values(&self, times: &Times, start: f64) -> Vec<f64> {
        // At the end of the step before.
        let mut before = start;
        let mut values = Vec::with_capacity(times.ends.len());
        for (i, &(step, time)) in times.ends.iter().enumerate() {
            let about = &times.said.steps[step];
            let mut here = self
                .settings
                .iter()
                .filter(|setting| setting.by.step == step);
            let value = match here.next_back() {
                None => before + self.goes_on(times, step, time),
                Some(Setting { to: To::Fixed, .. }) => before,
                Some(last) => {
                    let (mut ramped, mut swung) = (None, 0.0);
                    for setting in self.together(last) {
                        let target = match setting.to {
                            To::Value(value) => value,
                            _ => start,
                        };
                        match setting
                            .by
                            .amplitude
                            .map(|number| &times.said.amplitudes[number])
                        {
                            Some(amplitude) => {
                                let Amplitude { total, .. } = amplitude;
                                let shift = if *total { times.begin(step) } else { 0.0 };
                                swung += target * amplitude.at(time + shift);
                            }
                            None => *ramped.get_or_insert(0.0) += target,
                        }
                    }
                    swung
                        + match ramped {
                            None => 0.0,
                            Some(target) if about.at_once => target,
                            Some(target) => {
                                before + (target - before) * (time / about.period).min(1.0)
                            }
                        }
                }
            };
            values.push(value);
            if times.ends.get(i + 1).is_none_or(|next| next.0 != step) {
                before = value;
            }
        }
        values
    }
}

/// The common value whose multiples are the values over the load steps, and the multiples: no multiples where all are
/// equal.
pub(super) fn factors(values: &[f64]) -> (f64, Option<Vec<f64>>) {
    // The last of equally large values.
    let largest = values
        .iter()
        .fold(0.0, |a: f64, &v| if v.abs() >= a.abs() { v } else { a });
    if values.iter().all(|&v| v == largest) {
        return (largest, None);
    }
    (largest, Some(values.iter().map(|v| v / largest).collect()))
}

/// Tracks in the order in which they begin.
pub(super) struct Tracks<K> {
    pub all: Vec<(K, Track)>,
    number: HashMap<K, usize>,
}

impl<K> Default for Tracks<K> {
    fn default() -> Self {
        Self {
            all: Vec::new(),
            number: HashMap::new(),
        }
    }
}

impl<K: Clone + Eq + Hash> Tracks<K> {
    /// Sets a value from a step on.
    pub fn set(&mut self, key: K, origin: &str, value: f64, by: Stated) {
        self.add(key, origin, by, To::Value(value), false);
    }

    /// Sets a load from a step on; loads that one step states on the same thing add up.
    pub fn load(&mut self, key: K, origin: &str, value: f64, by: Stated) {
        self.add(key, origin, by, To::Value(value), true);
    }

    /// Keeps its value from a step on; in the first one it is nothing yet.
    pub fn fix(&mut self, key: K, origin: &str, by: Stated) {
        let to = match by.step {
            0 => To::Value(0.0),
            _ => To::Fixed,
        };
        let by = Stated {
            amplitude: None,
            ..by
        };
        self.add(key, origin, by, to, false);
    }

    fn add(&mut self, key: K, origin: &str, by: Stated, to: To, adds: bool) {
        let Stated { step, line, .. } = by;
        let setting = Setting { by, to, adds };
        match self.number.get(&key) {
            Some(&number) => {
                let track = &mut self.all[number].1;
                track.origin = origin.to_owned();
                // An entry that is removed and set again in one step was never removed.
                (track.settings).pop_if(|last| last.to == To::Nothing && last.by.step == step);
                track.settings.push(setting);
            }
            None => {
                self.number.insert(key.clone(), self.all.len());
                let track = Track {
                    line,
                    origin: origin.to_owned(),
                    settings: vec![setting],
                };
                self.all.push((key, track));
            }
        }
    }

    /// Takes all away from a step on.
    pub fn clear(&mut self, step: usize, line: usize) {
        for (_, track) in &mut self.all {
            if track
                .settings
                .last()
                .is_some_and(|last| last.to != To::Nothing)
            {
                track.settings.retain(|setting| setting.by.step != step);
                let by = Stated {
                    step,
                    line,
                    amplitude: None,
                };
                let (to, adds) = (To::Nothing, false);
                track.settings.push(Setting { by, to, adds });
            }
        }
    }
}
