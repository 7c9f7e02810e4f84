//! Reader of LightBurn projects: one `.lbrn2` file for every block.
//!
//! Consumes the bytes of one file; hands over each stroke in the order of the shapes, in whole nanometres from the
//! middle of the field, with its layer and the layer's settings. A stroke is a chain of lines between vertices that
//! follow each other. The file is read whole: elements and attributes are those that stand here, with the values that
//! they must have, and anything else is a fault. LightBurn applies attributes too, as a scale of the power of a shape.

use std::collections::{BTreeMap, BTreeSet};

use roxmltree::{Document, Node};

use super::comments::printable;
use super::number::{integer, millionths, nm_from_decimal};
use super::{BlockOf, Fault, FileStroke, Strokes};
use terrace_core::program::Pen;

/// Settings of a layer: power and speed in millionths of a percent and of a mm/s, rate in Hz, passes.
type Layer = [i64; 4];

/// Elements of a setting, each once.
const KNOWN: [&str; 8] = ["index", "name", "maxPower", "maxPower2", "speed", "frequency", "numPasses", "priority"];

/// The first line.
const DECLARATION: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";

/// Attributes of the project.
const PROJECT: [(&str, &str); 5] = [
    ("AppVersion", "1.4.00"),
    ("FormatVersion", "1"),
    ("MaterialHeight", "0"),
    ("MirrorX", "False"),
    ("MirrorY", "False"),
];

/// The settings that a stroke with this pen should have.
pub(super) fn settings(of: &BlockOf<'_>, pen: &Pen) -> Vec<i64> {
    let rounded = |v: f64| (v * 1e6).round() as i64;
    let percent = pen.power.share(of.machine.laser.max_power) * 100.0;
    let hz = (pen.frequency.as_khz() * 1e3).round() as i64;
    vec![rounded(percent), rounded(pen.speed.as_mm_s()), hz, i64::from(pen.passes)]
}

/// Reads the project of a block, and hands each of its strokes to `visit`.
pub(super) fn strokes(bytes: &[u8], of: &BlockOf<'_>, visit: &mut Strokes<'_>) -> Result<(), Fault> {
    // The optical axis is the middle of the field: half its size from the corner, 5e5 nm for each mm.
    let field = &of.machine.lens.field;
    let (x, y) = if of.machine.scanner.swap_xy { (field[1], field[0]) } else { (field[0], field[1]) };
    let middle = [x, y].map(|size| (size.as_mm() * 5e5).round() as i64);
    let text = printable(bytes)?;
    if !text.starts_with(DECLARATION) {
        return Err(Fault::new(1, format!("does not begin with {}", DECLARATION.trim_end())));
    }
    let document = Document::parse(text).map_err(|e| Fault::new(e.pos().row as usize, e.to_string()))?;
    let fault = |node: &Node<'_, '_>, what: &str| {
        Fault::new(document.text_pos_at(node.range().start).row as usize, what.to_owned())
    };
    let root = document.root_element();
    if root.tag_name().name() != "LightBurnProject" {
        return Err(fault(&root, "is not a LightBurn project"));
    }
    let has_values = PROJECT.iter().all(|(name, value)| root.attribute(*name) == Some(value));
    if !has_values || root.attributes().len() != PROJECT.len() {
        return Err(fault(&root, "the attributes of the project are not those of a plain one"));
    }
    if let Some(node) = document.descendants().find(is_foreign) {
        return Err(fault(&node, "is neither a setting nor a shape"));
    }
    let mut layers: BTreeMap<i64, Layer> = BTreeMap::new();
    let mut used = BTreeSet::new();
    let (mut points, mut ends) = (Vec::new(), Vec::new());
    for node in root.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "CutSetting" => {
                let (index, layer) = setting(&node, of.id).map_err(|what| fault(&node, &what))?;
                if layers.insert(index, layer).is_some() {
                    return Err(fault(&node, "a layer has two settings"));
                }
            }
            "Shape" => {
                let index = node.attribute("CutIndex").and_then(|v| integer(v.as_bytes()));
                used.extend(index);
                let layer = index.and_then(|i| Some((usize::try_from(i).ok()?, layers.get(&i)?)));
                let (index, layer) = layer.ok_or_else(|| fault(&node, "the shape has a layer without settings"))?;
                let moved_to = shape(&node, &mut points, &mut ends).map_err(|what| fault(&node, what))?;
                if moved_to != middle {
                    return Err(fault(&node, "the shape is not moved to the middle of the field"));
                }
                let mut from = 0;
                for &end in &ends {
                    // Layers count from 0, pens from 1.
                    visit(FileStroke { pen: Some(index + 1), points: &points[from..end], settings: layer });
                    from = end;
                }
            }
            _ => return Err(fault(&node, "is neither a setting nor a shape")),
        }
    }
    match layers.keys().find(|index| !used.contains(*index)) {
        Some(index) => Err(fault(&root, &format!("layer {index} holds nothing"))),
        None => Ok(()),
    }
}

