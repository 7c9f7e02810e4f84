use super::*;
use terrace_core::program::{PenId, sample};

fn sample_file() -> (Program, Vec<u8>) {
    let (program, origin) = sample::program();
    let machine = Machine::built_in("xyz-galvo-40").expect("profile");
    let bytes = write(&Checked::unchecked(program.clone(), origin), &machine, "hood", "hood.stl");
    (program, bytes)
}

/// Reads messages and remembers which bytes were read.
struct Reader<'a> {
    bytes: &'a [u8],
    read: Vec<bool>,
}

impl Reader<'_> {
    fn take(&mut self, start: usize, len: usize) {
        for read in &mut self.read[start..start + len] {
            assert!(!*read, "a byte has one meaning");
            *read = true;
        }
    }
    fn offset(&mut self, at: i64) -> i64 {
        let at = at as usize;
        self.take(at, 8);
        i64::from_le_bytes(self.bytes[at..at + 8].try_into().expect("eight bytes"))
    }
    fn message<M: Message + Default>(&mut self, at: i64) -> M {
        let mut rest = &self.bytes[at as usize..];
        let message = M::decode_length_delimited(&mut rest).expect("message");
        self.take(at as usize, self.bytes.len() - at as usize - rest.len());
        message
    }
}

#[test]
fn every_byte_belongs_to_one_message_of_the_layout() {
    let (program, bytes) = sample_file();
    let mut r = Reader { bytes: &bytes, read: vec![false; bytes.len()] };
    assert_eq!(&bytes[..4], b"LVF!");
    r.take(0, 4);
    let lut_at = r.offset(4);
    let lut: JobLut = r.message(lut_at);
    let job: Job = r.message(lut.shell);
    assert_eq!((job.num_work_planes as usize, lut.work_planes.len()), (3, 3));
    assert_eq!(job.marking_params.keys().copied().collect::<Vec<_>>(), [1, 2]);
    assert_eq!(job.parts[&1].name, "hood.stl");
    let edge = &job.marking_params[&2];
    assert_eq!((edge.laser_power_w, edge.mark_speed_mm_s, edge.repetition_rate_hz), (3.5, 400.0, 80_000));
    assert_eq!((edge.laser_off_delay_us, edge.laser_on_delay_us), (80.0, 50.0));
    for (i, &start) in lut.work_planes.iter().enumerate() {
        let plane_lut_at = r.offset(start);
        let plane_lut: WorkPlaneLut = r.message(plane_lut_at);
        let shell: WorkPlane = r.message(plane_lut.shell);
        let block = &program.blocks[i];
        assert_eq!(shell.work_plane_number as usize, i);
        assert_eq!([shell.x_pos_mm, shell.y_pos_mm, shell.z_pos_mm], block.stage.0.map(single_mm));
        assert_eq!(shell.machine_type, "terrace/xyz-galvo2d/x-part/y-part/z-head");
        assert_eq!(shell.num_blocks as usize, plane_lut.vector_blocks.len());
        let mut points = Vec::new();
        for &at in &plane_lut.vector_blocks {
            let vectors: VectorBlock = r.message(at);
            assert!(vectors.micro_structuring.is_some());
            assert_eq!(vectors.repeats, if vectors.marking_params_key == 2 { 2 } else { 0 });
            let bytes = vectors.line_sequence.or(vectors.hatches).expect("points").xy_mm;
            let (floats, rest) = bytes.as_chunks();
            assert!(rest.is_empty());
            points.extend(floats.iter().map(|&float| f32::from_le_bytes(float)));
        }
        let expected: Vec<f32> = program
            .strokes_of(block)
            .iter()
            .flat_map(|s| program.points_of(s).iter().flat_map(|p| [p.x, p.y]).map(|nm| single_mm(i64::from(nm))))
            .collect();
        assert_eq!(points, expected);
    }
    assert!(r.read.iter().all(|&read| read), "no gaps");
}

#[test]
fn runs_of_hatches_share_a_vector_block_and_the_order_is_kept() {
    let (program, _) = sample_file();
    let blocks = |i: usize| program.strokes_of(&program.blocks[i]);
    assert_eq!(run_length(blocks(0)), 2);
    assert_eq!(run_length(blocks(2)), 1, "a loop stands alone");
    assert_eq!(run_length(&blocks(2)[1..]), 1);
    let mut other_pen = blocks(0).to_vec();
    other_pen[1].pen = PenId(1);
    assert_eq!(run_length(&other_pen), 1);
    let many = vec![blocks(0)[0]; MOST_POINTS];
    assert_eq!(run_length(&many), MOST_POINTS / 2);
}

#[test]
fn bounds_hold_all_points_in_controller_coordinates() {
    let (program, origin) = sample::program();
    let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
    machine.scanner.mirror_y = true;
    let bytes = write(&Checked::unchecked(program, origin), &machine, "", "");
    let lut_at = i64::from_le_bytes(bytes[4..12].try_into().expect("eight bytes"));
    let lut = JobLut::decode_length_delimited(&bytes[lut_at as usize..]).expect("table");
    let job = Job::decode_length_delimited(&bytes[lut.shell as usize..]).expect("job");
    let bounds = job.meta_data.and_then(|m| m.bounds).expect("bounds");
    let expected = Bounds { x_min: -5.0, y_min: -20.0, x_max: single_mm(19_999_999), y_max: 0.5 };
    assert_eq!(bounds, expected);
}
