//! Limits of one run of a reader, in proportion to its input.

use std::time::{Duration, Instant};

use crate::allocator::MemoryMark;

/// What a reader may use for an input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReaderBudget {
    /// Memory at one time for any input, bytes.
    pub(crate) memory: usize,
    /// Memory at one time in addition, bytes per byte of the input.
    pub(crate) memory_per_byte: usize,
    /// Sum of all requests of memory for any input, bytes. It stands for the work of the reader, since it does not depend
    /// on the machine or its load.
    pub(crate) work: usize,
    /// Work in addition, bytes per byte of the input.
    pub(crate) work_per_byte: usize,
    /// Longest time. A busy machine may be ten times slower, so that only endless work is detected.
    pub(crate) time: Duration,
}

impl ReaderBudget {
    /// The budget of most readers. Chosen by the bundled files, which take at most a third of it.
    pub(crate) const USUAL: Self = Self {
        memory: 48 << 20,
        memory_per_byte: 300,
        work: 256 << 20,
        work_per_byte: 20_000,
        time: Duration::from_secs(20),
    };

    /// The budget of robot descriptions: loops are closed numerically, from up to 200 poses, whatever the size of the file.
    pub(crate) const DESCRIPTION: Self = Self {
        work: 4 << 30,
        time: Duration::from_secs(120),
        ..Self::USUAL
    };

    /// A budget with more memory for any input, for formats that state windows or pages.
    pub(crate) const fn with_memory(self, memory: usize) -> Self {
        Self {
            memory,
            work: self.work + 4 * memory,
            ..self
        }
    }

    /// Runs a reader.
    ///
    /// # Panics
    ///
    /// When it exceeds the budget.
    pub(crate) fn run<T>(&self, input: &[u8], reader: impl FnOnce() -> T) -> T {
        let mark = MemoryMark::set();
        let start = Instant::now();
        let found = reader();
        let time = start.elapsed();
        let used = mark.measure();
        let n = input.len();
        let memory = self.memory + self.memory_per_byte * n;
        assert!(
            used.peak <= memory,
            "{n} bytes of input take {} bytes of memory, more than {memory}",
            used.peak
        );
        let work = self.work + self.work_per_byte * n;
        assert!(
            used.requested <= work,
            "{n} bytes of input request {} bytes of memory in sum, more than {work}",
            used.requested
        );
        assert!(
            time <= self.time,
            "{n} bytes of input take {time:?}, more than {:?}",
            self.time
        );
        found
    }
}
