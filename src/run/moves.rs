//! The moves from block to block, as the stage programs make them: z alone, or x, y and the tilt axes together; all three
//! linear axes together where the machine moves diagonally.

use super::folder::{Block, Folder};
use super::stage::Move;
use terrace_core::geom::Nm;

/// Where the stage has been sent.
pub(super) struct Moves<'a> {
    folder: &'a Folder,
    /// Positions of x, y and z, nm; None where they are not known.
    at: Option<[i64; 3]>,
    /// Angles of the tilt axes; None where they are not known.
    tilt: Option<[i64; 2]>,
}

impl<'a> Moves<'a> {
    /// Of a stage that may stand anywhere.
    pub fn new(folder: &'a Folder) -> Self {
        Self { folder, at: None, tilt: None }
    }

    /// The moves to a block; the first of all is a lift.
    pub fn to(&mut self, block: &Block) -> Vec<Move> {
        let mut moves = Vec::new();
        let lifts = self.at.is_none() || block.lift.is_some();
        let Nm(top) = self.folder.machine.retract_z();
        let is_diagonal = self.folder.machine.stage.diagonal && !lifts && self.at.is_some_and(|at| at[2] != top);
        if lifts {
            moves.extend(self.lift_to(block.lift.unwrap_or(self.folder.machine.retract_z().0)));
        }
        let [x, y, z] = block.stage;
        let letters = self.folder.machine.tilt.as_ref().map(|t| t.axes.each_ref().map(|axis| axis.letter.char()));
        let turns = letters.filter(|_| self.tilt != Some(block.tilt));
        if turns.is_some() || self.at.is_none_or(|at| at[..2] != [x, y]) {
            let tilt = turns.into_iter().flat_map(|letters| letters.into_iter().zip(block.tilt));
            moves.push(Move([('X', x), ('Y', y)].into_iter().chain(tilt).collect()));
        }
        if self.at.is_none_or(|at| at[2] != z) {
            match moves.last_mut().filter(|_| is_diagonal) {
                Some(Move(words)) => words.push(('Z', z)),
                None => moves.push(Move(vec![('Z', z)])),
            }
        }
        (self.at, self.tilt) = (Some(block.stage), Some(block.tilt));
        moves
    }

    /// The moves to a place in x and y, lifted and not tilted.
    pub fn over(&mut self, [x, y]: [i64; 2]) -> Vec<Move> {
        let letters = self.folder.machine.tilt.as_ref().map(|t| t.axes.each_ref().map(|axis| axis.letter.char()));
        let upright = letters.into_iter().flatten().map(|letter| (letter, 0));
        let across = Move([('X', x), ('Y', y)].into_iter().chain(upright).collect());
        let moves = self.lift().into_iter().chain([across]).collect();
        (self.at, self.tilt) = (Some([x, y, self.folder.machine.retract_z().0]), Some([0; 2]));
        moves
    }

    /// The lift to the far end of z, unless the stage is there.
    pub fn lift(&mut self) -> Option<Move> {
        self.lift_to(self.folder.machine.retract_z().0)
    }

    fn lift_to(&mut self, z: i64) -> Option<Move> {
        if self.at.is_some_and(|at| at[2] == z) {
            return None;
        }
        if let Some(at) = &mut self.at {
            at[2] = z;
        }
        Some(Move(vec![('Z', z)]))
    }

    /// Takes the position as unknown.
    pub fn forget(&mut self) {
        (self.at, self.tilt) = (None, None);
    }
}
