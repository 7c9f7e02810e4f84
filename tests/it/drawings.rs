//! One drawing for each way in which programs write SVG and CSS: what is marked of it is what Chromium shows, has the
//! length that a calculation gives, or the drawing is refused with the code of the cause.
//!
//! The drawings of `fixtures/drawings` are of Illustrator's, Inkscape's, CorelDRAW's, Figma's, KiCad's and matplotlib's
//! kind (`svg`, `svg2`, `svg3`), of spellings (`svg4`, `svg5`), of one selector or one transparent colour each (`sel`),
//! and of page headers (`page`). Each takes the size that it states.

use std::path::PathBuf;

use rayon::prelude::*;

use crate::support::chromium::{Ink, Scale, pictures};
use crate::support::seen::{PER_MM, SPOT, Verdict, codes, judge, length, load};
use crate::support::{JobText, fixture, folder, number, summary_of};
use terrace_input::texture::{Marking, Size, StrokeMode};

/// What is to become of a drawing.
#[derive(Clone, Copy)]
struct Outcome {
    /// Where it is read its marks are compared with Chromium's picture.
    is_shown: bool,
    /// Of this drawing instead of its own.
    like: Option<&'static str>,
    /// Where it is read it has marks of this length, mm, as [`measured`] takes it.
    mm: Option<f64>,
    /// The same of the lines along its strokes.
    line_mm: Option<f64>,
    /// It may be refused with one or more of these codes.
    refusals: &'static [&'static str],
    /// It must be refused.
    is_refused: bool,
    /// Any marks are right where there is a warning with one of these codes.
    warnings: &'static [&'static str],
    /// There must be one.
    is_warned: bool,
}

/// Marked as Chromium shows it. Where that is nothing, `texture-empty` says so.
const SHOWN: Outcome = Outcome {
    is_shown: true,
    like: None,
    mm: None,
    line_mm: None,
    refusals: &[],
    is_refused: false,
    warnings: &[],
    is_warned: false,
};

/// Not to be compared with a picture: it has a length.
const MEASURED: Outcome = Outcome { is_shown: false, ..SHOWN };

/// Browsers show less of it than the program that wrote it: there is a warning or a refusal.
const WARNED: Outcome = Outcome { is_warned: true, ..MEASURED };

/// A line over half of a page of 40 mm.
const LINE_OF_20: Outcome = line(20.0);

/// Refusals of drawings that say what moves an element in a way that is not supported.
const TRANSFORM: &[&str] = &["svg-transform", "svg-css"];

/// Refusals of colours.
const COLOUR: &[&str] = &["svg-paint", "svg-css"];

const fn refused(codes: &'static [&'static str]) -> Outcome {
    Outcome { refusals: codes, is_refused: true, ..MEASURED }
}

const fn line(mm: f64) -> Outcome {
    Outcome { line_mm: Some(mm), ..MEASURED }
}

impl Outcome {
    const fn or(self, refusals: &'static [&'static str]) -> Self {
        Self { refusals, ..self }
    }

    const fn with_warnings(self, warnings: &'static [&'static str]) -> Self {
        Self { warnings, ..self }
    }

    const fn like(self, file: &'static str) -> Self {
        Self { like: Some(file), ..self }
    }

    const fn mm(self, mm: f64) -> Self {
        Self { mm: Some(mm), ..self }
    }
}

