//! 3MF files: a ZIP archive of XML models, with components and transforms.
//!
//! Consumes the model that the package starts with, and those that the production extension names (`p:path`). Build
//! items and components are placed by their transforms, composed in f64; a mirror turns the winding of its facets. The
//! unit is that of the file. Objects are held (24 bytes a vertex, 12 a triangle) and handed on once for each instance,
//! in the order of items and components; instances and facets are counted first, so that a small file cannot stand for
//! a huge one. Supports are left out with a warning, and so is what a slicer's project says is not the part
//! ([`slicer`]); bodies that it subtracts from the part are refused. Transforms that make an object flat are refused.

mod model;
mod package;
mod slicer;
mod transform;
mod xml;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use model::{Instance, Kind, Model, Object};
use package::Package;
use slicer::{Aside, Piece, Volume, Volumes};
use transform::Transform;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::place;
use terrace_core::diag::{Diag, Error, memory};

/// Most instances of objects, components within components included.
const MAX_INSTANCES: u64 = 1_000_000;
/// Most facets of all instances together: 13 GB of mesh.
const MAX_FACETS: u64 = 200_000_000;
/// Deepest nesting of components.
const MAX_NESTING: usize = 100;

const AGAIN: &str = "export the surface again as 3MF or STL";

/// Reads a 3MF file; `stated_mm` is the length of the unit that the job states, if any.
pub(crate) fn read(
    path: &Path,
    stated_mm: Option<f64>,
    options: &super::Options,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let scene = Scene::read(path)?;
    let (unit, unit_mm) = scene.models[0].unit;
    if let Some(stated) = stated_mm.filter(|stated| (stated - unit_mm).abs() > 1e-9 * unit_mm) {
        let text = format!("the file states its unit, {unit}; unit in [surface] is another ({stated} mm)");
        let d = Diag::input("surface-unit", text).at(place(path));
        return Err(d.hint("remove unit from [surface]: a 3MF file needs none").into());
    }
    let at = |d: Diag| d.at(place(path));
    let mut tally = Tally { known: vec![BTreeMap::new(); scene.models.len()], left_out: BTreeSet::new() };
    let mut total = Count::default();
    for (i, item) in scene.models[0].items.iter().enumerate() {
        total = total.plus(scene.count_item(i, item, &mut tally).map_err(at)?);
    }
    if total.instances > MAX_INSTANCES || total.facets > MAX_FACETS {
        let text = format!(
            "items and components place objects {} times, {} facets in all; at most {MAX_INSTANCES} and {MAX_FACETS} \
             are read",
            total.instances, total.facets
        );
        return Err(at(Diag::input("3mf-components", text)).hint("export the part alone, as one mesh").into());
    }
    memory::ask("the mesh", super::FACET_BYTES.saturating_mul(total.facets)).map_err(at)?;
    let remedy = format!("the file is in {unit}: check the scale of its export; parts lie near their origin");
    let scale = options.scale.unwrap_or(1.0);
    let unit = Unit { mm: unit_mm * scale, scale, datum: options.datum.unwrap_or_default() };
    let mut facets = Facets::with_remedy(path, unit, remedy, sink);
    for item in scene.models[0].items.iter().filter(|item| item.is_printable) {
        scene.place(0, item, &Transform::IDENTITY, &mut facets).map_err(at)?;
    }
    notes.extend(scene.notes(total, &tally.left_out).into_iter().map(at));
    if facets.count() == 0 {
        let text = match tally.left_out.is_empty() {
            true => "the objects that the file builds have no triangles".to_owned(),
            false => format!("nothing is the part: {} left out", first_ten(&tally.left_out)),
        };
        return Err(at(Diag::input("surface-empty", text)).hint("export the surface as triangles").into());
    }
    facets.finish(notes)
}

/// Names joined, the first ten of them.
fn first_ten(names: impl IntoIterator<Item = impl AsRef<str>, IntoIter: ExactSizeIterator>) -> String {
    let names = names.into_iter();
    let more = names.len().saturating_sub(10);
    let shown: Vec<String> = names.take(10).map(|name| name.as_ref().to_owned()).collect();
    let end = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{end}", shown.join(", "))
}

