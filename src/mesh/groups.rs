//! Things that belong together.

/// A partition of 0, 1, …, n − 1 into groups, at first single members.
pub(crate) struct Groups(Vec<u32>);

impl Groups {
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// A representative of the group of i, the same for all members.
    pub fn of(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Makes one group of those of a and b.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[b as usize] = a;
    }

    /// The number of groups, and each member's group, counted in the order of their first members.
    pub fn numbers(mut self) -> (usize, Vec<u32>) {
        let (mut number_of, mut count) = (vec![u32::MAX; self.0.len()], 0);
        let numbers = (0..self.0.len() as u32)
            .map(|i| {
                let number = &mut number_of[self.of(i) as usize];
                if *number == u32::MAX {
                    *number = count;
                    count += 1;
                }
                *number
            })
            .collect();
        (count as usize, numbers)
    }
}
