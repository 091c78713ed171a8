//! The halo of a rank: the rows of other ranks that its own rows reach.

use super::Ranks;
use crate::sparse::stored::Real;
use bytemuck::Pod;
use std::ops::Range;
use std::sync::Arc;

/// The blocks of a vector, or the rows of a matrix, that belong to this rank, and copies of those of others that its rows reach:
/// own ones come first. Without other ranks there are no copies, and nothing here does anything.
///
/// All methods that move values are collective.
#[derive(Clone, Debug)]
pub struct Halo {
    ranks: Ranks,
    /// The number of the first own row, where rows are counted rank by rank, and the number of own rows and of all.
    first: u64,
    own: usize,
    all: u64,
    /// The numbers of the copies.
    numbers: Arc<[u64]>,
    /// The ranks to talk to, in their order, with the own rows that each of them has copies of, and the places of the copies of
    /// its rows.
    with: Arc<[usize]>,
    ours: Arc<[Vec<u32>]>,
    theirs: Arc<[Vec<u32>]>,
}

impl Halo {
    /// So many rows, and no other rank.
    pub fn alone(own: usize) -> Self {
        Self::new(&Ranks::default(), own, Vec::new())
    }

    /// So many own rows, and copies of the rows of others with these numbers.
    pub fn new(ranks: &Ranks, own: usize, numbers: Vec<u64>) -> Self {
        let (rank, counts) = ranks.counts(own);
        let ends: Vec<u64> = (counts.iter())
            .scan(0, |end, &count| {
                *end += count as u64;
                Some(*end)
            })
            .collect();
        let mut theirs = vec![Vec::new(); counts.len()];
        let mut wanted = vec![Vec::new(); counts.len()];
        for (place, &number) in (own as u32..).zip(&numbers) {
            let owner = ends.partition_point(|&end| end <= number);
            theirs[owner].push(place);
            wanted[owner].push(number);
        }
        let first = ends[rank] - own as u64;
        let mut ours = (ranks.lists(wanted).into_iter())
            .map(|list| {
                list.into_iter()
                    .map(|number| (number - first) as u32)
                    .collect()
            })
            .collect::<Vec<Vec<u32>>>();
        let with: Vec<usize> = (0..counts.len())
            .filter(|&other| !ours[other].is_empty() || !theirs[other].is_empty())
            .collect();
        let chosen = |lists: &mut Vec<Vec<u32>>| -> Arc<[Vec<u32>]> {
            with.iter()
                .map(|&other| std::mem::take(&mut lists[other]))
                .collect()
        };
        Self {
            ranks: ranks.clone(),
            first,
            own,
            all: ends.last().copied().unwrap_or(0),
            numbers: numbers.into(),
            ours: chosen(&mut ours),
            theirs: chosen(&mut theirs),
            with: with.into(),
        }
    }

    /// So many rows of another kind on the same ranks, without copies so far.
    pub fn of_own(&self, own: usize) -> Self {
        Self::new(&self.ranks, own, Vec::new())
    }

    /// Makes copies of those of these rows that belong to other ranks. Collective.
    pub fn reach(&mut self, numbers: impl Iterator<Item = u64>) {
        let mut others: Vec<u64> = numbers
            .filter(|&number| self.here(number).is_none())
            .collect();
        others.sort_unstable();
        others.dedup();
        *self = Self::new(&self.ranks, self.own, others);
    }

    /// The place of an own row.
    fn here(&self, number: u64) -> Option<u32> {
        let place = number.checked_sub(self.first)?;
        (place < self.own as u64).then_some(place as u32)
    }

    /// The place of the row with this number, which is here or has a copy made by [`Halo::reach`].
    pub fn place(&self, number: u64) -> u32 {
        self.here(number).unwrap_or_else(|| {
            let copy = self.numbers.partition_point(|&other| other < number);
            (self.own + copy) as u32
        })
    }

    /// The order of rows: own ones, then copies made by [`Halo::reach`].
    pub fn order(&self) -> impl Fn(u64) -> (bool, u64) + Copy + use<> {
        let own = self.first..self.first + self.own as u64;
        let [first, end] = [own.start, own.end];
        move |number| (!(first..end).contains(&number), number)
    }

    /// Adds the starts of the copies of rows to those of own ones.
    pub fn extend_starts(&self, starts: &mut Vec<usize>) {
        let own = starts.windows(2).map(|ends| (ends[1] - ends[0]) as u64);
        let lengths = self.extended(1, own.collect());
        let mut end = starts[self.own];
        starts.extend(lengths[self.own..].iter().map(|&length| {
            end += length as usize;
            end
        }));
    }

    /// This process and the others.
    pub fn ranks(&self) -> &Ranks {
        &self.ranks
    }

    /// Own rows.
    pub fn own(&self) -> usize {
        self.own
    }

    /// Copies of rows of others.
    pub fn copies(&self) -> usize {
        self.numbers.len()
    }

    /// The rows of all ranks.
    pub fn all(&self) -> u64 {
        self.all
    }

    /// The number of the first own row.
    pub fn first(&self) -> u64 {
        self.first
    }

    /// The number of an own row or a copy.
    pub fn number(&self, row: usize) -> u64 {
        match row.checked_sub(self.own) {
            None => self.first + row as u64,
            Some(copy) => self.numbers[copy],
        }
    }

