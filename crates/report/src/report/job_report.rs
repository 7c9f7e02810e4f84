//! `report.html`: the record of a job as one page to read, print and file.
//!
//! Consumes a [`Layout`], promises the properties of [`super`]. The page links to `layout.svg` beside
//! it and needs nothing else. Size: about 150 bytes a block, 600 kB at 3,500 blocks.

use std::fmt::Write;

use super::colour::hex;
use super::energy_map::EnergyMap;
use super::legend::seconds;
use super::page::{self, escape};
use super::table::share as shown_share;
use super::{Layout, energy, error_budget, length_text, measured_map, mm, pass_file, plain, record};
use terrace_core::diag::Message;
use terrace_core::duration::duration;
use terrace_core::geom::Nm;
use terrace_core::program::{Block, BlockId, PassId, Slope};

/// The report as the text of an HTML file.
pub fn report_html(job: &Layout<'_>, energy_map: &EnergyMap) -> String {
    let is_gridded = job.is_gridded();
    let job = &job.whole();
    let mut h = String::with_capacity(16_000 + 200 * job.blocks().len());
    h += &page::open(&format!("{}: job report", job.job), job.job, STYLE);
    let alt = format!("Blocks over the part, {} stops in machining order", job.blocks().len());
    record::picture(&mut h, &alt);
    verdict(&mut h, job);
    let _ = writeln!(
        h,
        "<p>Machine {}. {} stops, {} in all. \
         <a href=\"layout.svg\">Block layout (layout.svg)</a>{}, <a href=\"slope.svg\">the same by slope (slope.svg)</a></p>",
        escape(&job.machine.name),
        job.blocks().len(),
        duration(job.summary.time_s.total),
        (1..job.passes)
            .map(|k| format!(", <a href=\"{0}\">of pass {1} ({0})</a>", pass_file(k), k + 1))
            .collect::<String>(),
    );
    warnings(&mut h, &job.summary.warnings);
    h.push_str("<div class=\"row\">\n<div>\n");
    figures(&mut h, job, is_gridded);
    h.push_str("</div>\n<div>\n");
    times(&mut h, job);
    h.push_str("</div>\n</div>\n");
    candidates(&mut h, job);
    if let Some(part) = job.measured {
        measured_map::section(&mut h, part);
    }
    record::unmarked(&mut h, &job.scene.unmarked);
    record::histograms(&mut h, job.scene, &job.checked.program().pens);
    error_budget::section(&mut h, &job.summary.budget);
    defocus(&mut h, job);
    slopes(&mut h, job);
    energy::section(&mut h, job, energy_map);
    record::pens(&mut h, &job.checked.program().pens, job.machine);
    blocks(&mut h, job, is_gridded);
    h.push_str("</body>\n</html>\n");
    h
}

/// What this page adds to the common style.
pub(super) const STYLE: &str = ".verdict{border-left:4px solid #1d4e89;padding:.2em .8em;background:#eef4fb}\
#unmarked .fault td:first-child{color:#c00000;font-weight:600}.verdict li{margin:.2em 0}.verdict ul{padding-left:1.2em}\
.picture img{max-width:100%;max-height:32em;border:1px solid #ddd}\
.wide svg{max-width:100%;height:auto}.row>div{max-width:100%}\
@media(max-width:40em){body{margin:1em auto;font-size:15px}th,td{padding:.15em .4em}\
td,th{white-space:normal}#blocks td,#blocks th{white-space:nowrap;position:static}}";

