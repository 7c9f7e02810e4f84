//! Affine maps of the plane.

type Point = [f64; 2];

/// An affine map of the plane: x' = a x + c y + e, y' = b x + d y + f.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the letters of the equations above")]
pub struct Map {
    pub a: f64,
    pub b: f64,
    pub c: f64,
    pub d: f64,
    pub e: f64,
    pub f: f64,
}

impl Map {
    /// Scale, then shift.
    pub const fn scale(x: f64, y: f64, shift: Point) -> Self {
        Self { a: x, b: 0.0, c: 0.0, d: y, e: shift[0], f: shift[1] }
    }

    /// Moves points by a vector.
    pub const fn shift(by: Point) -> Self {
        Self::scale(1.0, 1.0, by)
    }

    /// Turns about the origin, by an angle from the x axis towards the y axis.
    pub(crate) fn turn(degrees: f64) -> Self {
        // Quarter turns are made exact: the cosine of pi / 2 in f64 is not 0.
        let (sin, cos) = match degrees.rem_euclid(360.0) {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            other => libm::sincos(other.to_radians()),
        };
        Self { a: cos, b: sin, c: -sin, d: cos, e: 0.0, f: 0.0 }
    }

    /// First `o`, then this.
    pub fn after(self, o: Self) -> Self {
        let [e, f] = self.at([o.e, o.f]);
        Self {
            a: self.a * o.a + self.c * o.b,
            b: self.b * o.a + self.d * o.b,
            c: self.a * o.c + self.c * o.d,
            d: self.b * o.c + self.d * o.d,
            e,
            f,
        }
    }

    /// The map that takes it back; it must be regular.
    pub fn inverse(self) -> Self {
        let det = self.a * self.d - self.b * self.c;
        let (a, b, c, d) = (self.d / det, -self.b / det, -self.c / det, self.a / det);
        Self { a, b, c, d, e: -(a * self.e + c * self.f), f: -(b * self.e + d * self.f) }
    }

    /// By how much it enlarges: the side of the square that a unit square's area makes.
    pub fn enlarges(self) -> f64 {
        (self.a * self.d - self.b * self.c).abs().sqrt()
    }

    /// Whether it keeps angles.
    pub fn is_similar(self) -> bool {
        let scale = self.enlarges();
        let near = |x: f64, y: f64| (x - y).abs() <= 1e-9 * scale;
        (near(self.a, self.d) && near(self.b, -self.c)) || (near(self.a, -self.d) && near(self.b, self.c))
    }

    /// The image of a point.
    pub fn at(self, [x, y]: Point) -> Point {
        [self.a * x + self.c * y + self.e, self.b * x + self.d * y + self.f]
    }

    /// Whether it keeps areas areas, and is finite.
    pub fn is_regular(self) -> bool {
        let det = self.a * self.d - self.b * self.c;
        det.is_finite() && det != 0.0 && self.e.is_finite() && self.f.is_finite()
    }

    /// Whether it takes the axes to the axes, up to rounding.
    pub fn is_aligned(self) -> bool {
        let [a, b, c, d] = [self.a, self.b, self.c, self.d].map(f64::abs);
        let tiny = 1e-6 * a.max(b).max(c).max(d);
        b.max(c) <= tiny || a.max(d) <= tiny
    }
}
