//! The tags of one entity or table row, by their group codes.

use super::tags::{Fault, Tag, TagPlace};
use terrace_core::geom::SpacePoint;

/// The tags from one of group 0 to the next.
pub(super) struct Record<'a, 'r> {
    /// What it is, such as `LINE`.
    pub(super) kind: &'a [u8],
    pub(super) at: TagPlace,
    pub(super) tags: &'r [Tag<'a>],
}

impl<'a> Record<'a, '_> {
    /// The first tag of a group.
    pub(super) fn tag(&self, code: i32) -> Option<&Tag<'a>> {
        self.tags.iter().find(|t| t.code == code)
    }

    pub(super) fn real(&self, code: i32) -> Result<Option<f64>, Fault> {
        self.tag(code).map(Tag::real).transpose()
    }

    pub(super) fn whole(&self, code: i32) -> Result<Option<i64>, Fault> {
        self.tag(code).map(Tag::whole).transpose()
    }

    /// Whether the bits are set in the whole number of a group.
    pub(super) fn has(&self, code: i32, bits: i64) -> Result<bool, Fault> {
        Ok(self.whole(code)?.unwrap_or(0) & bits != 0)
    }

    /// A point whose x has this group, y one 10 above and z one 20 above.
    pub(super) fn point(&self, code: i32) -> Result<Option<SpacePoint>, Fault> {
        let Some(x) = self.real(code)? else { return Ok(None) };
        Ok(Some([x, self.real(code + 10)?.unwrap_or(0.0), self.real(code + 20)?.unwrap_or(0.0)]))
    }

    /// The point of [`Record::point`]; the origin where there is none.
    pub(super) fn place(&self, code: i32) -> Result<SpacePoint, Fault> {
        Ok(self.point(code)?.unwrap_or_default())
    }
}