/// What to know before anything else: what needs attention, what is not marked and why, and who attends and loads.
fn verdict(h: &mut String, job: &Layout<'_>) {
    let s = job.summary;
    let mut lines = vec![NOT_VERIFIED.to_owned(), warnings_line(s.warnings.len())];
    let share = |part: f64, whole: f64| shown_share(100.0 * part / whole);
    let lengths =
        [("off the part", s.skipped_off_part_mm), ("too steep", s.skipped_steep_mm), ("too small", s.skipped_small_mm)];
    let lengths = lengths
        .into_iter()
        .filter(|(_, mm)| *mm > 0.0)
        .map(|(why, mm)| format!("{why} {} ({})", length_text(mm), share(mm, s.texture_mm)));
    let dots = [("off the part", s.dots.off_part), ("too steep", s.dots.steep)];
    let dots = dots
        .into_iter()
        .filter(|(_, count)| *count > 0)
        .map(|(why, count)| format!("{why} {count} dots ({})", share(count as f64, s.dots.texture as f64)));
    let parts: Vec<String> = lengths.chain(dots).collect();
    let texture = texture_text(s);
    lines.push(if parts.is_empty() {
        format!("All of the texture is marked: {texture}.")
    } else {
        format!("Not marked of {texture}: {}.", parts.join(", "))
    });
    let least = if s.loading.is_least() { "at least " } else { "" };
    let total = duration(s.loading.total_s);
    lines.push(format!("A person attends {least}{total}: {}.", s.loading.sentence(s.blocks)));
    verdict_block(h, &lines);
}

/// How much texture there is: length of lines, number of dots.
fn texture_text(s: &terrace_plan::manifest::Summary) -> String {
    let dots = (s.dots.texture > 0).then(|| format!("{} dots", s.dots.texture));
    let length = (s.texture_mm > 0.0 || dots.is_none()).then(|| length_text(s.texture_mm));
    length.into_iter().chain(dots).collect::<Vec<_>>().join(" and ")
}

/// The report of a whole job as that of a rest of it, in which `left` is left: that is said first. Nothing is proved
/// of the rest yet.
pub fn of_rest(report: &str, left: &str) -> String {
    const FIRST: &str = "<div class=\"verdict\">\n<ul>\n";
    const OF_JOB: &str = ": all figures below are those of the whole job, those of the rest are in runsheet.txt.";
    let Some((before, after)) = report.split_once(FIRST) else { return report.to_owned() };
    // That of a rest says already what was left there; then follows what was proved.
    let mut lines = after.split_inclusive('\n').skip_while(|line| line.contains(OF_JOB));
    lines.next();
    let rest: String = lines.collect();
    format!("{before}{FIRST}<li>{}{OF_JOB}</li>\n<li>{NOT_VERIFIED}</li>\n{rest}", escape(left))
}

/// What the report says of verification where the folder was not verified before it was written.
pub const NOT_VERIFIED: &str =
    "terrace verify reads the files of this folder back and says whether they can be marked.";

/// How many warnings there are, in words.
pub(super) fn warnings_line(count: usize) -> String {
    match count {
        0 => "No warnings.".to_owned(),
        1 => "1 warning: see below.".to_owned(),
        n => format!("{n} warnings: see below."),
    }
}

/// Lines in the box at the top of the page.
pub(super) fn verdict_block(h: &mut String, lines: &[String]) {
    let lines: String = lines.iter().map(|line| format!("<li>{}</li>\n", escape(line))).collect();
    let _ = write!(h, "<div class=\"verdict\">\n<ul>\n{lines}</ul>\n</div>\n");
}

pub(super) fn warnings(h: &mut String, all: &[Message]) {
    let _ = writeln!(h, "<h2>Warnings: {}</h2>", if all.is_empty() { "none".into() } else { all.len().to_string() });
    all.iter().for_each(|message| page::message(h, message));
}