/// All models of a file, the one that builds first.
struct Scene {
    models: Vec<Model>,
    by_name: BTreeMap<String, usize>,
}

/// What was counted.
struct Tally {
    /// By model: the objects that are counted, None for those that are being.
    known: Vec<BTreeMap<usize, Option<Count>>>,
    /// What is left out because it is not the part.
    left_out: BTreeSet<String>,
}

impl Tally {
    /// Leaves something out; refused where it is to be subtracted.
    fn leave_out(&mut self, aside: &Aside) -> Result<(), Diag> {
        if aside.is_negative {
            let text = format!("{} is to be subtracted from the part, which terrace does not do", aside.text);
            return Err(Diag::input("3mf-negative", text).hint("subtract it in CAD and export the part as one mesh"));
        }
        self.left_out.insert(aside.text.clone());
        Ok(())
    }
}

/// What an instance comes to.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    instances: u64,
    facets: u64,
    supports: u64,
}

impl Count {
    fn plus(self, other: Self) -> Self {
        Self {
            instances: self.instances.saturating_add(other.instances),
            facets: self.facets.saturating_add(other.facets),
            supports: self.supports.saturating_add(other.supports),
        }
    }
}

impl Scene {
    /// Reads the model that builds, and those that it names.
    fn read(path: &Path) -> Result<Self, Error> {
        let mut package = Package::open(path)?;
        let root = package.root()?;
        let at = |d: Diag| Error::from(d.at(place(path)));
        let mut scene = Self { models: Vec::new(), by_name: BTreeMap::new() };
        let mut names = vec![root];
        while scene.models.len() < names.len() {
            let name = names[scene.models.len()].clone();
            package.check_relationships(&name)?;
            let mut model = package.part(&name, u64::MAX, model::read)?;
            let is_root = scene.models.is_empty();
            if is_root && model.items.is_empty() {
                let d = Diag::input("3mf-object", format!("{name} has no build items: nothing is to be made"));
                return Err(at(d.hint("put the part on the build plate and export it again")));
            }
            for instance in instances(&mut model) {
                let Some(named) = instance.path.take() else { continue };
                if !is_root {
                    let d = Diag::input("3mf-part", format!("{name} refers to another model; only the first may"));
                    return Err(at(d.hint(AGAIN)));
                }
                let named = package.named(&named)?;
                if !names.contains(&named) {
                    names.push(named.clone());
                }
                instance.path = Some(named);
            }
            let first = scene.models.first().unwrap_or(&model);
            if first.unit.0 != model.unit.0 {
                let text = format!("{} is in {}, {name} in {}", names[0], first.unit.0, model.unit.0);
                let d = Diag::input("surface-unit", format!("the models of the file have two units: {text}"));
                return Err(at(d.hint(AGAIN)));
            }
            scene.by_name.insert(name, scene.models.len());
            scene.models.push(model);
        }
        for name in package.names(slicer::has_volumes) {
            let volumes = package.part(&name, slicer::MAX_SETTINGS, slicer::read)?;
            scene.assign(volumes).map_err(at)?;
        }
        for object in scene.models.iter_mut().flat_map(|m| &mut m.objects) {
            separate(object).map_err(at)?;
        }
        Ok(scene)
    }

    /// Gives the objects and components of the first model the volumes that a slicer states.
    fn assign(&mut self, volumes: Volumes) -> Result<(), Diag> {
        let model = &mut self.models[0];
        for (id, volumes) in volumes {
            let Some(&number) = model.by_id.get(&id) else { continue };
            let object = &mut model.objects[number];
            let (ranges, parts): (Vec<Volume>, Vec<Volume>) =
                volumes.into_iter().partition(|volume| matches!(volume.piece, Piece::Triangles(..)));
            object.volumes.extend(ranges);
            assign_parts(object, &parts)?;
        }
        Ok(())
    }