/// Lengths are those of lines 0.05 mm apart that end 0.01 mm before a border: a square of 10 mm has 200 of 9.98 mm.
#[rustfmt::skip]
const OUTCOMES: &[(&str, Outcome)] = &[
    ("svg/affinity_root_style.svg", refused(&["svg-size"])),
    ("svg/arc_flags_compact.svg", SHOWN),
    ("svg/bom_ws.svg", SHOWN),
    ("svg/cairo_glyphs.svg", SHOWN),
    ("svg/context_fill.svg", SHOWN.or(&["svg-paint"])),
    ("svg/corel_white_FEFEFE.svg", SHOWN.mm(9980.0)),
    ("svg/corel_white_page_FEFEFE.svg", SHOWN.mm(1996.0)),
    ("svg/css_attr_then_bad_style.svg", SHOWN),
    ("svg/css_bad_strokewidth.svg", SHOWN),
    ("svg/css_case.svg", SHOWN.mm(792.0)),
    ("svg/css_d.svg", SHOWN.mm(1996.0)),
    ("svg/css_escape_class.svg", SHOWN),
    ("svg/css_geometry.svg", SHOWN),
    ("svg/css_html_comment.svg", SHOWN),
    ("svg/css_is_where.svg", SHOWN),
    ("svg/css_media_print.svg", SHOWN.mm(1996.0)),
    ("svg/css_nesting.svg", refused(&["svg-xml"])),
    ("svg/css_not_hides.svg", SHOWN.mm(1276.8)),
    ("svg/css_nth_not.svg", SHOWN),
    ("svg/css_oklch_sheet.svg", SHOWN.mm(15984.0)),
    ("svg/css_rotate_prop.svg", SHOWN.or(TRANSFORM)),
    ("svg/css_scale_prop.svg", SHOWN.or(TRANSFORM).mm(17988.0)),
    ("svg/css_style_in_body_ns.svg", SHOWN),
    ("svg/css_supports.svg", SHOWN),
    ("svg/css_transform_deg.svg", SHOWN.or(TRANSFORM)),
    ("svg/css_transform_px_unitless.svg", SHOWN.or(TRANSFORM)),
    ("svg/css_transform_sheet.svg", SHOWN.or(TRANSFORM)),
    ("svg/css_translate_prop.svg", SHOWN.or(TRANSFORM).mm(1996.0)),
    ("svg/css_var_fallback.svg", SHOWN.mm(1996.0)),
    ("svg/css_var_root.svg", SHOWN.mm(15984.0)),
    ("svg/device_cmyk.svg", SHOWN.or(COLOUR)),
    ("svg/figma_alpha_mask_grey.svg", SHOWN),
    ("svg/figma_clip.svg", SHOWN),
    ("svg/figma_inside_stroke.svg", SHOWN),
    ("svg/figma_luminance_grey.svg", SHOWN.or(&["svg-effect"])),
    ("svg/figma_p3.svg", SHOWN.mm(6889.2)),
    ("svg/figma_p3_none_inherit.svg", SHOWN),
    ("svg/figma_p3_white.svg", SHOWN.mm(15984.0)),
    ("svg/fill_transparent_kw.svg", SHOWN),
    ("svg/flowroot_text.svg", WARNED.with_warnings(&["svg-flow-text"])),
    ("svg/gradient_no_stops.svg", SHOWN.or(&["svg-paint"])),
    ("svg/hairline_inkscape.svg", MEASURED.mm(120.0)),
    ("svg/hairline_inkscape_group.svg", MEASURED.mm(120.0)),
    ("svg/icc_color.svg", SHOWN.like("svg/icc_color_srgb.svg").or(COLOUR)),
    ("svg/illustrator_entities.svg", SHOWN.mm(6595.6)),
    ("svg/illustrator_noswitch.svg", SHOWN.mm(5996.0)),
    ("svg/inkscape_swatch.svg", SHOWN),
    ("svg/kicad_text_opacity0.svg", SHOWN),
    ("svg/matplotlib_like.svg", SHOWN),
    ("svg/mesh_and_hatch.svg", SHOWN.or(&["svg-paint"])),
    ("svg/mpl_symbol_overflow.svg", SHOWN),
    ("svg/no_ns_inkscape_plain.svg", MEASURED.with_warnings(&["svg-namespace"]).mm(1996.0)),
    ("svg/path_after_z.svg", SHOWN),
    ("svg/path_numbers.svg", SHOWN),
    ("svg/pathlength_dash.svg", SHOWN),
    ("svg/prefix_ns.svg", SHOWN),
    ("svg/reqext_shape_outside_switch.svg", SHOWN.mm(1996.0)),
    ("svg/smil.svg", SHOWN.or(&["svg-animation", "svg-effect"]).with_warnings(&["svg-animation"])),
    ("svg/swatch_white_over_black.svg", SHOWN.mm(15984.0)),
    ("svg/syslang_outside_switch.svg", SHOWN.mm(1996.0)),
    ("svg/text_display_none.svg", SHOWN),
    ("svg/text_whitespace_only.svg", SHOWN),
    ("svg/transform_deg_attr.svg", SHOWN.or(TRANSFORM)),
    ("svg/transform_origin_attr.svg", SHOWN.or(TRANSFORM)),
    ("svg/transform_px_attr.svg", SHOWN.or(TRANSFORM)),
    ("svg/transform_syntax.svg", SHOWN),
    ("svg/translucent_tints.svg", SHOWN.with_warnings(&["svg-opacity"])),
    ("svg/unit_mix.svg", SHOWN),
    ("svg/vbox_aspect.svg", SHOWN),
    ("svg/white_FFFFFE.svg", SHOWN.mm(15984.0)),
    ("svg/white_names.svg", SHOWN.with_warnings(&["texture-light"])),
    ("svg/white_translucent_over_black.svg", SHOWN.mm(17988.0)),
    ("svg/zero_length_caps.svg", SHOWN),
    ("svg2/a2_display_unknown.svg", SHOWN),
    ("svg2/a3_important_bad.svg", SHOWN),
    ("svg2/a4_hex5.svg", SHOWN),
    ("svg2/a5_unset_initial.svg", SHOWN),
    ("svg2/a6_opacity_bad.svg", SHOWN),
    ("svg2/a7_fillrule_bad.svg", SHOWN.mm(9980.0)),
    ("svg2/b_FAFAFA.svg", SHOWN.mm(9980.0)),
    ("svg2/b_FCFCFC.svg", SHOWN.mm(9980.0)),
    ("svg2/b_FDFDFD.svg", SHOWN.mm(9980.0)),
    ("svg2/b_FEFEFE.svg", SHOWN.mm(9980.0)),
    ("svg2/b_FFFFFE.svg", SHOWN.mm(9980.0)),
    ("svg2/d1.svg", SHOWN),
    ("svg2/d2_feather.svg", SHOWN),
    ("svg2/d3_polyline.svg", SHOWN),
    ("svg2/d4_curve.svg", SHOWN),
    ("svg2/d5_multi_subpath.svg", SHOWN),
    ("svg2/dash1_pathlength.svg", SHOWN.mm(298.0)),
    ("svg2/dash2_neg.svg", SHOWN),
    ("svg2/dash3_n0.svg", SHOWN),
    ("svg2/e1_g_attr.svg", SHOWN.or(&["svg-marker"])),
    ("svg2/e2_g_style.svg", SHOWN.or(&["svg-marker"])),
    ("svg2/e3_css_g.svg", SHOWN.or(&["svg-marker"])),
    ("svg2/e4_use.svg", SHOWN.or(&["svg-marker"])),
    ("svg2/e5_marker_shorthand_g.svg", SHOWN.or(&["svg-marker"])),
    ("svg2/e6_own.svg", SHOWN.or(&["svg-marker"])),
    ("svg2/e7_svg_root.svg", SHOWN.or(&["svg-marker"])),
    ("svg2/f1_reqfeatures.svg", SHOWN),
    ("svg2/f2_g_reqext.svg", SHOWN),
    ("svg2/f3_switch_empty_reqext.svg", SHOWN),
    ("svg2/f4_switch_lang.svg", SHOWN),
    ("svg2/i1_clip_bbox_transform.svg", SHOWN.mm(8988.0)),
    ("svg2/i2_clip_user_transform.svg", SHOWN.mm(8988.0)),
    ("svg2/i3_clip_child_opacity.svg", SHOWN.mm(8988.0)),
    ("svg2/i4_clip_child_fillnone.svg", SHOWN.mm(8988.0)),
    ("svg2/i5_clip_child_display_none.svg", SHOWN),
    ("svg2/i6_clip_use_g.svg", SHOWN.or(&["svg-effect"])),
    ("svg2/i7_mask_on_mask.svg", SHOWN.or(&["svg-effect"])),
    ("svg2/i8_clip_stroke_only.svg", SHOWN.mm(8988.0)),
    ("svg2/i9_clip_rect_prop.svg", SHOWN.or(&["svg-effect", "svg-css"])),
    ("svg2/j00.svg", SHOWN),
    ("svg2/j01.svg", SHOWN),
    ("svg2/j02.svg", SHOWN),
    ("svg2/j03.svg", SHOWN),
    ("svg2/j04.svg", SHOWN),
    ("svg2/j05.svg", SHOWN),
    ("svg2/j06.svg", SHOWN),
    ("svg2/j07.svg", SHOWN),
    ("svg2/j08.svg", refused(&["svg-text"])),
    ("svg2/j09.svg", SHOWN),
    ("svg2/j10.svg", SHOWN),
    ("svg2/j11.svg", SHOWN),
    ("svg2/j12.svg", SHOWN),
    ("svg2/j13.svg", SHOWN),
    ("svg2/k1_one_stop.svg", SHOWN),
    ("svg2/k2_two_same.svg", SHOWN),
    ("svg2/k3_one_stop_transparent.svg", SHOWN),
    ("svg2/k4_chain.svg", SHOWN),
    ("svg2/k5_radial_one.svg", SHOWN),
    ("svg2/k6_stroke_hidden_gradient.svg", SHOWN),
    ("svg2/k7_fill_opacity0_gradient.svg", SHOWN),
    ("svg2/k8_two_opaque_to_transparent_same.svg", SHOWN),
    ("svg2/v1_flatcam.svg", SHOWN),
    ("svg2/v2_offset.svg", SHOWN),
    ("svg3/aspect_mm.svg", SHOWN),
    ("svg3/aspect_none.svg", SHOWN),
    ("svg3/aspect_slice.svg", SHOWN),
    ("svg3/color_fns.svg", SHOWN),
    ("svg3/corel_classes_only.svg", SHOWN),
    ("svg3/gz_named_svg.svg", SHOWN.like("svg3/miter_default.svg")),
    ("svg3/html_link.svg", SHOWN.or(&["svg-external"])),
    ("svg3/image_href_same_fragment.svg", SHOWN),
    ("svg3/mesh_text_els.svg", WARNED.with_warnings(&["svg-flow-text"])),
    ("svg3/miter_default.svg", SHOWN),
    ("svg3/nested_transform_attr_svg.svg", SHOWN.or(TRANSFORM)),
    ("svg3/nonscaling_mm.svg", SHOWN.or(&["svg-effect"])),
    ("svg3/opacity_zero_group_pct.svg", SHOWN),
    ("svg3/paint_order_stroke.svg", SHOWN),
    ("svg3/pi_stylesheet.svg", SHOWN.or(&["svg-external"])),
    ("svg3/rect_pct_r.svg", SHOWN),
    ("svg3/rgb_float_percent.svg", SHOWN),
    ("svg3/stroke_pct.svg", SHOWN),
    ("svg3/style_type_odd.svg", SHOWN),
    ("svg3/use_external_symbol.svg", SHOWN.or(&["svg-external"])),
    ("svg3/use_width_symbol.svg", SHOWN),
    ("svg3/visibility_children.svg", SHOWN),
    ("svg4/case10_none_space.svg", SHOWN),
    ("svg4/case11_none_semicolon.svg", SHOWN),
    ("svg4/case1_fill_None_attr.svg", SHOWN),
    ("svg4/case2_stroke_None_attr.svg", SHOWN),
    ("svg4/case3_fill_None_on_group.svg", SHOWN),
    ("svg4/case4_Transparent.svg", SHOWN),
    ("svg4/case5_display_None.svg", SHOWN),
    ("svg4/case6_EvenOdd.svg", SHOWN.mm(9980.0)),
    ("svg4/case7_cap_Round.svg", SHOWN),
    ("svg4/case8_colour_names.svg", SHOWN),
    ("svg4/case9_prop_upper.svg", SHOWN),
    ("svg4/cond_charset_ns.svg", SHOWN),
    ("svg4/cond_fontface.svg", SHOWN),
    ("svg4/cond_keyframes.svg", SHOWN.or(&["svg-animation", "svg-css"])),
    ("svg4/cond_media_all.svg", SHOWN),
    ("svg4/sel_attr_ops.svg", SHOWN),
    ("svg4/sel_descendant_child_sibling.svg", SHOWN),
    ("svg4/sel_first_last.svg", SHOWN),
    ("svg4/sel_ns_star.svg", SHOWN),
    ("svg4/sel_nth.svg", SHOWN),
    ("svg4/sel_pseudo_hover.svg", SHOWN),
    ("svg5/s00.svg", SHOWN),
    ("svg5/s01.svg", SHOWN),
    ("svg5/s02.svg", SHOWN),
    ("svg5/s03.svg", SHOWN),
    ("svg5/s04.svg", SHOWN),
    ("svg5/s05.svg", SHOWN),
    ("svg5/s06.svg", SHOWN),
    ("svg5/s07.svg", SHOWN),
    ("svg5/s08.svg", SHOWN),
    ("svg5/s09.svg", SHOWN),
    ("svg5/s10.svg", SHOWN),
    ("svg5/s11.svg", SHOWN),
    ("svg5/s12.svg", SHOWN),
    ("svg5/s13.svg", SHOWN),
    ("svg5/s14.svg", SHOWN),
    ("svg5/s15.svg", SHOWN),
    ("svg5/s16.svg", SHOWN),
    ("svg5/s17.svg", SHOWN),
    ("svg5/s18.svg", SHOWN.or(&["svg-css"])),
    ("svg5/s19.svg", SHOWN),
    ("svg5/t0_import_in_comment.svg", SHOWN),
    ("svg5/t1_style_after.svg", SHOWN),
    ("svg5/t2_class_ws.svg", SHOWN),
    ("svg5/t3_unclosed_rule.svg", SHOWN),
    ("svg5/t4_bad_rule_before.svg", SHOWN),
    ("svg5/t5_selector_comment.svg", SHOWN),
    ("svg5/t6_list_with_bad.svg", SHOWN),
    ("svg5/t7_at_unknown_semicolon.svg", SHOWN),
    ("svg5/t8_string_brace.svg", SHOWN),
    ("svg5/u0.svg", SHOWN),
    ("svg5/u1.svg", SHOWN),
    ("svg5/u2.svg", SHOWN),
    ("svg5/u3.svg", SHOWN),
    ("svg5/u4.svg", SHOWN),
    ("svg5/u5.svg", SHOWN),
    ("svg5/u6.svg", SHOWN.or(&["svg-external", "svg-effect"])),
    ("svg5/v0.svg", SHOWN),
    ("svg5/v1.svg", SHOWN),
    ("svg5/v2.svg", SHOWN),
    ("svg5/v3.svg", SHOWN),
    ("svg5/v4.svg", SHOWN),
    ("svg5/v5.svg", SHOWN),
    ("svg5/v6.svg", SHOWN.or(&["svg-paint"])),
    ("svg5/w0_href_both.svg", SHOWN),
    ("svg5/w1_id_case.svg", SHOWN),
    ("svg5/w2_dup_id.svg", SHOWN),
    ("svg5/w3_id_encoded.svg", SHOWN.with_warnings(&["svg-use"])),
    ("sel/00.svg", SHOWN),
    ("sel/01.svg", SHOWN),
    ("sel/02.svg", SHOWN),
    ("sel/03.svg", SHOWN),
    ("sel/04.svg", SHOWN),
    ("sel/05.svg", SHOWN),
    ("sel/06.svg", SHOWN),
    ("sel/07.svg", SHOWN),
    ("sel/08.svg", SHOWN),
    ("sel/09.svg", SHOWN),
    ("sel/10.svg", SHOWN),
    ("sel/11.svg", SHOWN),
    ("sel/12.svg", SHOWN),
    ("sel/13.svg", SHOWN),
    ("sel/14.svg", SHOWN),
    ("sel/15.svg", SHOWN),
    ("sel/16.svg", SHOWN),
    ("sel/17.svg", SHOWN),
    ("sel/18.svg", SHOWN),
    ("sel/19.svg", SHOWN),
    ("sel/20.svg", SHOWN),
    ("sel/21.svg", SHOWN),
    ("sel/22.svg", SHOWN),
    ("sel/23.svg", SHOWN),
    ("sel/24.svg", SHOWN),
    ("sel/25.svg", SHOWN),
    ("sel/26.svg", SHOWN),
    ("sel/27.svg", SHOWN),
    ("sel/28.svg", SHOWN),
    ("sel/29.svg", SHOWN),
    ("sel/30.svg", SHOWN),
    ("sel/31.svg", SHOWN),
    ("sel/32.svg", SHOWN),
    ("sel/33.svg", SHOWN),
    ("sel/34.svg", SHOWN),
    ("sel/35.svg", SHOWN),
    ("sel/36.svg", SHOWN),
    ("sel/c00.svg", SHOWN),
    ("sel/c01.svg", SHOWN),
    ("sel/c02.svg", SHOWN),
    ("sel/c03.svg", SHOWN),
    ("sel/c04.svg", SHOWN),
    ("sel/c05.svg", SHOWN),
    ("sel/c06.svg", SHOWN),
    ("sel/c07.svg", SHOWN),
    ("sel/c08.svg", SHOWN),
    ("sel/c09.svg", SHOWN),
    ("sel/c10.svg", SHOWN),
    ("sel/c11.svg", SHOWN),
    ("sel/c12.svg", SHOWN),
    ("sel/c13.svg", SHOWN),
    ("page/cm_in.svg", LINE_OF_20),
    ("page/comma_dec.svg", refused(&["svg-size"])),
    ("page/commas.svg", LINE_OF_20),
    ("page/em.svg", refused(&["svg-size"])),
    ("page/exp.svg", LINE_OF_20),
    ("page/h_only.svg", LINE_OF_20),
    ("page/h_pct.svg", LINE_OF_20),
    ("page/mixed.svg", LINE_OF_20),
    ("page/neg_vb.svg", refused(&["svg-viewbox"])),
    ("page/novb.svg", line(40.0 * 25.4 / 96.0)),
    ("page/pc.svg", LINE_OF_20),
    ("page/pt.svg", LINE_OF_20),
    ("page/px.svg", refused(&["svg-size"])),
    ("page/q.svg", LINE_OF_20.or(&["svg-size"])),
    ("page/style_size.svg", LINE_OF_20.or(&["svg-size"])),
    ("page/three_vb.svg", refused(&["svg-viewbox"])),
    ("page/upper.svg", LINE_OF_20.or(&["svg-size"])),
    ("page/w_only.svg", LINE_OF_20),
    ("page/w_space.svg", LINE_OF_20),
    ("page/w_space_unit.svg", LINE_OF_20.or(&["svg-size"])),
    ("page/zero.svg", refused(&["svg-size"])),];

