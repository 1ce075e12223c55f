//! The depth of nested structures in files. A reader that calls itself asks for one level more, so that no file can
//! use up the stack of the program, which would end it without a message.

use std::fmt;

/// A level of nesting below a limit.
///
/// ```
/// use modelmill_boundary::nesting::NestingLevel;
/// let top = NestingLevel::top(1);
/// let inner = top.enter().unwrap();
/// assert_eq!(inner.enter().unwrap_err().to_string(), "it is nested more than 1 level deep");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NestingLevel {
    /// The present depth; 0 at the top.
    depth: usize,
    /// The largest depth.
    most: usize,
}

/// A structure is nested too deeply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooDeep {
    /// The largest depth.
    pub most: usize,
}

impl NestingLevel {
    /// The top of a structure with at most `most` levels below it.
    pub const fn top(most: usize) -> Self {
        Self { depth: 0, most }
    }

    /// The next level. Fails below the deepest one.
    pub const fn enter(self) -> Result<Self, TooDeep> {
        if self.depth >= self.most {
            return Err(TooDeep { most: self.most });
        }
        Ok(Self {
            depth: self.depth + 1,
            most: self.most,
        })
    }

    /// The level above; the top stays the top.
    #[must_use]
    pub const fn leave(self) -> Self {
        Self {
            depth: self.depth.saturating_sub(1),
            most: self.most,
        }
    }
}

impl fmt::Display for TooDeep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let levels = if self.most == 1 { "level" } else { "levels" };
        write!(f, "it is nested more than {} {levels} deep", self.most)
    }
}

impl std::error::Error for TooDeep {}