/// Whether a node has no place in a project: text holds places alone, and comments and instructions nothing.
fn is_foreign(node: &Node<'_, '_>) -> bool {
    let is_blank = node.text().is_some_and(|text| text.bytes().all(|c| c == b'\n'));
    let holds_places =
        node.parent().is_some_and(|parent| ["XForm", "VertList", "PrimList"].contains(&parent.tag_name().name()));
    !(node.is_root() || node.is_element() || node.is_text() && (is_blank || holds_places))
        || node.is_element() && node.tag_name().namespace().is_some()
}

/// Index and settings of a layer of block `id`.
fn setting(node: &Node<'_, '_>, id: &str) -> Result<(i64, Layer), String> {
    if node.attribute("type") != Some("Cut") || node.attributes().len() != 1 {
        return Err("the setting is not of type Cut, and nothing else".into());
    }
    let mut values = BTreeMap::new();
    for child in node.children().filter(Node::is_element) {
        let name = child.tag_name().name();
        let is_known = KNOWN.contains(&name) && child.attributes().len() == 1 && !child.has_children();
        let value = child.attribute("Value").filter(|_| is_known);
        let value = value.ok_or_else(|| format!("{name} is not expected in a setting"))?;
        if values.insert(name, value).is_some() {
            return Err(format!("{name} is given twice"));
        }
    }
    let get = |name: &str| values.get(name).copied().ok_or_else(|| format!("the setting has no {name}"));
    let decimal = |name: &str| {
        let value = millionths(get(name)?.as_bytes());
        value.ok_or_else(|| format!("{name} is not a decimal"))
    };
    let whole = |name: &str| integer(get(name)?.as_bytes()).ok_or_else(|| format!("{name} is not a whole number"));
    if decimal("maxPower")? != decimal("maxPower2")? {
        return Err("maxPower and maxPower2 differ".into());
    }
    let index = whole("index")?;
    // Whoever loads the project goes by the name of a layer, and layers of lower priority are marked first.
    if get("name")? != format!("{id}_P{}", index + 1) || whole("priority")? != index {
        return Err("name and priority are not those of the layer".into());
    }
    Ok((index, [decimal("maxPower")?, decimal("speed")?, whole("frequency")?, whole("numPasses")?]))
}

