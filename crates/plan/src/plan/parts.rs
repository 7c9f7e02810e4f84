//! The fragments of a texture, chunk by chunk of its strokes, and what each lies on.

use crate::split::{Fragment, Fragments, Measure};
use terrace_core::geom::FieldPoint;

/// A fragment by its place in the list of a chunk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Member {
    /// Index of the chunk.
    pub(super) chunk: u32,
    /// Index in it.
    pub(super) index: u32,
}

/// Chunks of fragments, in the order of the texture.
#[derive(Default)]
pub(super) struct Parts {
    list: Vec<Fragments>,
    /// What the fragments of all chunks lie on. They are needed for a shorter time than the fragments: memory of one
    /// long list goes back to the system then, that of many short ones would not.
    measures: Vec<Measure>,
    /// By chunk, the first of its measures.
    starts: Vec<usize>,
}

impl Parts {
    /// Appends the next chunk.
    pub(super) fn push(&mut self, mut part: Fragments) {
        self.starts.push(self.measures.len());
        self.measures.append(&mut part.measures);
        part.shrink();
        self.list.push(part);
    }

    /// The chunks; without measures.
    pub(super) fn list(&self) -> &[Fragments] {
        &self.list
    }

    /// The chunks, their measures let go.
    pub(super) fn into_list(self) -> Vec<Fragments> {
        self.list
    }

    /// The chunks, and all measures in their order.
    pub(super) fn apart(self) -> (Vec<Fragments>, Measures) {
        (self.list, Measures { list: self.measures, starts: self.starts })
    }

    /// How many fragments there are.
    pub(super) fn count(&self) -> usize {
        self.measures.len()
    }

    /// All fragments with what they lie on.
    pub(super) fn fragments(&self) -> impl Iterator<Item = (&Fragment, &Measure)> {
        self.list.iter().flat_map(|part| &part.list).zip(&self.measures)
    }

    /// All fragments, to be changed, with what they lie on.
    pub(super) fn fragments_mut(&mut self) -> impl Iterator<Item = (&mut Fragment, &Measure)> {
        self.list.iter_mut().flat_map(|part| &mut part.list).zip(&self.measures)
    }

    /// What a fragment lies on.
    pub(super) fn measure(&self, Member { chunk, index }: Member) -> &Measure {
        &self.measures[self.starts[chunk as usize] + index as usize]
    }
}

/// The measures of all chunks.
pub(super) struct Measures {
    list: Vec<Measure>,
    starts: Vec<usize>,
}

impl Measures {
    /// The measures of a chunk.
    pub(super) fn of(&self, chunk: usize) -> &[Measure] {
        let end = self.starts.get(chunk + 1).copied().unwrap_or(self.list.len());
        &self.list[self.starts[chunk]..end]
    }
}

/// A fragment and its points.
pub(super) fn fragment(chunks: &[Fragments], Member { chunk, index }: Member) -> (&Fragment, &[FieldPoint]) {
    let chunk = &chunks[chunk as usize];
    let f = &chunk.list[index as usize];
    (f, &chunk.points[f.first as usize..(f.first + f.len) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_keep_their_measures_in_the_order_they_came() {
        let part = |slopes: &[f32]| Fragments {
            list: vec![Fragment::default(); slopes.len()],
            measures: slopes.iter().map(|&slope2| Measure { slope2, ..Measure::default() }).collect(),
            ..Fragments::default()
        };
        let mut parts = Parts::default();
        [part(&[0.1, 0.2]), part(&[]), part(&[0.3])].into_iter().for_each(|part| parts.push(part));
        assert_eq!(parts.count(), 3);
        let slope2 = |chunk, index| parts.measure(Member { chunk, index }).slope2;
        assert_eq!((slope2(0, 1), slope2(2, 0)), (0.2, 0.3));
        assert_eq!(parts.fragments().map(|(_, m)| m.slope2).collect::<Vec<_>>(), [0.1, 0.2, 0.3]);
        let (list, measures) = parts.apart();
        assert_eq!((list.len(), [0, 1, 2].map(|k| measures.of(k).len())), (3, [2, 0, 1]));
    }
}