    /// The own rows that others have copies of, in their order, and the halo of these rows alone.
    pub fn interface(&self) -> (Vec<u32>, Self) {
        let mut rows: Vec<u32> = self.ours.iter().flatten().copied().collect();
        rows.sort_unstable();
        rows.dedup();
        let among = |row: &u32| rows.partition_point(|other| other < row) as u32;
        let moved = (self.own - rows.len()) as u32;
        let halo = Self {
            own: rows.len(),
            ours: (self.ours.iter())
                .map(|ours| ours.iter().map(among).collect())
                .collect(),
            theirs: (self.theirs.iter())
                .map(|theirs| theirs.iter().map(|place| place - moved).collect())
                .collect(),
            ..self.clone()
        };
        (rows, halo)
    }

    /// Updates the copies; `width` values belong to a row.
    pub fn update<T: Pod>(&self, width: usize, values: &mut [T]) {
        self.update_rows(|row| row * width..(row + 1) * width, values);
    }

    /// Own values with copies of those of others.
    pub fn extended<T: Pod>(&self, width: usize, mut own: Vec<T>) -> Vec<T> {
        own.resize((self.own + self.copies()) * width, T::zeroed());
        self.update(width, &mut own);
        own
    }

    /// Updates the copies, where a row has a range of values, as long on its own rank as on others.
    pub fn update_rows<T: Pod>(&self, range: impl Fn(usize) -> Range<usize>, values: &mut [T]) {
        if self.with.is_empty() {
            return;
        }
        let to = self.packed(&self.ours, &range, values);
        let lengths = self.theirs.iter().map(|rows| length(rows, &range));
        let mut from: Vec<Vec<T>> = lengths.map(|length| vec![T::zeroed(); length]).collect();
        self.ranks.swap(&self.with, &to, &mut from);
        for (rows, mut from) in self.theirs.iter().zip(from.iter().map(|list| &list[..])) {
            for &row in rows {
                let to = &mut values[range(row as usize)];
                let (values, rest) = from.split_at(to.len());
                to.copy_from_slice(values);
                from = rest;
            }
        }
    }

    /// Sends the values of copies here to the ranks of their rows, and calls `take(row, values)` for the values that
    /// have come for own rows, rank by rank. A copy has a `range` of `values`; the [`Halo::lengths`] are of the values
    /// that come.
    pub fn collect<T: Pod>(
        &self,
        range: impl Fn(usize) -> Range<usize>,
        values: &[T],
        lengths: &[Vec<usize>],
        mut take: impl FnMut(usize, &[T]),
    ) {
        if self.with.is_empty() {
            return;
        }
        let to = self.packed(&self.theirs, &range, values);
        let mut from: Vec<Vec<T>> = (lengths.iter())
            .map(|lengths| vec![T::zeroed(); lengths.iter().sum()])
            .collect();
        self.ranks.swap(&self.with, &to, &mut from);
        for ((rows, lengths), from) in self.ours.iter().zip(lengths).zip(&from) {
            let mut from = &from[..];
            for (&row, &length) in rows.iter().zip(lengths) {
                let (values, rest) = from.split_at(length);
                take(row as usize, values);
                from = rest;
            }
        }
    }

    /// Adds the values that other ranks have for own rows, `width` for each, rank by rank; `copies` has those that this rank has
    /// for theirs.
    pub fn add<T: Real>(&self, width: usize, copies: &[T], own: &mut [T]) {
        let lengths: Vec<_> = self
            .ours
            .iter()
            .map(|rows| vec![width; rows.len()])
            .collect();
        let range = |row| (row - self.own) * width..(row - self.own + 1) * width;
        self.collect(range, copies, &lengths, |row, values| {
            let own = &mut own[row * width..(row + 1) * width];
            own.iter_mut().zip(values).for_each(|(own, &v)| *own += v);
        });
    }

    /// For each rank, the lengths of its values for own rows; `length` is that of the values here for a copy.
    pub fn lengths(&self, length: impl Fn(usize) -> usize) -> Vec<Vec<usize>> {
        let to: Vec<Vec<u64>> = (self.theirs.iter())
            .map(|rows| {
                rows.iter()
                    .map(|&row| length(row as usize) as u64)
                    .collect()
            })
            .collect();
        let mut from: Vec<Vec<u64>> = self.ours.iter().map(|rows| vec![0; rows.len()]).collect();
        self.ranks.swap(&self.with, &to, &mut from);
        (from.into_iter())
            .map(|lengths| lengths.into_iter().map(|length| length as usize).collect())
            .collect()
    }

    /// The values of rows, for each rank.
    fn packed<T: Pod>(
        &self,
        rows: &[Vec<u32>],
        range: &impl Fn(usize) -> Range<usize>,
        values: &[T],
    ) -> Vec<Vec<T>> {
        (rows.iter())
            .map(|rows| {
                let mut list = Vec::with_capacity(length(rows, range));
                for &row in rows {
                    list.extend_from_slice(&values[range(row as usize)]);
                }
                list
            })
            .collect()
    }
}

/// The values that these rows have.
fn length(rows: &[u32], range: &impl Fn(usize) -> Range<usize>) -> usize {
    rows.iter().map(|&row| range(row as usize).len()).sum()
}