/// Share by which a length may be off.
const LENGTH: f64 = 0.005;

fn path(file: &str) -> PathBuf {
    fixture("drawings").join(file)
}

/// How lengths are taken: on profile xyz-galvo-40, lines of areas 50 um apart and 10 um within the border.
fn measured(file: &str, stroke: StrokeMode) -> Result<f64, String> {
    let marking = Marking { pitch_mm: Some(0.05), inset_mm: Some(0.01), stroke, ..Marking::default() };
    let loaded = load(&path(file), Size::File, 0.02, marking);
    loaded.map(|(texture, _)| length(&texture)).map_err(|e| format!("refused: {:?}", codes(e.diags())))
}

/// What is wrong with the lengths of a drawing that is read.
fn wrong_length(file: &str, outcome: &Outcome) -> Option<String> {
    let wanted = [(outcome.mm, StrokeMode::default()), (outcome.line_mm, StrokeMode::Centre)];
    wanted.into_iter().filter_map(|(mm, stroke)| Some((mm?, stroke))).find_map(|(mm, stroke)| {
        match measured(file, stroke) {
            Ok(found) if (found / mm - 1.0).abs() <= LENGTH => None,
            Ok(found) => Some(format!("{found:.1} mm for {mm:.1} mm")),
            Err(e) => Some(e),
        }
    })
}

