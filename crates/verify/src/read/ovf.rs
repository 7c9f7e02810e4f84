//! Reader of OpenVectorFormat files, with message structs written from the field numbers.
//!
//! Consumes the bytes of the file; promises that the parts lie gap-free as the format asks (offset,
//! vector blocks, shell and look-up table of each work plane, then job shell and job table) and that
//! every offset and count was checked, that each message holds its known fields and nothing else (written again it is
//! the same bytes), and that distances and bounds are those of its points. Vector blocks are decoded one at a time.

use std::collections::BTreeMap;
use terrace_core::math;

use prost::Message;

/// Bytes before the first work plane: magic and offset of the job table.
const HEADER: usize = 12;

#[derive(Clone, PartialEq, Message)]
struct JobTable {
    #[prost(int64, tag = "1")]
    shell: i64,
    #[prost(int64, repeated, tag = "2")]
    planes: Vec<i64>,
}

#[derive(Clone, PartialEq, Message)]
struct PlaneTable {
    #[prost(int64, tag = "1")]
    shell: i64,
    #[prost(int64, repeated, tag = "2")]
    blocks: Vec<i64>,
}

/// Laser and scanner settings: what a pen and the machine file state.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct MarkingParams {
    #[prost(float, tag = "1")]
    pub(crate) power_w: f32,
    #[prost(float, tag = "2")]
    pub(crate) speed_mm_s: f32,
    #[prost(float, tag = "3")]
    pub(crate) focus_shift_mm: f32,
    #[prost(float, tag = "4")]
    pub(crate) exposure_us: f32,
    #[prost(float, tag = "5")]
    pub(crate) jump_speed_mm_s: f32,
    #[prost(uint64, tag = "7")]
    pub(crate) rate_hz: u64,
    #[prost(float, tag = "11")]
    pub(crate) jump_delay_us: f32,
    #[prost(float, tag = "12")]
    pub(crate) laser_off_delay_us: f32,
    #[prost(float, tag = "13")]
    pub(crate) laser_on_delay_us: f32,
    #[prost(float, tag = "14")]
    pub(crate) mark_delay_us: f32,
    #[prost(float, tag = "15")]
    pub(crate) polygon_delay_us: f32,
    #[prost(string, tag = "26")]
    pub(crate) name: String,
}

#[derive(Clone, PartialEq, Message)]
struct Job {
    #[prost(message, optional, tag = "2")]
    about: Option<About>,
    #[prost(btree_map = "int32, message", tag = "3")]
    params: BTreeMap<i32, MarkingParams>,
    #[prost(btree_map = "int32, message", tag = "4")]
    parts: BTreeMap<i32, Part>,
    #[prost(int32, tag = "6")]
    planes: i32,
}

/// The metadata of the job.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct About {
    #[prost(string, tag = "3")]
    pub(crate) job: String,
    #[prost(string, tag = "4")]
    pub(crate) author: String,
    #[prost(string, tag = "5")]
    pub(crate) description: String,
    #[prost(message, optional, tag = "6")]
    pub(crate) bounds: Option<Bounds>,
}

#[derive(Clone, PartialEq, Message)]
struct Part {
    #[prost(string, tag = "1")]
    name: String,
}

/// The box of points, mm.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Bounds {
    #[prost(float, tag = "1")]
    x_min: f32,
    #[prost(float, tag = "2")]
    y_min: f32,
    #[prost(float, tag = "3")]
    x_max: f32,
    #[prost(float, tag = "4")]
    y_max: f32,
}

impl Bounds {
    /// The box of both.
    pub(crate) fn union(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        let (Some(a), Some(b)) = (a, b) else { return a.or(b) };
        Some(Self {
            x_min: a.x_min.min(b.x_min),
            y_min: a.y_min.min(b.y_min),
            x_max: a.x_max.max(b.x_max),
            y_max: a.y_max.max(b.y_max),
        })
    }
}

/// A work plane without its vector blocks.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct WorkPlane {
    #[prost(float, tag = "2")]
    pub(crate) x_mm: f32,
    #[prost(float, tag = "3")]
    pub(crate) y_mm: f32,
    #[prost(float, tag = "4")]
    pub(crate) z_mm: f32,
    #[prost(float, tag = "5")]
    pub(crate) x_deg: f32,
    #[prost(float, tag = "6")]
    pub(crate) y_deg: f32,
    #[prost(float, tag = "7")]
    pub(crate) z_deg: f32,
    #[prost(int32, tag = "8")]
    pub(crate) blocks: i32,
    #[prost(uint32, tag = "9")]
    pub(crate) repeats: u32,
    #[prost(int32, tag = "10")]
    pub(crate) number: i32,
    #[prost(string, tag = "11")]
    pub(crate) machine_type: String,
    #[prost(float, repeated, tag = "12")]
    pub(crate) more_axes: Vec<f32>,
    #[prost(message, optional, tag = "13")]
    pub(crate) about: Option<PlaneAbout>,
}