/// Vertices of a shape, and where each of its strokes ends among them; returns where the shape is moved, nm.
fn shape(node: &Node<'_, '_>, points: &mut Vec<[i64; 2]>, ends: &mut Vec<usize>) -> Result<[i64; 2], &'static str> {
    if node.attribute("Type") != Some("Path") || node.attributes().len() != 2 {
        return Err("the shape is not a path on a layer, and nothing else");
    }
    if node.children().any(|child| child.attributes().len() != 0 || child.children().any(|c| c.is_element())) {
        return Err("its parts hold more than text");
    }
    let child = |name: &str| {
        let mut found = node.children().filter(|c| c.tag_name().name() == name);
        found.next().filter(|_| found.next().is_none()).and_then(|c| c.text())
    };
    if node.children().filter(Node::is_element).count() != 3 {
        return Err("the shape does not have XForm, VertList and PrimList alone");
    }
    let form: Vec<&str> = child("XForm").ok_or("the shape has no XForm")?.split(' ').collect();
    let ["1", "0", "0", "1", x, y] = form[..] else { return Err("the shape is not moved alone") };
    let middle = [x, y].map(|v| nm_from_decimal(v.as_bytes()));
    let [Some(x), Some(y)] = middle else { return Err("the shape is not moved by whole nanometres") };
    points.clear();
    let vertices = child("VertList").ok_or("the shape has no VertList")?;
    for vertex in vertices.split('V').skip(1) {
        let at = vertex.strip_suffix("c0x1c1x1").and_then(|v| v.split_once(' '));
        let at = at.and_then(|(x, y)| Some([nm_from_decimal(x.as_bytes())?, nm_from_decimal(y.as_bytes())?]));
        points.push(at.ok_or("a vertex is not a corner at whole nanometres")?);
    }
    if !vertices.starts_with('V') {
        return Err("something stands before the first vertex");
    }
    ends.clear();
    let lines = child("PrimList").ok_or("the shape has no PrimList")?;
    if !lines.starts_with('L') {
        return Err("something stands before the first line");
    }
    // Lines go from each vertex to the next; where one is missing a stroke ends.
    let mut at = 0;
    for line in lines.split('L').skip(1) {
        let ends_of = line.split_once(' ').and_then(|(a, b)| Some((integer(a.as_bytes())?, integer(b.as_bytes())?)));
        let Some((a, b)) = ends_of.and_then(|(a, b)| Some((usize::try_from(a).ok()?, usize::try_from(b).ok()?))) else {
            return Err("a line does not name two vertices");
        };
        if b != a + 1 || b >= points.len() || !(a == at || a == at + 1 && at > 0) {
            return Err("a line does not go from a vertex to the next");
        }
        if a != at {
            ends.push(a);
        }
        at = b;
    }
    ends.push(at + 1);
    if at + 1 == points.len() { Ok([x, y]) } else { Err("a vertex belongs to no line") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::machine::Machine;

    const TEXT: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<LightBurnProject AppVersion=\"1.4.00\" \
        FormatVersion=\"1\" MaterialHeight=\"0\" MirrorX=\"False\" MirrorY=\"False\">\n\
        <CutSetting type=\"Cut\">\n<index Value=\"1\"/><name Value=\"B0001_P2\"/><maxPower Value=\"25.5\"/>\
        <maxPower2 Value=\"25.5\"/><speed Value=\"400\"/><frequency Value=\"80000\"/><numPasses Value=\"3\"/>\n\
        <priority Value=\"1\"/>\
        </CutSetting>\n<Shape Type=\"Path\" CutIndex=\"1\">\n<XForm>1 0 0 1 20 20.5</XForm>\n\
        <VertList>V-1 0c0x1c1x1V2 0.000001c0x1c1x1V3 3c0x1c1x1V5 5c0x1c1x1V6 6c0x1c1x1</VertList>\n\
        <PrimList>L0 1L1 2L3 4</PrimList>\n</Shape>\n</LightBurnProject>\n";

    type ReadStroke = (Option<usize>, Vec<[i64; 2]>, Vec<i64>);

    fn read(text: &str) -> Result<Vec<ReadStroke>, Fault> {
        let mut out = Vec::new();
        let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
        machine.lens.field[1] = terrace_core::units::Length::mm(41.0);
        let (program, _) = terrace_core::program::sample::program();
        let of = BlockOf { id: "B0001", block: &program.blocks[0], machine: &machine };
        strokes(text.as_bytes(), &of, &mut |s| out.push((s.pen, s.points.to_vec(), s.settings.to_vec())))?;
        Ok(out)
    }

    #[test]
    fn strokes_come_in_order_with_the_settings_of_their_layer() {
        let settings = vec![25_500_000, 400_000_000, 80_000, 3];
        let found = read(TEXT).expect("a project");
        let points = vec![[-1_000_000, 0], [2_000_000, 1], [3_000_000, 3_000_000]];
        assert_eq!(found[0], (Some(2), points, settings.clone()));
        assert_eq!(found[1], (Some(2), vec![[5_000_000; 2], [6_000_000; 2]], settings));
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn whatever_lightburn_would_mark_or_apply_otherwise_is_a_fault() {
        for (from, to) in [
            ("MirrorX=\"False\"", "MirrorX=\"True\""),
            ("MirrorX=\"False\"", "MirrorX=\"False\" Origin=\"1 1\""),
            ("CutIndex=\"1\"", "CutIndex=\"1\" PowerScale=\"10\""),
            ("type=\"Cut\"", "type=\"Cut\" subname=\"x\""),
            ("<speed Value=\"400\"/>", "<speed Value=\"400\" Unit=\"1\"/>"),
            ("<priority Value=\"1\"/>", "<priority Value=\"0\"/>"),
            ("B0001_P2", "B0001_P1"),
            ("<XForm>", "<XForm a=\"1\">"),
            ("<Shape ", "<!-- note --><Shape "),
            ("<Shape ", "<?note a?><Shape "),
            ("<Shape ", "text<Shape "),
            (
                "<Shape ",
                "<CutSetting type=\"Cut\">\n<index Value=\"2\"/><name Value=\"B0001_P3\"/><maxPower Value=\"1\"/>\
             <maxPower2 Value=\"1\"/><speed Value=\"4\"/><frequency Value=\"8\"/><numPasses Value=\"1\"/>\
             <priority Value=\"2\"/></CutSetting><Shape ",
            ),
            ("type=\"Cut\"", "type=\"Scan\""),
            ("Type=\"Path\"", "Type=\"Rect\""),
            ("CutIndex=\"1\"", "CutIndex=\"0\""),
            ("1 0 0 1 20", "0 1 1 0 20"),
            ("1 0 0 1 20", "1 0 0 1 20.1"),
            ("<maxPower2 Value=\"25.5\"/>", "<maxPower2 Value=\"60\"/>"),
            ("<speed Value=\"400\"/>", ""),
            ("<speed Value=\"400\"/>", "<speed Value=\"4e2\"/>"),
            ("<numPasses", "<wobbleEnable Value=\"1\"/><numPasses"),
            ("V3 3c0x1c1x1", "V3 3c0x1.5c1x1"),
            ("V3 3c0x1", "V3 NaNc0x1"),
            ("L1 2L3 4", "L1 2L2 4"),
            ("L1 2L3 4", "L1 2"),
            ("L1 2L3 4", "L3 4L1 2"),
            ("L1 2L3 4", "L1 2L3 9"),
            ("L0 1L1", "B0 1L1"),
            ("</LightBurnProject>", "<Text/></LightBurnProject>"),
            ("</LightBurnProject>", ""),
        ] {
            assert!(TEXT.contains(from), "{from}");
            assert!(read(&TEXT.replacen(from, to, 1)).is_err(), "{from} -> {to}");
        }
        for end in 0..TEXT.len() - 1 {
            assert!(TEXT.is_char_boundary(end) && read(&TEXT[..end]).is_err(), "cut at {end}");
        }
    }
}
