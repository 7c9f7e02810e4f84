//! Mutants of files that carry the settings of their pens: LightBurn projects, lists for LMC cards and RTC boards.

use super::*;

const FORMATS: &str = "[\"lightburn\", \"lmc\", \"rtc\", \"linuxcnc\"]";

/// The wavy sheet on a machine with both cards and mirrored axes.
fn bench(board: &str, laser: &str, bits: u32) -> Bench {
    let profile = terrace_core::machine::PROFILES.iter().find(|(n, _)| *n == "xyz-zoom-40").expect("a profile").1;
    let profile =
        profile.replacen("swap_xy = false", "swap_xy = true", 1).replacen("mirror_x = false", "mirror_x = true", 1);
    let focus = bits / 4;
    let machine = format!(
        "{profile}\n[lmc]\nunits_per_mm = 1500\nlaser = {laser:?}\n[rtc]\nboard = {board:?}\nbits_per_mm = {bits}\n\
         focus_bits_per_mm = {focus}\nlist_memory = 200\n"
    );
    Bench::edited_beside(2.0, &[("machine.toml", machine.into_bytes())], |text| {
        let text = text.replacen("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"", 1);
        let text = text.replacen("\"z-range\"", "\"z-range\", min_mark = \"2 um\"", 1);
        text.replacen("[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]", FORMATS, 1)
    })
}

#[test]
fn files_of_cards_verify_in_all_units() {
    for (board, laser, bits) in [("rtc4", "fiber", 1_500), ("rtc5", "co2", 20_000), ("rtc6", "fiber", 25_000)] {
        let bench = bench(board, laser, bits);
        assert!(bench.plan.summary.blocks > bench.plan.summary.stops);
        let proof = verified(&bench.write());
        assert!(proof.ok, "{}", proof.to_text());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn agreement_reports_files_of_cards_that_differ_from_the_program() {
    let bench = bench("rtc5", "fiber", 20_000);
    let name = |ending: &str| Program::block_file(terrace_core::program::BlockId::new(3), ending);
    let text = |from: &str, old: &str, new: &str, ending: &str| {
        let proof = bench.damaged(&name(ending), |b| replace(b, from, old, new));
        assert_only("agreement", &proof);
    };
    text("<speed", "\"1000\"", "\"1001\"", "lbrn2");
    text("<maxPower ", "\"60\"", "\"50\"", "lbrn2");
    text("<numPasses", "\"1\"", "\"2\"", "lbrn2");
    text("<XForm>", "20.000000", "20.000001", "lbrn2");
    text("<PrimList>", "L0 1", "L1 2", "lbrn2");
    text("focus", "focus ", "focus 1", "rtc");
    text("\nmark ", "mark ", "mark 1", "rtc");
    text("power", "power 2", "power 3", "rtc");
    text("laser_delays", "100", "101", "rtc");
    text("list 1", "list 1", "list 2", "rtc");
    // Low bytes of a mark's x, of the mark speed and of a delay; and a command that the card does not know.
    for (command, word) in [(0x8005u16, 1), (0x800C, 1), (0x8007, 1), (0x8001, 0)] {
        let proof = bench.damaged(&name("lmc"), |b| {
            let at = b.chunks(12).position(|c| c[..2] == command.to_le_bytes()).expect("the command is there");
            b[12 * at + 2 * word] ^= 0x40;
        });
        assert_only("agreement", &proof);
    }
    let proof = bench.damaged(&name("lmc"), |b| b.truncate(b.len() - 12));
    assert_only("agreement", &proof);
}