/// The figures of the job.
fn figures(h: &mut String, job: &Layout<'_>, is_gridded: bool) {
    let s = job.summary;
    let [columns, rows] = job.sections.count;
    let sections = if is_gridded { format!("{columns} x {rows}") } else { "none, windows lie freely".into() };
    let [z_lo, z_hi] = job.range(|b| b.z_lo, |b| b.z_hi);
    let [w, d] = job.texture_size().map(|v| mm(v, 3));
    let [fx, fy] = job.machine.usable_field().map(|v| mm(v, 3));
    let rows = [
        ("Method", escape(&s.method)),
        ("Passes", job.passes.to_string()),
        ("Set-ups", s.setups.max(1).to_string()),
        ("Stops", s.stops.to_string()),
        ("Stops merged into these", s.stops_merged.to_string()),
        ("Number of blocks", s.blocks.to_string()),
        ("Lower bound of stops", s.lower_bound_stops.filter(|&n| n > 0).map_or("not known".into(), |n| n.to_string())),
        ("Stops over their lower bound", s.over_bound().map_or("not known".into(), |r| plain(r, 3))),
        ("Sub-blocks", s.sub_blocks.to_string()),
        ("Sections, columns x rows", sections),
        ("Usable field", format!("{fx} x {fy} mm")),
        ("Part", format!("{} x {} x {} mm", plain(s.part_mm[0], 3), plain(s.part_mm[1], 3), plain(s.part_mm[2], 3))),
        ("Texture box", format!("{w} x {d} mm")),
        ("Height of marks", format!("{} to {} mm", mm(z_lo, 4), mm(z_hi, 4))),
        ("Worst defocus", format!("{} um", plain(s.worst_defocus_um, 2))),
        ("Worst defocus from the mean height", format!("{} um", plain(s.worst_defocus_mean_um, 2))),
        ("Worst incidence", format!("{} deg", plain(s.worst_incidence_deg, 2))),
        ("Farthest mark from the optical axis", format!("{} mm", plain(s.off_axis_mm.largest, 3))),
        ("95 % of the marks are as near to it as", format!("{} mm", plain(s.off_axis_mm.p95, 3))),
        ("Texture", length_text(s.texture_mm)),
        ("Marked", length_text(s.mark_mm)),
        ("Marked twice in overlaps", length_text(s.overlap_mm)),
        ("Skipped", length_text(s.skipped_mm)),
        ("&#8195;off the part", length_text(s.skipped_off_part_mm)),
        ("&#8195;too steep", length_text(s.skipped_steep_mm)),
        ("&#8195;too small", length_text(s.skipped_small_mm)),
        ("Dots", format!("{} of {}", s.dots.marked, s.dots.texture)),
        ("Jumps", length_text(s.jump_mm)),
        ("Seams", length_text(s.seam_mm)),
        ("Strokes after splitting", s.fragments.to_string()),
        ("Strokes cut", s.strokes_cut.to_string()),
        ("Figures kept whole", s.figures_whole.to_string()),
        ("Figures cut", s.figures_cut.to_string()),
    ];
    h.push_str("<h2>Figures</h2>\n<div class=\"wide\"><table>\n");
    for (name, value) in rows {
        let _ = writeln!(h, "<tr><td>{name}</td><td>{value}</td></tr>");
    }
    h.push_str("</table></div>\n");
}

/// The parts of the job time as a bar and as a table.
fn times(h: &mut String, job: &Layout<'_>) {
    let parts = seconds(job);
    let sum: f64 = parts.iter().map(|p| p.2).sum();
    let share = |s: f64| if sum > 0.0 { s / sum } else { 0.0 };
    h.push_str("<h2>Estimated time</h2>\n<svg width=\"420\" height=\"24\" viewBox=\"0 0 420 24\"");
    h.push_str(" preserveAspectRatio=\"none\" style=\"max-width:100%\" role=\"img\" aria-label=\"time split\">");
    let mut x = 0.0;
    for &(name, fill, s) in &parts {
        let fill = hex(fill);
        let w = 420.0 * share(s);
        let (at, width) = (plain(x, 2), plain(w, 2));
        let _ =
            write!(h, "<rect x=\"{at}\" width=\"{width}\" height=\"24\" fill=\"{fill}\"><title>{name}</title></rect>");
        x += w;
    }
    h.push_str("</svg>\n<div class=\"wide\"><table>\n<tr><th>part</th><th>s</th><th>time</th><th>share</th></tr>\n");
    for (name, fill, s) in parts {
        let fill = hex(fill);
        let _ = writeln!(
            h,
            "<tr><td><svg width=\"12\" height=\"12\"><rect width=\"12\" height=\"12\" fill=\"{fill}\"/></svg> {name}</td>\
             <td>{}</td><td>{}</td><td>{} %</td></tr>",
            plain(s, 2),
            duration(s),
            plain(100.0 * share(s), 1)
        );
    }
    let total = job.summary.time_s.total;
    let _ = writeln!(h, "<tr><th>total</th><th>{}</th><th>{}</th><th></th></tr>", plain(total, 2), duration(total));
    let loading = &job.summary.loading;
    let _ = writeln!(
        h,
        "<tr><td class=\"l\" style=\"max-width:24em\">with loading{}: {}</td><td>{}</td><td>{}</td><td></td></tr>\n</table></div>",
        if loading.is_least() { ", at least" } else { "" },
        escape(&loading.sentence(job.summary.blocks)),
        plain(loading.total_s, 2),
        duration(loading.total_s)
    );
}

