//! Numbers of the parts of a program and of what it was made of: each of a type of its own, so that none is
//! passed for another. They are indices from 0.
//!
//! ```compile_fail
//! # use terrace::program::{PenId, StrokeId};
//! let source: StrokeId = PenId(0);
//! ```

use std::fmt;

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident($of:ty);)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(transparent)]
        pub struct $name(pub $of);

        impl $name {
            /// The place of what it names in a list.
            #[inline]
            pub const fn index(self) -> usize {
                self.0 as usize
            }
        }
    )*};
}

ids! {
    /// A stroke of the texture.
    StrokeId(u32);
    /// A stroke of a program, in the order of marking: a piece of a stroke of the texture.
    PieceId(u32);
    /// A pen.
    PenId(u16);
    /// A pass over the texture.
    PassId(u32);
    /// A set-up of the part, in the order in which the job names them.
    SetupId(u32);
    /// A stop in the list that a method of partition gave.
    StopId(u32);
    /// A block of a program; shown as files and messages name it, `B0001` the first.
    BlockId(u32);
}

impl BlockId {
    /// The block at that place of [`Program::blocks`](super::Program::blocks) of a whole program.
    ///
    /// # Panics
    /// From 2^32 on, which no program has.
    pub fn new(index: usize) -> Self {
        Self(u32::try_from(index).expect("a program has fewer than 2^32 blocks"))
    }
}

impl std::str::FromStr for BlockId {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        let number: Option<u32> = name.strip_prefix('B').and_then(|digits| digits.parse().ok());
        let id = number.and_then(|n| n.checked_sub(1)).map(Self);
        id.filter(|id| id.to_string() == name)
            .ok_or_else(|| format!("{name:?} is not the name of a block, such as B0133"))
    }
}

impl BlockId {
    /// The number that people and controllers read, from 1.
    pub const fn number(self) -> u64 {
        self.0 as u64 + 1
    }
}

impl fmt::Display for BlockId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "B{:04}", self.number())
    }
}

impl PassId {
    /// The number that people read, from 1.
    pub const fn number(self) -> u32 {
        self.0 + 1
    }
}

impl SetupId {
    /// The number that people read, from 1.
    pub const fn number(self) -> u32 {
        self.0 + 1
    }
}

impl PenId {
    /// The number that people and controllers read, from 1.
    pub const fn number(self) -> u32 {
        self.0 as u32 + 1
    }
}

/// A section: its column and row in the grid of its pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SectionId(pub [u32; 2]);
