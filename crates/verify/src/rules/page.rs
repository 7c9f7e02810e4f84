//! Where the page of a drawing lies on the part, by the verifier's own arithmetic.
//!
//! Consumes what the job says of size, place, turn and mirror, the part's box, and the sides that the file gives to the
//! page. Page mm have their origin in the lower left corner, y up, as the file has them before it is mirrored.

use terrace_core::geom::{BoxMm, NM_PER_MM};
use terrace_core::math;
use terrace_input::texture::{Align, Area, Fit, Kind, Mirror, Position, Size};

/// The part as drawings are placed on it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    /// Part frame, mm.
    pub(crate) part_box: BoxMm<2>,
    /// The turn of the part about the origin of its frame.
    pub(crate) turn_rad: f64,
}

/// A placed page.
#[derive(Clone, Debug)]
pub(super) struct Page {
    /// Width and height, mm.
    pub(super) size: [f64; 2],
    origin: [f64; 2],
    /// How far it is turned on the part.
    pub(super) turn_rad: f64,
    part_rad: f64,
    mirror: Option<Mirror>,
    tiles: bool,
}

/// A point turned about the origin.
fn turned([x, y]: [f64; 2], rad: f64) -> [f64; 2] {
    let (s, c) = math::sin_cos(rad);
    [c * x - s * y, s * x + c * y]
}

/// The sides of the box around a turned rectangle.
fn around([w, h]: [f64; 2], rad: f64) -> [f64; 2] {
    let (s, c) = math::sin_cos(rad);
    [(c * w).abs() + (s * h).abs(), (s * w).abs() + (c * h).abs()]
}

impl Page {
    /// The page of a drawing in its area whose file gives it these sides, mm; None of what is not a drawing.
    pub(super) fn new(kind: &Kind, area: &Area, site: &Site, sides: [f64; 2]) -> Option<Self> {
        let Kind::Drawing { size, position, turn_rad, tile, marking, .. } = kind else { return None };
        let limit = match area {
            Area::Part => Some(site.part_box),
            Area::Rectangle(area) => Some(*area),
            Area::Unlimited => None,
        };
        // The box in which the page is fitted and aligned.
        let room = limit.unwrap_or(site.part_box);
        let [w, h] = [0, 1].map(|k| room.hi[k] - room.lo[k]);
        let size = match *size {
            Size::File => sides,
            Size::Mm(size) => size,
            Size::Scaled(by) => sides.map(|s| s * by),
            Size::Fit(fit) => {
                let [a, b] = around(sides, *turn_rad);
                let by = match fit {
                    Fit::Contain => (w / a).min(h / b),
                    Fit::Width => w / a,
                    Fit::Height => h / b,
                    // Seen from the page it is the area that is turned.
                    Fit::Cover => {
                        let [a, b] = around([w, h], *turn_rad);
                        (a / sides[0]).max(b / sides[1])
                    }
                };
                sides.map(|s| s * by)
            }
        };
        // Around the page, turned about its lower left corner, as seen from that corner.
        let corners = BoxMm { lo: [0.0; 2], hi: size }.corners().map(|c| turned(c, *turn_rad));
        let turned_box = BoxMm::of(corners);
        let origin = match (position, limit) {
            (Position::Origin(origin), _) => *origin,
            // Of a turned page too it is the corner that is placed, not the box around it.
            (Position::Usual, Some(area)) => area.lo,
            (Position::Usual, None) => {
                let middle = turned(size.map(|s| s / 2.0), *turn_rad);
                [0, 1].map(|k| (room.lo[k] + room.hi[k]) / 2.0 - middle[k])
            }
            (Position::Aligned(align), _) => {
                let share = shares(*align);
                let free = [0, 1].map(|k| room.hi[k] - room.lo[k] - (turned_box.hi[k] - turned_box.lo[k]));
                [0, 1].map(|k| room.lo[k] - turned_box.lo[k] + share[k] * free[k])
            }
        };
        let (mirror, tiles) = (marking.mirror, *tile);
        Some(Self { size, origin, turn_rad: *turn_rad, part_rad: site.turn_rad, mirror, tiles })
    }

    /// Where a point of the turned part, nm, lies on the page; of tiles on the one that it is on.
    pub(super) fn at(&self, p: [f64; 2]) -> [f64; 2] {
        let plane = self.on_plane(p);
        self.unmirrored(if self.tiles { [0, 1].map(|k| plane[k].rem_euclid(self.size[k])) } else { plane })
    }

    /// Whether a point of the turned part, nm, lies on the page or so near to it, mm.
    pub(super) fn holds(&self, p: [f64; 2], slack: f64) -> bool {
        let at = self.on_plane(p);
        self.tiles || (0..2).all(|k| (-slack..=self.size[k] + slack).contains(&at[k]))
    }

