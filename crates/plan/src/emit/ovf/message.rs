//! The protobuf messages of OpenVectorFormat that a stepped job needs, by field number (package
//! `open_vector_format`, proto3). Units: mm, W, mm/s, µs. A field left out is zero.

use std::collections::BTreeMap;

use prost::Message;

#[derive(Clone, PartialEq, Message)]
pub(super) struct Job {
    #[prost(message, optional, tag = "2")]
    pub meta_data: Option<JobMetaData>,
    #[prost(btree_map = "int32, message", tag = "3")]
    pub marking_params: BTreeMap<i32, MarkingParams>,
    #[prost(btree_map = "int32, message", tag = "4")]
    pub parts: BTreeMap<i32, Part>,
    #[prost(int32, tag = "6")]
    pub num_work_planes: i32,
}

/// Field 1, the time of creation, stays out: the same job gives the same bytes.
#[derive(Clone, PartialEq, Message)]
pub(super) struct JobMetaData {
    #[prost(string, tag = "3")]
    pub job_name: String,
    #[prost(string, tag = "4")]
    pub author: String,
    #[prost(string, tag = "5")]
    pub description: String,
    #[prost(message, optional, tag = "6")]
    pub bounds: Option<Bounds>,
}

#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Bounds {
    #[prost(float, tag = "1")]
    pub x_min: f32,
    #[prost(float, tag = "2")]
    pub y_min: f32,
    #[prost(float, tag = "3")]
    pub x_max: f32,
    #[prost(float, tag = "4")]
    pub y_max: f32,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct MarkingParams {
    #[prost(float, tag = "1")]
    pub laser_power_w: f32,
    #[prost(float, tag = "2")]
    pub mark_speed_mm_s: f32,
    #[prost(float, tag = "3")]
    pub focus_shift_mm: f32,
    #[prost(float, tag = "4")]
    pub point_exposure_time_us: f32,
    #[prost(float, tag = "5")]
    pub jump_speed_mm_s: f32,
    #[prost(uint64, tag = "7")]
    pub repetition_rate_hz: u64,
    #[prost(float, tag = "11")]
    pub jump_delay_us: f32,
    #[prost(float, tag = "12")]
    pub laser_off_delay_us: f32,
    #[prost(float, tag = "13")]
    pub laser_on_delay_us: f32,
    #[prost(float, tag = "14")]
    pub mark_delay_us: f32,
    #[prost(float, tag = "15")]
    pub polygon_delay_us: f32,
    #[prost(string, tag = "26")]
    pub name: String,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Part {
    #[prost(string, tag = "1")]
    pub name: String,
}

/// Without its vector blocks (field 1), which stand before it in the file.
#[derive(Clone, PartialEq, Message)]
pub(super) struct WorkPlane {
    #[prost(float, tag = "2")]
    pub x_pos_mm: f32,
    #[prost(float, tag = "3")]
    pub y_pos_mm: f32,
    #[prost(float, tag = "4")]
    pub z_pos_mm: f32,
    #[prost(float, tag = "5")]
    pub x_rot_deg: f32,
    #[prost(float, tag = "6")]
    pub y_rot_deg: f32,
    #[prost(float, tag = "7")]
    pub z_rot_deg: f32,
    #[prost(int32, tag = "8")]
    pub num_blocks: i32,
    #[prost(int32, tag = "10")]
    pub work_plane_number: i32,
    #[prost(string, tag = "11")]
    pub machine_type: String,
    #[prost(float, repeated, tag = "12")]
    pub additional_axis_positions: Vec<f32>,
    #[prost(message, optional, tag = "13")]
    pub meta_data: Option<WorkPlaneMetaData>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct WorkPlaneMetaData {
    #[prost(double, tag = "1")]
    pub scan_distance_mm: f64,
    #[prost(double, tag = "2")]
    pub jump_distance_mm: f64,
    #[prost(btree_map = "int32, message", tag = "3")]
    pub patches: BTreeMap<i32, Patch>,
    #[prost(message, optional, tag = "7")]
    pub bounds: Option<Bounds>,
}

#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Patch {
    #[prost(float, tag = "2")]
    pub u_mm: f32,
    #[prost(float, tag = "3")]
    pub v_mm: f32,
}

/// A line sequence, hatches or a point sequence.
#[derive(Clone, PartialEq, Message)]
pub(super) struct VectorBlock {
    #[prost(message, optional, tag = "1")]
    pub line_sequence: Option<Points>,
    #[prost(message, optional, tag = "2")]
    pub hatches: Option<Points>,
    #[prost(message, optional, tag = "3")]
    pub point_sequence: Option<Points>,
    #[prost(int32, tag = "50")]
    pub marking_params_key: i32,
    #[prost(uint64, tag = "54")]
    pub repeats: u64,
    #[prost(message, optional, tag = "100")]
    pub meta_data: Option<VectorBlockMetaData>,
    /// Structuring; all its own fields are at their defaults.
    #[prost(message, optional, tag = "102")]
    pub micro_structuring: Option<Empty>,
}

/// x0 y0 x1 y1 …; of hatches, four numbers a line, of points, two. A packed list of floats is written as its bytes, which is the same
/// on the wire.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Points {
    #[prost(bytes = "vec", tag = "1")]
    pub xy_mm: Vec<u8>,
}

#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct VectorBlockMetaData {
    #[prost(double, tag = "1")]
    pub scan_distance_mm: f64,
    #[prost(double, tag = "2")]
    pub jump_distance_mm: f64,
    #[prost(int32, tag = "3")]
    pub part_key: i32,
    #[prost(message, optional, tag = "6")]
    pub bounds: Option<Bounds>,
}

#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Empty {}

#[derive(Clone, PartialEq, Message)]
pub(super) struct WorkPlaneLut {
    #[prost(int64, tag = "1")]
    pub shell: i64,
    #[prost(int64, repeated, tag = "2")]
    pub vector_blocks: Vec<i64>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct JobLut {
    #[prost(int64, tag = "1")]
    pub shell: i64,
    #[prost(int64, repeated, tag = "2")]
    pub work_planes: Vec<i64>,
}
