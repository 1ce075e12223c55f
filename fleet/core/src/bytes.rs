//! The binary format of summaries: numbers and texts to little-endian bytes, and back. A checksum detects bytes that
//! were cut off or changed.

use modelmill_identify::changes::NormalEquations;

use crate::FleetFault;

/// Writes numbers and texts one after the other.
#[derive(Default)]
pub(crate) struct SummaryWriter(Vec<u8>);

impl SummaryWriter {
    /// Bytes as they are.
    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    /// An integer of eight bytes.
    pub(crate) fn integer(&mut self, number: u64) {
        self.bytes(&number.to_le_bytes());
    }

    /// A number of eight bytes.
    pub(crate) fn float(&mut self, number: f64) {
        self.bytes(&number.to_le_bytes());
    }

    /// A list of numbers after its length.
    pub(crate) fn floats(&mut self, numbers: &[f64]) {
        self.integer(numbers.len() as u64);
        for number in numbers {
            self.float(*number);
        }
    }

    /// A text in UTF-8 after its length in bytes.
    pub(crate) fn text(&mut self, text: &str) {
        self.integer(text.len() as u64);
        self.bytes(text.as_bytes());
    }

    /// Normal equations without columns that are zero in all rows, and only the upper half of the symmetric matrix.
    pub(crate) fn moments(&mut self, sums: &NormalEquations) {
        let n = sums.rhs.len();
        let kept: Vec<usize> = (0..n).filter(|k| sums.gram[(*k, *k)] != 0.0).collect();
        self.integer(n as u64);
        self.integer(kept.len() as u64);
        for k in &kept {
            self.integer(*k as u64);
        }
        for (i, a) in kept.iter().enumerate() {
            for b in &kept[i..] {
                self.float(sums.gram[(*a, *b)]);
            }
            self.float(sums.rhs[*a]);
        }
        self.float(sums.total);
        self.integer(sums.rows as u64);
    }

    /// The bytes with the checksum at their end.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        let sum = checksum(&self.0);
        self.integer(sum);
        self.0
    }
}

/// Reads what [`SummaryWriter`] wrote, in the same order. All methods fail if bytes are missing.
pub(crate) struct SummaryReader<'a> {
    /// The bytes that are not read yet.
    bytes: &'a [u8],
    /// Name of the data in messages.
    what: &'a str,
}

impl<'a> SummaryReader<'a> {
    /// Starts reading; fails if the checksum does not match. `what` is the name of the data in messages.
    pub(crate) fn new(bytes: &'a [u8], what: &'a str) -> Result<Self, FleetFault> {
        let reader = Self { bytes, what };
        let at = bytes.len().checked_sub(8).ok_or_else(|| reader.fault())?;
        let (bytes, sum) = bytes.split_at(at);
        if sum != checksum(bytes).to_le_bytes() {
            return Err(reader.fault());
        }
        Ok(Self { bytes, what })
    }

    /// The fault of bytes that do not have the format.
    fn fault(&self) -> FleetFault {
        FleetFault::new(format!(
            "{} is incomplete or was changed: this program did not write these bytes; make it again",
            self.what
        ))
    }

    /// The next `n` bytes.
    fn take_bytes(&mut self, n: usize) -> Result<&'a [u8], FleetFault> {
        if n > self.bytes.len() {
            return Err(self.fault());
        }
        let (taken, rest) = self.bytes.split_at(n);
        self.bytes = rest;
        Ok(taken)
    }

    /// The next `N` bytes as an array.
    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], FleetFault> {
        let taken = self.take_bytes(N)?;
        taken.try_into().map_err(|_| self.fault())
    }

    /// The next integer.
    pub(crate) fn integer(&mut self) -> Result<u64, FleetFault> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// A number of elements of at least `each` bytes; fails if the remaining bytes cannot contain so many.
    pub(crate) fn element_count(&mut self, each: usize) -> Result<usize, FleetFault> {
        let n = usize::try_from(self.integer()?).map_err(|_| self.fault())?;
        if n.saturating_mul(each) > self.bytes.len() {
            return Err(self.fault());
        }
        Ok(n)
    }

    /// The next integer as a size.
    pub(crate) fn size(&mut self) -> Result<usize, FleetFault> {
        usize::try_from(self.integer()?).map_err(|_| self.fault())
    }

    /// The next number.
    pub(crate) fn float(&mut self) -> Result<f64, FleetFault> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// The next list of numbers.
    pub(crate) fn floats(&mut self) -> Result<Vec<f64>, FleetFault> {
        let n = self.element_count(8)?;
        (0..n).map(|_| self.float()).collect()
    }

    /// The next text.
    pub(crate) fn text(&mut self) -> Result<String, FleetFault> {
        let n = self.element_count(1)?;
        let bytes = self.take_bytes(n)?;
        String::from_utf8(bytes.to_vec()).map_err(|_| self.fault())
    }

    /// Normal equations with `columns` columns; fails if they have another number.
    pub(crate) fn moments(&mut self, columns: usize) -> Result<NormalEquations, FleetFault> {
        let n = self.size()?;
        if n != columns {
            return Err(FleetFault::new(format!(
                "{} has {n} columns, but the plan has {columns}: it belongs to another model; make it again with this plan",
                self.what
            )));
        }
        let many = self.element_count(8)?;
        let mut kept = Vec::with_capacity(many);
        for _ in 0..many {
            let k = self.size()?;
            if k >= n {
                return Err(self.fault());
            }
            kept.push(k);
        }
        let mut sums = NormalEquations::new(n);
        for (i, a) in kept.iter().enumerate() {
            for b in &kept[i..] {
                let x = self.float()?;
                sums.gram[(*a, *b)] = x;
                sums.gram[(*b, *a)] = x;
            }
            sums.rhs[*a] = self.float()?;
        }
        sums.total = self.float()?;
        sums.rows = self.size()?;
        Ok(sums)
    }

    /// Ends reading; fails if bytes remain.
    pub(crate) fn finish(self) -> Result<(), FleetFault> {
        if self.bytes.is_empty() {
            Ok(())
        } else {
            Err(self.fault())
        }
    }
}

/// The checksum FNV-1a of 64 bits (Fowler, Noll, Vo). It detects accidental changes, not deliberate ones.
pub(crate) fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