    /// What the user should know of the file.
    fn notes(&self, total: Count, left_out: &BTreeSet<String>) -> Vec<Diag> {
        let mut notes = Vec::new();
        if total.supports > 0 {
            let text = format!("support objects that are not read: {} instances", total.supports);
            notes.push(Diag::warning("3mf-support", text).hint("supports are not the part"));
        }
        if !left_out.is_empty() {
            let text = format!("left out, since the file says that they are not the part: {}", first_ten(left_out));
            notes.push(Diag::warning("3mf-left-out", text).hint("export the part alone if one of them belongs to it"));
        }
        let mut foreign = BTreeMap::<&str, usize>::new();
        for (element, n) in self.models.iter().flat_map(|m| &m.foreign) {
            *foreign.entry(element).or_default() += n;
        }
        if !foreign.is_empty() {
            let all: Vec<String> = foreign.iter().map(|(element, n)| format!("{element} ({n})")).collect();
            let text = format!("elements of objects that are not read: {}", first_ten(&all));
            notes.push(Diag::warning("3mf-elements", text).hint("only meshes and components are the surface"));
        }
        let odd: BTreeSet<&String> = self.models.iter().flat_map(|m| &m.odd_metadata).collect();
        if !odd.is_empty() {
            let text = format!("metadata that 3MF does not know, or twice: {}", first_ten(&odd));
            notes.push(Diag::warning("3mf-metadata", text).hint("they change no geometry"));
        }
        notes
    }

    /// What build item `i` comes to.
    fn count_item(&self, i: usize, item: &Instance, tally: &mut Tally) -> Result<Count, Diag> {
        if item.is_printable {
            return self.count(0, item, tally, 0);
        }
        tally.left_out.insert(format!("item {} (object {}), which is not printable", i + 1, item.object));
        Ok(Count::default())
    }

    /// The model and the number of the object of an instance.
    fn find(&self, model: usize, instance: &Instance) -> Result<(usize, usize), Diag> {
        let model = instance.path.as_ref().map_or(model, |path| self.by_name[path]);
        let number = self.models[model].by_id.get(&instance.object);
        number.map(|&n| (model, n)).ok_or_else(|| {
            let text = format!("an item or component refers to object {}, which is not there", instance.object);
            Diag::input("3mf-object", text).hint(AGAIN)
        })
    }

    /// What an instance comes to.
    fn count(&self, model: usize, instance: &Instance, tally: &mut Tally, depth: usize) -> Result<Count, Diag> {
        let (model, number) = self.find(model, instance)?;
        let object = &self.models[model].objects[number];
        if let Some(aside) = instance.aside.as_ref().or(object.aside.as_ref()) {
            tally.leave_out(aside)?;
            return Ok(Count { instances: 1, ..Count::default() });
        }
        check_kind(object)?;
        if let Some(counted) = tally.known[model].get(&number) {
            return counted.ok_or_else(|| {
                let text = format!("object {} is a component of itself", object.id);
                Diag::input("3mf-components", text).hint(AGAIN)
            });
        }
        if depth > MAX_NESTING {
            let text = format!("components are nested more than {MAX_NESTING} deep");
            return Err(Diag::input("3mf-components", text).hint("export the part alone, as one mesh"));
        }
        tally.known[model].insert(number, None);
        let mut count = Count { instances: 1, facets: object.triangles.len() as u64, supports: 0 };
        if object.kind == Kind::Support {
            count = Count { instances: 1, facets: 0, supports: 1 };
        } else {
            object.volumes.iter().filter_map(|volume| volume.aside(object.id)).try_for_each(|a| tally.leave_out(&a))?;
            for component in &object.components {
                count = count.plus(self.count(model, component, tally, depth + 1)?);
            }
        }
        tally.known[model].insert(number, Some(count));
        Ok(count)
    }