    /// Where a point of the turned part, nm, lies in the plane of the page, from its lower left corner, as it is
    /// placed.
    pub(super) fn on_plane(&self, p: [f64; 2]) -> [f64; 2] {
        let part = turned(p.map(|v| v / NM_PER_MM), -self.part_rad);
        turned([part[0] - self.origin[0], part[1] - self.origin[1]], -self.turn_rad)
    }

    /// Where a point in the plane of the page lies on the part before it is turned, mm.
    pub(super) fn on_part(&self, p: [f64; 2]) -> [f64; 2] {
        let [x, y] = turned(p, self.turn_rad);
        [x + self.origin[0], y + self.origin[1]]
    }

    /// A point of the placed page as the file has it, or the other way.
    pub(super) fn unmirrored(&self, mut at: [f64; 2]) -> [f64; 2] {
        match self.mirror {
            Some(Mirror::X) => at[0] = self.size[0] - at[0],
            Some(Mirror::Y) => at[1] = self.size[1] - at[1],
            None => {}
        }
        at
    }

    /// The tile on which a point of the plane lies.
    pub(super) fn tile_of(&self, p: [f64; 2]) -> [i64; 2] {
        if self.tiles { [0, 1].map(|k| (p[k] / self.size[k]).floor() as i64) } else { [0; 2] }
    }

    /// Where the corner of a tile lies in the plane.
    pub(super) fn shift_of(&self, tile: [i64; 2]) -> [f64; 2] {
        [0, 1].map(|k| tile[k] as f64 * self.size[k])
    }

    /// A point of the plane from the corner of a tile.
    pub(super) fn in_tile(&self, p: [f64; 2], tile: [i64; 2]) -> [f64; 2] {
        let shift = self.shift_of(tile);
        [0, 1].map(|k| p[k] - shift[k])
    }

    /// Where between two points of the plane, 0 to 1, the tile changes, and both ends.
    pub(super) fn tile_crossings(&self, a: [f64; 2], b: [f64; 2]) -> Vec<f64> {
        let mut found = vec![0.0, 1.0];
        if self.tiles {
            for k in 0..2 {
                let [from, to] = [a[k], b[k]].map(|v| v / self.size[k]);
                let inner = from.min(to).floor() as i64 + 1..=from.max(to).ceil() as i64 - 1;
                found.extend(inner.map(|n| (n as f64 - from) / (to - from)));
            }
            found.sort_by(f64::total_cmp);
        }
        found
    }

    /// The box of the plane in which this page, or its tiles within a limit on the part, lie.
    pub(super) fn extent(&self, limit: Option<BoxMm<2>>) -> BoxMm<2> {
        let page = BoxMm { lo: [0.0; 2], hi: self.size };
        let limit = limit.filter(|_| self.tiles);
        limit.map_or(page, |limit| {
            let on_plane = |p: [f64; 2]| turned([p[0] - self.origin[0], p[1] - self.origin[1]], -self.turn_rad);
            BoxMm::of(limit.corners().map(on_plane))
        })
    }

    /// The tiles within a limit on the part; of a page that is not a tile itself.
    pub(super) fn tiles(&self, limit: Option<BoxMm<2>>) -> Vec<[i64; 2]> {
        let BoxMm { lo, hi } = self.extent(limit);
        let [x, y] = [0, 1].map(|k| {
            let [first, last] = [lo[k], hi[k]].map(|v| v / self.size[k]);
            if self.tiles { first.floor() as i64..last.ceil() as i64 } else { 0..1 }
        });
        y.flat_map(|j| x.clone().map(move |i| [i, j])).collect()
    }

    /// Where a point of the page as the file has it lies in the plane: once, or on each tile.
    pub(super) fn copies(&self, at: [f64; 2], limit: Option<BoxMm<2>>) -> impl Iterator<Item = [f64; 2]> + '_ {
        let at = self.unmirrored(at);
        self.tiles(limit).into_iter().map(move |tile| {
            let shift = self.shift_of(tile);
            [at[0] + shift[0], at[1] + shift[1]]
        })
    }
}

/// Which part of the free length lies left of the page, and below it.
fn shares(align: Align) -> [f64; 2] {
    let x = match align {
        Align::Left | Align::LeftTop | Align::LeftBottom => 0.0,
        Align::Right | Align::RightTop | Align::RightBottom => 1.0,
        Align::Centre | Align::Top | Align::Bottom => 0.5,
    };
    let y = match align {
        Align::Bottom | Align::LeftBottom | Align::RightBottom => 0.0,
        Align::Top | Align::LeftTop | Align::RightTop => 1.0,
        Align::Centre | Align::Left | Align::Right => 0.5,
    };
    [x, y]
}