/// The metadata of a work plane.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct PlaneAbout {
    #[prost(double, tag = "1")]
    marked_mm: f64,
    #[prost(double, tag = "2")]
    jumped_mm: f64,
    #[prost(btree_map = "int32, message", tag = "3")]
    pub(crate) patches: BTreeMap<i32, Patch>,
    #[prost(message, optional, tag = "7")]
    pub(crate) bounds: Option<Bounds>,
}

/// The place of a plane on the part.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Patch {
    #[prost(float, tag = "2")]
    pub(crate) u_mm: f32,
    #[prost(float, tag = "3")]
    pub(crate) v_mm: f32,
}

#[derive(Clone, PartialEq, Message)]
struct Points {
    #[prost(float, repeated, tag = "1")]
    xy: Vec<f32>,
}

#[derive(Clone, PartialEq, prost::Oneof)]
enum Vectors {
    #[prost(message, tag = "1")]
    Sequence(Points),
    #[prost(message, tag = "2")]
    Hatches(Points),
    #[prost(message, tag = "3")]
    Dots(Points),
}

#[derive(Clone, PartialEq, Message)]
struct VectorBlock {
    #[prost(oneof = "Vectors", tags = "1, 2, 3")]
    vectors: Option<Vectors>,
    #[prost(int32, tag = "50")]
    params: i32,
    #[prost(uint64, tag = "54")]
    repeats: u64,
    #[prost(message, optional, tag = "100")]
    about: Option<VectorsAbout>,
    /// The block structures a surface; all settings of that are at their defaults.
    #[prost(message, optional, tag = "102")]
    structuring: Option<Empty>,
}

/// The metadata of a vector block.
#[derive(Clone, Copy, PartialEq, Message)]
struct VectorsAbout {
    #[prost(double, tag = "1")]
    marked_mm: f64,
    #[prost(double, tag = "2")]
    jumped_mm: f64,
    #[prost(int32, tag = "3")]
    part: i32,
    #[prost(message, optional, tag = "6")]
    bounds: Option<Bounds>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Empty {}

/// The only part.
const PART: i32 = 1;

/// How far a distance may be off that points in single precision give, of one line, mm.
const SINGLE: f64 = 5e-5;

/// One mark of a vector block.
pub(crate) struct OvfMark<'a> {
    /// x0 y0 x1 y1 ..., mm.
    pub(crate) xy: &'a [f32],
    /// Key of its marking parameters.
    pub(crate) params: i32,
    /// How often it is marked again.
    pub(crate) repeats: u64,
}

/// A file whose frame was checked.
pub(crate) struct OvfFile<'a> {
    bytes: &'a [u8],
    planes: Vec<i64>,
    shell: usize,
    /// Laser settings by key.
    pub(crate) params: BTreeMap<i32, MarkingParams>,
    pub(crate) about: About,
    /// The name of the part.
    pub(crate) part: String,
}

impl<'a> OvfFile<'a> {
    /// Reads header, job table and job shell.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        if bytes.get(..4) != Some(&[0x4c, 0x56, 0x46, 0x21]) {
            return Err("does not begin with the magic bytes of OVF".into());
        }
        let at = offset(bytes, 4)?;
        let (table, end) = message::<JobTable>(bytes, at)?;
        if end != bytes.len() {
            return Err("the job table does not end with the file".into());
        }
        let shell = place(table.shell)?;
        let (job, end) = message::<Job>(bytes, shell)?;
        if end != at {
            return Err("a gap lies between job shell and job table".into());
        }
        if usize::try_from(job.planes) != Ok(table.planes.len()) {
            return Err(format!("the job shell says {} work planes, the table {}", job.planes, table.planes.len()));
        }
        if place(table.planes.first().copied().unwrap_or(table.shell))? != HEADER {
            return Err("a gap lies after the header".into());
        }
        let part = job.parts.get(&PART).filter(|_| job.parts.len() == 1).ok_or("the job does not have one part")?;
        let (about, part) = (job.about.ok_or("the job says nothing of itself")?, part.name.clone());
        Ok(Self { bytes, planes: table.planes, shell, params: job.params, about, part })
    }

    /// How many work planes there are.
    pub(crate) fn len(&self) -> usize {
        self.planes.len()
    }

    /// Reads work plane `i` (below [`OvfFile::len`]); its marks go to `visit` in file order.
    pub(crate) fn plane(&self, i: usize, mut visit: impl FnMut(OvfMark<'_>)) -> Result<WorkPlane, String> {
        let start = place(self.planes[i])?;
        let table_at = offset(self.bytes, start)?;
        let (table, end) = message::<PlaneTable>(self.bytes, table_at)?;
        let next = self.planes.get(i + 1).map_or(Ok(self.shell), |&n| place(n))?;
        if end != next {
            return Err(format!("a gap lies after work plane {i}"));
        }
        let mut at = start + 8;
        let mut way = Way::default();
        for &block in &table.blocks {
            if place(block)? != at {
                return Err(format!("a vector block of work plane {i} is not where the table says"));
            }
            let (block, end) = message::<VectorBlock>(self.bytes, at)?;
            at = end;
            hand_over(&block, &mut visit)?;
            way.follow(&block).map_err(|what| format!("a vector block of work plane {i} {what}"))?;
        }
        if place(table.shell)? != at {
            return Err(format!("the shell of work plane {i} is not where the table says"));
        }
        let (plane, end) = message::<WorkPlane>(self.bytes, at)?;
        if end != table_at {
            return Err(format!("a gap lies inside work plane {i}"));
        }
        let about = plane.about.as_ref().ok_or_else(|| format!("work plane {i} says nothing of itself"))?;
        if !way.is(about.marked_mm, about.jumped_mm) || about.bounds != way.bounds {
            return Err(format!("the distances or bounds of work plane {i} are not those of its points"));
        }
        if usize::try_from(plane.blocks) != Ok(table.blocks.len()) {
            return Err(format!("work plane {i} says {} vector blocks, holds {}", plane.blocks, table.blocks.len()));
        }
        Ok(plane)
    }
}