    /// Hands on the facets of an instance; it was counted, so that its objects are there and it ends.
    fn place(&self, model: usize, instance: &Instance, outer: &Transform, facets: &mut Facets<'_>) -> Result<(), Diag> {
        let (model, number) = self.find(model, instance)?;
        let object = &self.models[model].objects[number];
        if object.kind == Kind::Support || instance.aside.is_some() || object.aside.is_some() {
            return Ok(());
        }
        let whole = instance.transform.then(outer);
        let mirrors = whole.mirrors();
        for triangle in &object.triangles {
            let [a, b, c] = triangle.map(|v| whole.apply(object.vertices[v as usize]));
            if ![a, b, c].iter().flatten().all(|v| v.is_finite()) {
                let text = format!("object {} has no finite coordinates after its transforms", object.id);
                return Err(Diag::input("surface-number", text).hint(AGAIN));
            }
            facets.push(if mirrors { [a, c, b] } else { [a, b, c] });
        }
        object.components.iter().try_for_each(|component| self.place(model, component, &whole, facets))
    }
}

/// All instances of a model: its items and the components of its objects.
fn instances(model: &mut Model) -> impl Iterator<Item = &mut Instance> {
    model.items.iter_mut().chain(model.objects.iter_mut().flat_map(|o| &mut o.components))
}

/// Gives components, or the object itself, the volumes that a slicer names by the ids of their objects. Volumes may
/// share the mesh of one object; they come in the order of the components.
fn assign_parts(object: &mut Object, volumes: &[Volume]) -> Result<(), Diag> {
    let mut by_id = BTreeMap::<u32, Vec<&Volume>>::new();
    for volume in volumes {
        if let Piece::Component(id) = volume.piece {
            by_id.entry(id).or_default().push(volume);
        }
    }
    if let Some([volume]) = by_id.get(&object.id).map(Vec::as_slice) {
        object.aside = volume.aside(object.id);
        by_id.remove(&object.id);
    }
    let mut met = BTreeMap::<u32, usize>::new();
    for component in &mut object.components {
        let Some(volumes) = by_id.get(&component.object) else { continue };
        let n = met.entry(component.object).or_default();
        component.aside = volumes[(*n).min(volumes.len() - 1)].aside(object.id);
        *n += 1;
    }
    let lost = by_id.iter().filter(|(id, _)| !met.contains_key(id)).flat_map(|(_, volumes)| volumes);
    match lost.filter_map(|volume| volume.aside(object.id)).next() {
        None => Ok(()),
        Some(aside) => {
            let text = format!("{} is not one of the components of the object", aside.text);
            Err(Diag::input("3mf-volumes", text).hint(AGAIN))
        }
    }
}

/// Takes the triangles that are not the part out of an object.
fn separate(object: &mut Object) -> Result<(), Diag> {
    if object.volumes.iter().all(|volume| volume.aside(object.id).is_none()) {
        return Ok(());
    }
    let mut ranges: Vec<(usize, usize, bool)> = Vec::new();
    for volume in &object.volumes {
        if let Piece::Triangles(first, last) = volume.piece {
            ranges.push((first, last, volume.aside(object.id).is_none()));
        }
    }
    ranges.sort_unstable();
    ranges.dedup();
    let mut kept = Vec::new();
    let mut next = 0;
    for (first, last, is_part) in ranges {
        let range = object.triangles.get(first..=last).filter(|_| first == next);
        let Some(range) = range else { return Err(no_tiling(object)) };
        if is_part {
            kept.extend_from_slice(range);
        }
        next = last + 1;
    }
    if next != object.triangles.len() {
        return Err(no_tiling(object));
    }
    object.triangles = kept;
    Ok(())
}

fn no_tiling(object: &Object) -> Diag {
    let (id, n) = (object.id, object.triangles.len());
    let text = format!("the volumes of object {id} do not divide its {n} triangles: the file was changed since");
    Diag::input("3mf-volumes", text).hint("open it in the slicer, save it again, or export it as STL")
}

/// Refuses objects that cannot be built.
fn check_kind(object: &Object) -> Result<(), Diag> {
    if object.kind == Kind::Other {
        let text = format!("the build refers to object {}, whose type is not to be built", object.id);
        return Err(Diag::input("3mf-object", text).hint(AGAIN));
    }
    if !object.has_shape() {
        let text = format!("object {} has neither a mesh nor components", object.id);
        return Err(Diag::input("3mf-object", text).hint("export the surface as plain triangles"));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
