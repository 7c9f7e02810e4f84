//! 3MF files: a ZIP archive of XML models, with components and transforms.
//!
//! Consumes the model that the package starts with, and those that the production extension names (`p:path`). Build
//! items and components are placed by their transforms, composed in f64; a mirror turns the winding of its facets. The
//! unit is that of the file. Objects are held (24 bytes a vertex, 12 a triangle) and handed on once for each instance,
//! in the order of items and components; instances and facets are counted first, so that a small file cannot stand for
//! a huge one. Supports are left out with a warning. Transforms that make an object flat are refused.

mod model;
mod package;
mod transform;

use std::collections::BTreeMap;
use std::path::Path;

use model::{Instance, Kind, Model, Object};
use package::Package;
use transform::Transform;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::place;
use crate::diag::{Diag, Error, memory};

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
    let mut counts = vec![BTreeMap::new(); scene.models.len()];
    let mut total = Count::default();
    for item in &scene.models[0].items {
        let count = scene.count(0, item, &mut counts, 0).map_err(at)?;
        total = total.plus(count);
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
    for item in &scene.models[0].items {
        scene.place(0, item, &Transform::IDENTITY, &mut facets).map_err(at)?;
    }
    if total.supports > 0 {
        let text = format!("support objects that are not read: {} instances", total.supports);
        notes.push(at(Diag::warning("3mf-support", text)).hint("supports are not the part"));
    }
    let mut foreign = BTreeMap::<&str, usize>::new();
    for (element, n) in scene.models.iter().flat_map(|m| &m.foreign) {
        *foreign.entry(element).or_default() += n;
    }
    if !foreign.is_empty() {
        let all: Vec<String> = foreign.iter().take(10).map(|(element, n)| format!("{element} ({n})")).collect();
        let text = format!("elements of objects that are not read: {}", all.join(", "));
        notes.push(at(Diag::warning("3mf-elements", text)).hint("only meshes and components are the surface"));
    }
    if facets.count() == 0 {
        let d = at(Diag::input("surface-empty", "the objects that the file builds have no triangles"));
        return Err(d.hint("export the surface as triangles").into());
    }
    facets.finish(notes)
}

/// All models of a file, the one that builds first.
struct Scene {
    models: Vec<Model>,
    by_name: BTreeMap<String, usize>,
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
        Ok(scene)
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

    /// What an instance comes to. `known` has the objects that are counted, None those that are being.
    fn count(
        &self,
        model: usize,
        instance: &Instance,
        known: &mut [BTreeMap<usize, Option<Count>>],
        depth: usize,
    ) -> Result<Count, Diag> {
        let (model, number) = self.find(model, instance)?;
        let object = &self.models[model].objects[number];
        check_kind(object, depth)?;
        if let Some(counted) = known[model].get(&number) {
            return counted.ok_or_else(|| {
                let text = format!("object {} is a component of itself", object.id);
                Diag::input("3mf-components", text).hint(AGAIN)
            });
        }
        if depth > MAX_NESTING {
            let text = format!("components are nested more than {MAX_NESTING} deep");
            return Err(Diag::input("3mf-components", text).hint("export the part alone, as one mesh"));
        }
        known[model].insert(number, None);
        let mut count = Count { instances: 1, facets: object.triangles.len() as u64, supports: 0 };
        if object.kind == Kind::Support {
            count = Count { instances: 1, facets: 0, supports: 1 };
        } else {
            for component in &object.components {
                count = count.plus(self.count(model, component, known, depth + 1)?);
            }
        }
        known[model].insert(number, Some(count));
        Ok(count)
    }

    /// Hands on the facets of an instance; it was counted, so that its objects are there and it ends.
    fn place(&self, model: usize, instance: &Instance, outer: &Transform, facets: &mut Facets<'_>) -> Result<(), Diag> {
        let (model, number) = self.find(model, instance)?;
        let object = &self.models[model].objects[number];
        if object.kind == Kind::Support {
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

/// Refuses objects that cannot be built; `depth` is 0 for those of build items.
fn check_kind(object: &Object, depth: usize) -> Result<(), Diag> {
    if object.kind == Kind::Other && depth == 0 {
        let text = format!("a build item refers to object {}, whose type is not to be built", object.id);
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