/// The methods of partition that were compared.
fn candidates(h: &mut String, job: &Layout<'_>) {
    if job.summary.candidates.is_empty() {
        return;
    }
    h.push_str(
        "<h2>Methods compared</h2>\n<div class=\"wide\"><table>\n\
         <tr><th>method</th><th>stops</th><th>strokes</th><th>time</th><th>with loading</th></tr>\n",
    );
    for c in &job.summary.candidates {
        let (method, [time, total]) = (escape(&c.method), [c.time_s.total, c.total_s].map(duration));
        let _ = writeln!(
            h,
            "<tr><td>{method}</td><td>{}</td><td>{}</td><td>{time}</td><td>{total}</td></tr>",
            c.stops, c.fragments
        );
    }
    h.push_str("</table></div>\n");
}

/// How far the lowest and the highest mark of a block lie above its focus, um; negative below it.
fn deviations(b: &Block) -> [f64; 2] {
    [b.z_lo, b.z_hi].map(|z| (z - b.stop.lpfl).f64() / 1000.0)
}

/// The larger of the two deviations, without sign, um.
fn largest_deviation(b: &Block) -> f64 {
    deviations(b).into_iter().fold(0.0, |a, d| a.max(d.abs()))
}

/// The table of how far marks lie from the focus of their block, and of how high the marks of a block are: least, mean
/// and largest over the blocks.
fn defocus(h: &mut String, job: &Layout<'_>) {
    let blocks = job.blocks();
    if blocks.is_empty() {
        return;
    }
    h.push_str("<h2>Defocus of the blocks, um</h2>\n<div class=\"row\">\n<div class=\"wide\"><table>\n");
    h.push_str("<tr><th>over all blocks</th><th>min</th><th>mean</th><th>max</th></tr>\n");
    let values = |of_block: fn(&Block) -> f64| blocks.iter().map(of_block);
    spread_row(h, "lowest mark against focus", values(|b| deviations(b)[0]));
    spread_row(h, "highest mark against focus", values(|b| deviations(b)[1]));
    spread_row(h, "largest of the two, unsigned", values(largest_deviation));
    spread_row(h, "height of the marks", values(|b| (b.z_hi - b.z_lo).f64() / 1000.0));
    h.push_str("</table></div>\n");
    h.push_str("</div>\n");
}

/// A row with the least, the mean and the largest of some values.
fn spread_row(h: &mut String, name: &str, values: impl ExactSizeIterator<Item = f64> + Clone) {
    let mean = values.clone().sum::<f64>() / values.len() as f64;
    let lo = values.clone().fold(f64::INFINITY, f64::min);
    let hi = values.fold(f64::NEG_INFINITY, f64::max);
    let [lo, mean, hi] = [lo, mean, hi].map(|v| plain(v, 2));
    let _ = writeln!(h, "<tr><td>{name}</td><td>{lo}</td><td>{mean}</td><td>{hi}</td></tr>");
}