/// What is wrong with a drawing.
fn fault(file: &str, outcome: &Outcome, shown: Option<(&Ink, f64)>) -> Option<String> {
    let verdict = match shown {
        Some((ink, height_mm)) => judge(&path(file), Size::File, height_mm, ink, file),
        None => match load(&path(file), Size::File, SPOT, Marking::default()) {
            Ok((_, notes)) => Verdict::Right(codes(&notes)),
            Err(e) => Verdict::Refused(codes(e.diags())),
        },
    };
    let is_any = |codes: &std::collections::BTreeSet<String>, of: &[&str]| of.iter().any(|&code| codes.contains(code));
    match &verdict {
        Verdict::Refused(codes) => {
            let is_blank = shown.is_some_and(|(ink, _)| ink.is_blank());
            let allowed = |code: &String| {
                outcome.refusals.contains(&code.as_str())
                    || outcome.is_warned && outcome.warnings.contains(&code.as_str())
            };
            let is_right = codes.iter().all(allowed) || is_blank && codes.iter().all(|code| code == "texture-empty");
            (!is_right).then(|| verdict.to_string())
        }
        Verdict::Right(_) | Verdict::Wrong { .. } if outcome.is_refused => Some(format!("is to be refused, {verdict}")),
        Verdict::Right(warnings) | Verdict::Wrong { warnings, .. } if is_any(warnings, outcome.warnings) => {
            wrong_length(file, outcome)
        }
        Verdict::Right(_) if outcome.is_warned => Some(format!("no warning: {verdict}")),
        Verdict::Right(_) => wrong_length(file, outcome),
        Verdict::Wrong { .. } => Some(verdict.to_string()),
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn every_drawing_is_marked_as_shown_or_refused_with_its_cause() {
    let rows: Vec<&(&str, Outcome)> = OUTCOMES.iter().filter(|(_, outcome)| outcome.is_shown).collect();
    let files: Vec<PathBuf> = rows.iter().map(|(file, outcome)| path(outcome.like.unwrap_or(file))).collect();
    let pictures = pictures(&files, Scale::PerMm(PER_MM));
    let seen = |(row, picture): (&&(&str, Outcome), &Result<crate::support::chromium::Picture, String>)| {
        let (file, outcome) = *row;
        match picture {
            Ok(picture) => fault(file, outcome, Some((&picture.ink(), picture.page_mm[1]))),
            Err(e) => Some(format!("Chromium: {e}")),
        }
        .map(|fault| format!("{file}: {fault}"))
    };
    let mut wrong: Vec<String> = rows.par_iter().zip(&pictures.list).filter_map(seen).collect();
    wrong.extend(without_a_picture());
    wrong.sort();
    assert!(wrong.is_empty(), "{} of {} are wrong:\n{}", wrong.len(), OUTCOMES.len(), wrong.join("\n"));
}

/// What is wrong with the drawings that are not compared with a picture.
fn without_a_picture() -> Vec<String> {
    let rows = OUTCOMES.par_iter().filter(|(_, outcome)| !outcome.is_shown);
    rows.filter_map(|(file, outcome)| Some(format!("{file}: {}", fault(file, outcome, None)?))).collect()
}

#[test]
fn drawings_without_a_picture_have_their_length_or_are_refused() {
    let wrong = without_a_picture();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn marks_have_the_length_of_what_is_shown() {
    let rows = OUTCOMES.par_iter().filter(|(_, outcome)| outcome.mm.is_some() || outcome.line_mm.is_some());
    let wrong = rows.filter_map(|(file, outcome)| {
        let may_be_refused = load(&path(file), Size::File, SPOT, Marking::default())
            .err()
            .is_some_and(|e| e.diags().iter().all(|d| outcome.refusals.contains(&d.code)));
        let fault = if may_be_refused { None } else { wrong_length(file, outcome) };
        Some(format!("{file}: {}", fault?))
    });
    let wrong: Vec<String> = wrong.collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_drawing_has_an_outcome() {
    let mut found = Vec::new();
    for folder in std::fs::read_dir(fixture("drawings")).expect("a folder") {
        let folder = folder.expect("an entry").path();
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let name = entry.expect("an entry").path();
            let name = name.strip_prefix(fixture("drawings")).expect("below it").display().to_string();
            found.extend(name.ends_with(".svg").then_some(name));
        }
    }
    found.sort();
    let is_like = |name: &str| OUTCOMES.iter().any(|(_, outcome)| outcome.like == Some(name));
    found.retain(|name| OUTCOMES.iter().any(|(file, _)| file == name) || !is_like(name));
    let mut files: Vec<&str> = OUTCOMES.iter().map(|(file, _)| *file).collect();
    files.sort_unstable();
    assert_eq!(found, files);
}

/// The lengths of the table are those that the program itself states.
#[test]
fn lengths_of_drawings_are_those_of_the_summary() {
    let dir = folder();
    let plate = dir.path().join("plate.obj");
    std::fs::write(&plate, "v 0 0 0\nv 50 0 0\nv 50 50 0\nv 0 50 0\nf 1 2 3 4\n").expect("a writable folder");
    for file in ["svg/bom_ws.svg", "svg2/v2_offset.svg", "svg3/miter_default.svg"] {
        let texture = format!("file = {:?}\npitch = \"50 um\"\ninset = \"10 um\"", path(file).display().to_string());
        let job = JobText::on(&plate).texture(&texture).write(dir.path(), "job.toml");
        let stated = number(&summary_of(&job), "mark_mm");
        let found = measured(file, StrokeMode::default()).expect("read");
        assert!((stated / found - 1.0).abs() < 1e-6, "{file}: {stated} mm, {found} mm");
    }
}