/// The way of the beam through a work plane, from the middle of the field, mm.
#[derive(Default)]
struct Way {
    at: [f64; 2],
    marked: f64,
    jumped: f64,
    /// How many lines it has.
    lines: f64,
    bounds: Option<Bounds>,
}

impl Way {
    /// Follows a vector block, whose own figures are those of one repeat.
    fn follow(&mut self, block: &VectorBlock) -> Result<(), &'static str> {
        let mut own = Self { at: self.at, ..Self::default() };
        hand_over(block, &mut |mark| own.mark(mark.xy)).map_err(|_| "has no points")?;
        let about = block.about.ok_or("says nothing of itself")?;
        if about.part != PART || block.structuring.is_none() {
            return Err("is not of the part, or no structuring");
        }
        if !own.is(about.marked_mm, about.jumped_mm) || about.bounds != own.bounds {
            return Err("has other distances or bounds than its points");
        }
        self.at = own.at;
        self.marked += own.marked * (block.repeats as f64 + 1.0);
        self.jumped += own.jumped;
        self.lines += own.lines * (block.repeats as f64 + 1.0);
        self.bounds = Bounds::union(self.bounds, own.bounds);
        Ok(())
    }

    fn mark(&mut self, xy: &[f32]) {
        for (k, p) in xy.chunks_exact(2).enumerate() {
            let to = [f64::from(p[0]), f64::from(p[1])];
            let way = math::hypot(to[0] - self.at[0], to[1] - self.at[1]);
            *(if k == 0 { &mut self.jumped } else { &mut self.marked }) += way;
            self.at = to;
            self.lines += 1.0;
            let point = Bounds { x_min: p[0], y_min: p[1], x_max: p[0], y_max: p[1] };
            self.bounds = Bounds::union(self.bounds, Some(point));
        }
    }

    fn is(&self, marked_mm: f64, jumped_mm: f64) -> bool {
        let known = SINGLE * (1.0 + self.lines);
        (marked_mm - self.marked).abs() <= known && (jumped_mm - self.jumped).abs() <= known
    }
}

fn hand_over(block: &VectorBlock, visit: &mut impl FnMut(OvfMark<'_>)) -> Result<(), String> {
    let mut mark = |xy| visit(OvfMark { xy, params: block.params, repeats: block.repeats });
    match &block.vectors {
        Some(Vectors::Sequence(p)) if p.xy.len() >= 4 && p.xy.len().is_multiple_of(2) => mark(&p.xy),
        Some(Vectors::Hatches(p)) if p.xy.len().is_multiple_of(4) => p.xy.chunks_exact(4).for_each(mark),
        Some(Vectors::Dots(p)) if p.xy.len().is_multiple_of(2) => p.xy.chunks_exact(2).for_each(mark),
        Some(_) => return Err("a vector block has a broken number of coordinates".into()),
        None => return Err("a vector block holds no lines, hatches or points".into()),
    }
    Ok(())
}

/// A length-delimited message at `at`, and where it ends.
fn message<M: Message + Default>(bytes: &[u8], at: usize) -> Result<(M, usize), String> {
    let mut rest = bytes.get(at..).ok_or("an offset lies beyond the file")?;
    let message = M::decode_length_delimited(&mut rest).map_err(|e| format!("byte {at}: {e}"))?;
    let end = bytes.len() - rest.len();
    if message.encode_length_delimited_to_vec() != bytes[at..end] {
        return Err(format!("byte {at}: holds a field that is not known, twice or at its default"));
    }
    Ok((message, end))
}

/// The i64 offset that is stored at `at`.
fn offset(bytes: &[u8], at: usize) -> Result<usize, String> {
    let stored = at.checked_add(8).and_then(|end| bytes.get(at..end)).ok_or("the file ends inside an offset")?;
    place(i64::from_le_bytes(stored.try_into().map_err(|_| "the file ends inside an offset")?))
}

fn place(offset: i64) -> Result<usize, String> {
    usize::try_from(offset).map_err(|_| format!("offset {offset} is negative"))
}