/// Slope effects over all blocks.
fn slopes(h: &mut String, job: &Layout<'_>) {
    let slopes: Vec<Slope> = (0..job.blocks().len()).map(|i| job.figures(i).slope).collect();
    if slopes.is_empty() {
        return;
    }
    h.push_str(
        "<h2>Slope under the marks</h2>\n<p>Dose: 1 as on a level surface with the job's own pens.</p>\n\
         <div class=\"wide\"><table>\n\
         <tr><th></th><th>mean of the blocks</th><th>worst mark</th></tr>\n",
    );
    let values = |of_slope: fn(&Slope) -> [f64; 2]| slopes.iter().map(of_slope);
    slope_row(h, "incidence, deg", values(Slope::incidence_deg), f64::max);
    slope_row(h, "stretch uphill", values(Slope::stretch), f64::max);
    slope_row(h, "dose", values(Slope::dose), f64::min);
    h.push_str("</table></div>\n");
}

/// A row with the mean over the blocks and the worst mark of some values, which are these two for every block.
fn slope_row(
    h: &mut String,
    name: &str,
    values: impl ExactSizeIterator<Item = [f64; 2]> + Clone,
    worse: fn(f64, f64) -> f64,
) {
    let mean = values.clone().map(|[mean, _]| mean).sum::<f64>() / values.len() as f64;
    let worst = values.map(|[_, worst]| worst).reduce(worse).unwrap_or(mean);
    let _ = writeln!(h, "<tr><td>{name}</td><td>{}</td><td>{}</td></tr>", plain(mean, 4), plain(worst, 4));
}

/// The table of all blocks.
fn blocks(h: &mut String, job: &Layout<'_>, is_gridded: bool) {
    let program = job.checked.program();
    let [first, second] = if is_gridded { ["section", "level"] } else { ["window x", "window y"] };
    let _ = write!(
        h,
        "<h2>Blocks in machining order</h2>\n<p>Heights{} in the part frame, stage targets as commanded, mm; incidence in deg. \
         Mark and jump: the way of the spot, mm. Time: that of the galvo, without stage and settling, s.</p>\n\
         <div class=\"wide\"><table id=\"blocks\">\n\
         <tr><th>block</th><th>{first}</th><th>{second}</th><th>focus (LPFL)</th><th>stage x</th>\
         <th>stage y</th><th>stage z</th><th>incidence</th><th>dose</th><th>strokes</th><th>mark</th><th>jump</th><th>time</th></tr>\n",
        if is_gridded { "" } else { " and centres of windows" },
    );
    let mut pass = PassId(0);
    for (i, b) in job.blocks().iter().enumerate() {
        if b.pass != pass {
            pass = b.pass;
            let _ = writeln!(h, "<tr><th colspan=\"13\">pass {}</th></tr>", pass.number());
        }
        let [x, y, z] = b.stage.0.map(|v| mm(Nm(v), 4));
        let [first, second] = if is_gridded {
            [format!("{},{}", b.stop.section.0[0], b.stop.section.0[1]), b.stop.level.to_string()]
        } else {
            [mm(Nm(b.stop.centre.x), 3), mm(Nm(b.stop.centre.y), 3)]
        };
        let slope = job.figures(i).slope;
        let angle = plain(slope.incidence_deg()[0], 2);
        let dose = plain(slope.dose()[0], 3);
        let _ = writeln!(
            h,
            "<tr><td>{}<td>{first}<td>{second}<td>{}<td>{x}<td>{y}<td>{z}<td>{angle}<td>{dose}<td>{}<td>{}<td>{}<td>{}",
            BlockId::new(i),
            mm(b.stop.lpfl, 4),
            b.strokes.len(),
            plain(program.mark_mm(b), 2),
            plain(program.jump_mm(b), 2),
            plain(job.figures(i).time_s, 2),
        );
    }
    h.push_str("</table></div>\n");
}
